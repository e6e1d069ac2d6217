// What the hands do, from whichever device, to the lab: every change at once, with a sequence number; a heartbeat
// repeats the present state. A press and its release are two messages, so a short tap between two ticks still counts.
// Nothing is queued: what cannot be sent now is never sent late.

import { Emitter } from "../common/emitter.js";
import { HeartbeatTimer } from "../wire/heartbeat.js";
import { remembered } from "./gamepad.js";
import { chosenDevice } from "./keyboard.js";

/** @import { Heartbeat, Welcome } from "../../tests/javascript/wire.d.ts" */
/** @import { LabSocket } from "../wire/socket.js" */
/** @import { Pad, Pads } from "./gamepad.js" */
/** @import { ChosenDevice, GripperPress, HandsEvents, Keyboard } from "./keyboard.js" */
/** @import { Action, Direction } from "./mapping.js" */
/** @typedef {NonNullable<Heartbeat["device"]>} Device */
/**
 * What the hands do, whether they drive or not; `waiting` is pushed, and counts once it was let go.
 *
 * @typedef {{ direction: Direction | null, device: Device, waiting: Action[] }} Hands
 */

const SLEPT_MS = 1000; // so long without a frame and without a beat: the computer slept, or the page stood still

/**
 * @param {Direction | null} a
 * @param {Direction | null} b
 * @returns {boolean}
 */
function sameDirection(a, b) {
  return a === b || (a !== null && b !== null && a.every((value, axis) => value === b[axis]));
}

/**
 * Emits "hands" for indicators, "gripper" and "view" (switch it) for each press, "device" when the
 * pad in use comes or goes.
 *
 * @extends {Emitter<{ hands: Hands, gripper: GripperPress, view: null, device: { device: Device, there: boolean, again: boolean } }>}
 */
export class Input extends Emitter {
  /** @param {{ socket: LabSocket, keyboard: Keyboard, pads: Pads, session: string }} wiring */
  constructor({ socket, keyboard, pads, session }) {
    super();
    this.socket = socket;
    this.keyboard = keyboard;
    this.pads = pads;
    this.session = session;
    this.seq = 0;
    this.driving = false; // hands reach the robot only now
    /** @type {Direction | null} */
    this.direction = null; // as told to the lab
    /** @type {ChosenDevice["device"] | null} */
    this.chosen = null;
    this._everyMs = 0;
    this._awakeMs = performance.now();
    this._awakeWallMs = Date.now();
    this._timer = new HeartbeatTimer();
    this._timer.addEventListener("beat", () => this._beat());
    this._timer.addEventListener("fallback", (event) => {
      console.warn("heartbeat: no worker, the page's own timer beats:", event.detail);
      socket.note("heartbeat_by_timer", { why: event.detail });
    });
    for (const device of /** @type {Emitter<HandsEvents>[]} */ ([keyboard, pads])) {
      device.addEventListener("hands", () => this._changed());
      device.addEventListener("gripper", (event) => this._gripper(event.detail));
      device.addEventListener("view", () => this.emit("view"));
    }
    pads.addEventListener("frame", () => this._wake());
    pads.addEventListener("pads", () => this._announce());
    pads.addEventListener("plug", (event) => this._plugged(event.detail));
    socket.addEventListener("welcome", (event) => this._welcome(event.detail));
    document.addEventListener("visibilitychange", () => {
      socket.note(document.hidden ? "hidden" : "visible");
      this._beat();
    });
    this._restore();
  }

  /**
   * The device in use: the chosen one, or the keyboard while the chosen pad is unplugged.
   *
   * @returns {Device}
   */
  get device() {
    if (this.chosen === "gamepad") return this.pads.present ? "gamepad" : "keyboard";
    return this.chosen ?? "none";
  }

  /**
   * Called by the set-up: "keyboard", or "gamepad" with its pad.
   *
   * @param {ChosenDevice["device"]} device
   * @param {Pad | null} [pad]
   * @param {number | null} [slot] where the browser lists the pad
   * @returns {void}
   */
  choose(device, pad = null, slot = null) {
    this.chosen = device;
    chosenDevice.set(this.session, { device, pad_id: pad?.padId ?? null });
    this.pads.use(device === "gamepad" ? pad : null, slot);
    this._announce();
  }

  /**
   * Turns the hands on or off. Off lets go of everything: what is held then counts once it was let go and pressed anew.
   *
   * @param {boolean} on
   * @returns {void}
   */
  drive(on) {
    if (this.driving === on) return;
    this.driving = on;
    if (on && this.keyboard.scope === null) this.keyboard.listen(document);
    if (!on) {
      this.keyboard.listen(null);
      this.pads.release();
    }
    this._changed();
  }

  /**
   * Hands as they are, whether they drive or not: the pad, else the keyboard.
   *
   * @returns {Direction | null}
   */
  hands() {
    const padDirection = this.pads.direction();
    const direction = padDirection.some(Boolean) ? padDirection : this.keyboard.direction();
    return direction.some(Boolean) ? direction : null;
  }

  _restore() {
    const kept = chosenDevice.get(this.session);
    if (kept?.device === "keyboard") this.chosen = "keyboard";
    if (kept?.device === "gamepad" && kept.pad_id) {
      const known = remembered(kept.pad_id);
      if (known) {
        this.chosen = "gamepad";
        this.pads.use(known);
      } else this.chosen = "keyboard";
    }
  }

  _changed() {
    this._announce();
    const direction = this.driving ? this.hands() : null;
    if (sameDirection(direction, this.direction)) return;
    this.direction = direction;
    this._send(null);
  }

  /** @param {GripperPress} press */
  _gripper(press) {
    this.emit("gripper", press);
    if (this.driving) this._send(press);
  }

  /** @param {GripperPress | null} gripper */
  _send(gripper) {
    if (!this.socket.open) return;
    this.seq += 1;
    const message = { seq: this.seq, client_ms: performance.now(), direction: this.direction };
    this.socket.send({ type: "input", ...message, ...(gripper ? { gripper } : {}) });
  }

  _announce() {
    this.emit("hands", { direction: this.hands(), device: this.device, waiting: this.pads.waiting() });
  }

  /**
   * The pad in use comes or goes. A browser hides pads from a new page until they are touched, so that the first coming is
   * no plugging in.
   *
   * @param {{ there: boolean, again: boolean }} plug
   */
  _plugged({ there, again }) {
    if (this.chosen !== "gamepad") return;
    if (!there || again)
      this.socket.note(there ? "pad_plugged" : "pad_unplugged", { pad_id: (this.pads.pad?.padId ?? "").slice(0, 200) });
    this.emit("device", { device: this.device, there, again });
  }

  /** @param {Welcome} welcome */
  _welcome({ last_seq, heartbeat_ms, pace }) {
    this.seq = Math.max(this.seq, last_seq);
    this.direction = null; // a new connection has seen no input: tell it what is held
    this._startBeating(pace === "lockstep" ? 0 : heartbeat_ms);
    this._changed();
    this._beat();
  }

  /** @param {number} everyMs 0 for never */
  _startBeating(everyMs) {
    this._everyMs = everyMs;
    this._timer.start(everyMs);
  }

  /**
   * After a sleep of the computer, or of the page, nobody knows what was let go of meanwhile. It is noticed once, at the
   * first frame or beat: noticed again by the other it would let go of what was pressed between the two.
   */
  _wake() {
    const [nowMs, wallMs] = [performance.now(), Date.now()]; // the first stands still on some computers that sleep
    const sleptMs = Math.max(nowMs - this._awakeMs, wallMs - this._awakeWallMs);
    [this._awakeMs, this._awakeWallMs] = [nowMs, wallMs];
    if (sleptMs < SLEPT_MS) return;
    this.keyboard.release();
    this.pads.release();
  }

  _beat() {
    this._wake();
    if (!this._everyMs) return;
    this.socket.send({
      type: "heartbeat",
      seq: this.seq,
      direction: this.direction,
      visible: !document.hidden,
      focused: document.hasFocus(),
      device: this.device,
    });
  }
}
