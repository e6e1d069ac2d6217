// The gamepad: polled at display rate (a browser has no events for sticks), with a learned mapping. A pad is known by its
// id, which two pads may share: of those the one that is used is read. Whatever may have hidden a release lets go, and a
// control counts again once it was seen at rest.

import { Emitter } from "../common/emitter.js";
import { t } from "../common/language.js";
import { lasting } from "../common/store.js";
import { DEAD_ZONE, directionOf, PadReader, snapshot, validMapping } from "./mapping.js";

/** @import { HandsEvents } from "./keyboard.js" */
/** @import { Action, Direction, Mapping, PadState } from "./mapping.js" */
/** @typedef {"absent" | "refused"} PadProblem the browser has no gamepads for this page, or throws when asked */
/** @typedef {{ padId: string, mapping: Mapping, deadZone: number, isStandard: boolean }} Pad a pad and what was learned of it */

const LETS_GO = ["blur", "pagehide", "freeze", "resume"];

/**
 * Mapping and dead zone remembered for a pad id, or null.
 *
 * @param {string} padId
 * @returns {Pad | null}
 */
export function remembered(padId) {
  const kept = lasting.get(
    `pad:${padId}`,
    /** @type {{ mapping?: unknown, dead_zone?: unknown, standard?: unknown } | null} */ (null),
  );
  const mapping = validMapping(kept?.mapping);
  if (!mapping) return null;
  const zone = Number(kept?.dead_zone);
  const inRange = zone >= DEAD_ZONE.min && zone <= DEAD_ZONE.max;
  return { padId, mapping, deadZone: inRange ? zone : DEAD_ZONE.default, isStandard: kept?.standard === true };
}

/**
 * @param {Pad} pad
 * @returns {void}
 */
export function remember({ padId, mapping, deadZone, isStandard }) {
  lasting.set(`pad:${padId}`, { mapping, dead_zone: deadZone, standard: isStandard });
}

/**
 * Emits "hands" on change, "gripper" and "view" once a press, "pads" when pads come or go, "plug" when the pad in use
 * does, and at display rate "frame" before the pads are read and "poll" after it.
 *
 * @extends {Emitter<HandsEvents & { pads: null, frame: null, poll: null, plug: { there: boolean, again: boolean } }>}
 */
export class Pads extends Emitter {
  constructor() {
    super();
    /** @type {Pad | null} */
    this.pad = null; // the pad the person drives with
    this.present = false; // it is plugged in, and the browser shows it
    /** @type {string[]} */
    this.seen = []; // ids of all pads that are plugged in and were touched
    /** @type {PadProblem | null} */
    this.problem = null;
    /** @type {number | null} */
    this.slot = null; // where the browser lists the pad that is read
    this._wasPresent = false; // at any time since it is in use
    /** @type {Map<number, PadReader>} */
    this._readers = new Map();
    /** @type {Map<number, PadState>} */
    this._earlier = new Map(); // of each pad, to see what changes
    /** @type {Gamepad | null} */
    this._touched = null;
    /** @type {Set<Action>} */
    this._on = new Set();
    this._said = ""; // what listeners were told last
    for (const name of /** @type {const} */ (["gamepadconnected", "gamepaddisconnected"]))
      addEventListener(name, (event) => {
        this._forget(event.gamepad.index); // a new connection has shown nothing yet
        this._poll();
      });
    for (const name of LETS_GO) addEventListener(name, () => this.release());
    document.addEventListener("visibilitychange", () => this.release());
    const loop = () => {
      this._poll();
      requestAnimationFrame(loop);
    };
    requestAnimationFrame(loop);
  }

  /**
   * Drive with this pad, or with none.
   *
   * @param {Pad | null} pad
   * @param {number | null} [slot] where it is listed, when that is known
   * @returns {void}
   */
  use(pad, slot = null) {
    this.pad = pad;
    this.slot = slot;
    this._readers.clear();
    this._on = new Set();
    this.present = pad !== null && this.find(pad.padId) !== null; // known from the beginning: nobody plugged it in now
    this._wasPresent = this.present;
    this._poll();
  }

  /**
   * Lets go of everything; what is held has to come to rest before it counts again.
   *
   * @returns {void}
   */
  release() {
    for (const reader of this._readers.values()) reader.begin();
    this._poll();
  }

  /**
   * The share of its way that a stick has to be pushed.
   *
   * @param {number} deadZone
   * @returns {void}
   */
  setDeadZone(deadZone) {
    if (this.pad) this.pad = { ...this.pad, deadZone };
    for (const reader of this._readers.values()) reader.deadZone = deadZone;
  }

  /**
   * A pad with this id, or, without one, the first; null when none is there.
   *
   * @param {string | null} [padId]
   * @param {number | null} [slot] only the one listed there
   * @returns {Gamepad | null}
   */
  find(padId = null, slot = null) {
    const fits = (/** @type {Gamepad} */ pad) => padId === null || pad.id === padId;
    return this._list().find((pad) => fits(pad) && (slot === null || pad.index === slot)) ?? null;
  }

  /**
   * The pad of which a button was pressed or let go at this poll. One that is pressed all the time is not touched.
   *
   * @returns {Gamepad | null}
   */
  touched() {
    return this._touched;
  }

  /**
   * Pads with a button that is pressed, in words: while it does not change, it is nobody's touch.
   *
   * @returns {string[]}
   */
  stuck() {
    return this._list().flatMap((pad) =>
      snapshot(pad).buttons.flatMap((value, index) =>
        value > 0.5 ? [t("Button {n} of {pad}", { n: index + 1, pad: pad.id })] : [],
      ),
    );
  }

  /**
   * @param {Action} action
   * @returns {boolean}
   */
  isOn(action) {
    return this._on.has(action);
  }

  /** @returns {Direction} */
  direction() {
    return directionOf(this._on);
  }

  /**
   * What is pushed and does not count, since it was not seen at rest yet.
   *
   * @returns {Action[]}
   */
  waiting() {
    const reader = this.slot === null ? undefined : this._readers.get(this.slot);
    return [...(reader?.waiting ?? [])];
  }

  /** @returns {Gamepad[]} */
  _list() {
    if (typeof navigator.getGamepads !== "function") {
      this.problem = "absent";
      return [];
    }
    try {
      const pads = [...navigator.getGamepads()].filter((pad) => pad !== null).filter((pad) => pad.connected);
      this.problem = null;
      return pads;
    } catch {
      this.problem = "refused";
      return [];
    }
  }

  /** @param {number} slot */
  _forget(slot) {
    this._readers.delete(slot);
    this._earlier.delete(slot);
  }

  _poll() {
    this.emit("frame");
    const problem = this.problem;
    const pads = this._list();
    this._watch(pads);
    const present = this.pad !== null && pads.some(({ id }) => id === this.pad?.padId);
    const ids = pads.map((pad) => pad.id);
    if (ids.join("\n") !== this.seen.join("\n") || present !== this.present || problem !== this.problem) {
      const wasPresent = this.present;
      this.seen = ids;
      this.present = present;
      if (present !== wasPresent) this.emit("plug", { there: present, again: this._wasPresent });
      this._wasPresent ||= present;
      this.emit("pads");
    }
    this.emit("poll");
    // A page that cannot be seen gets no fresh values: what was held last must not go on driving.
    this._act(document.hidden ? new Set() : this._read(pads));
  }

  /**
   * What changed since the last poll, on which pad.
   *
   * @param {Gamepad[]} pads
   */
  _watch(pads) {
    this._touched = null;
    for (const slot of this._earlier.keys()) if (!pads.some(({ index }) => index === slot)) this._forget(slot);
    for (const pad of pads) {
      const now = snapshot(pad);
      const before = this._earlier.get(pad.index);
      if (before?.buttons.some((value, index) => Math.abs((now.buttons[index] ?? 0) - value) > 0.5)) {
        this._touched = pad;
        this._earlier.set(pad.index, now);
      } else if (!before) this._earlier.set(pad.index, now);
    }
  }

  /**
   * What is on, on the pad in use. Of two with one id another takes over when it is used and this one is not.
   *
   * @param {Gamepad[]} pads
   * @returns {Set<Action>}
   */
  _read(pads) {
    const { pad } = this;
    if (pad === null) return new Set();
    const mine = pads.filter(({ id }) => id === pad.padId);
    for (const one of mine) {
      let reader = this._readers.get(one.index);
      if (!reader) {
        reader = new PadReader(pad.mapping, pad.deadZone);
        this._readers.set(one.index, reader);
      }
      reader.read(snapshot(one));
    }
    const isOn = (/** @type {Gamepad} */ { index }) => (this._readers.get(index)?.on.size ?? 0) > 0;
    const current = mine.find(({ index }) => index === this.slot) ?? mine[0];
    const used = current && isOn(current) ? current : (mine.find(isOn) ?? current);
    this.slot = used?.index ?? null;
    return (used && this._readers.get(used.index)?.on) ?? new Set();
  }

  /** @param {Set<Action>} on */
  _act(on) {
    const before = this._on;
    this._on = on;
    for (const gripper of /** @type {const} */ (["close", "open"])) {
      if (on.has(gripper) && !before.has(gripper)) this.emit("gripper", gripper);
    }
    if (on.has("view") && !before.has("view")) this.emit("view");
    const said = this._said;
    this._said = `${[...on].sort()}/${this.waiting().sort()}`;
    if (this._said !== said) this.emit("hands");
  }
}
