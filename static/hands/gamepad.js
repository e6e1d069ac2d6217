// The gamepad: polled at display rate (a browser has no events for sticks), known by its id, with a learned mapping.

import { Emitter } from "../common/emitter.js";
import { lasting } from "../common/store.js";
import { active, DEAD_ZONE, directionOf, snapshot, validMapping } from "./mapping.js";

/** @import { HandsEvents } from "./keyboard.js" */
/** @import { Action, Direction, Mapping } from "./mapping.js" */

/** @returns {Gamepad[]} */
function connected() {
  const pads = navigator.getGamepads ? [...navigator.getGamepads()] : [];
  return pads.filter((pad) => pad !== null).filter((pad) => pad.connected);
}

/**
 * Mapping and dead zone remembered for a pad id, or null.
 *
 * @param {string} padId
 * @returns {{ mapping: Mapping, dead_zone: number } | null}
 */
export function remembered(padId) {
  const kept = lasting.get(`pad:${padId}`, /** @type {{ mapping?: unknown, dead_zone?: unknown } | null} */ (null));
  const mapping = validMapping(kept?.mapping);
  if (!mapping) return null;
  const zone = Number(kept?.dead_zone);
  const inRange = zone >= DEAD_ZONE.min && zone <= DEAD_ZONE.max;
  return { mapping, dead_zone: inRange ? zone : DEAD_ZONE.default };
}

/**
 * @param {string} padId
 * @param {Mapping} mapping
 * @param {number} deadZone
 * @returns {void}
 */
export function remember(padId, mapping, deadZone) {
  lasting.set(`pad:${padId}`, { mapping, dead_zone: deadZone });
}

/**
 * Emits "hands" on change, "gripper" and "view" once a press, "pads" when pads come or go, and "poll" at display rate.
 *
 * @extends {Emitter<HandsEvents & { pads: null, poll: null }>}
 */
export class Pads extends Emitter {
  constructor() {
    super();
    /** @type {string | null} */
    this.padId = null; // the pad the person drives with
    /** @type {Mapping | null} */
    this.mapping = null;
    this.deadZone = DEAD_ZONE.default;
    this.present = false; // it is plugged in
    /** @type {string[]} */
    this.seen = []; // ids of all pads that are plugged in and were touched
    /** @type {Set<Action>} */
    this._on = new Set();
    addEventListener("gamepadconnected", () => this._poll());
    addEventListener("gamepaddisconnected", () => this._poll());
    addEventListener("blur", () => this._poll());
    document.addEventListener("visibilitychange", () => this._poll());
    const loop = () => {
      this._poll();
      requestAnimationFrame(loop);
    };
    requestAnimationFrame(loop);
  }

  /**
   * Drive with this pad.
   *
   * @param {string | null} padId
   * @param {Mapping | null} mapping
   * @param {number} deadZone
   * @returns {void}
   */
  use(padId, mapping, deadZone) {
    this.padId = padId;
    this.mapping = mapping;
    this.deadZone = deadZone;
    this._on = new Set();
    this._poll();
  }

  /**
   * Drive with no pad.
   *
   * @returns {void}
   */
  stop() {
    this.use(null, null, DEAD_ZONE.default);
  }

  /**
   * The pad with this id, or the first one; null when none is there.
   *
   * @param {string | null} [padId]
   * @returns {Gamepad | null}
   */
  find(padId = null) {
    const pads = connected();
    return pads.find((pad) => pad.id === padId) ?? (padId === null ? (pads[0] ?? null) : null);
  }

  /**
   * The pad on which something is pressed now, to ask "press any button on the one you want".
   *
   * @returns {Gamepad | null}
   */
  touched() {
    return connected().find((pad) => pad.buttons.some((button) => button.pressed || button.value > 0.5)) ?? null;
  }

  /** @returns {Direction} */
  direction() {
    return directionOf(this._on);
  }

  _poll() {
    const pads = connected();
    const ids = pads.map((pad) => pad.id);
    const pad = this.padId === null ? undefined : pads.find((candidate) => candidate.id === this.padId);
    const present = pad !== undefined;
    if (ids.join("\n") !== this.seen.join("\n") || present !== this.present) {
      this.seen = ids;
      this.present = present;
      this.emit("pads");
    }
    this.emit("poll");
    // A page that cannot be seen gets no fresh values: what was held last must not go on driving.
    const mapping = document.hidden ? null : this.mapping;
    const on = pad && mapping ? active(snapshot(pad), mapping, this.deadZone, this._on) : new Set();
    const before = this._on;
    this._on = on;
    for (const gripper of /** @type {const} */ (["close", "open"])) {
      if (on.has(gripper) && !before.has(gripper)) this.emit("gripper", gripper);
    }
    if (on.has("view") && !before.has("view")) this.emit("view");
    if ([...on].sort().join() !== [...before].sort().join()) this.emit("hands");
  }
}
