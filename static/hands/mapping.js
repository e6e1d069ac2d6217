// What a person's pad does, learned from what they pressed. Pure: snapshots of axes and buttons in, meanings out.
//
// A control is one of
//   {kind: "button", index, rest, span}       deflection = (value − rest) / span, 1 = as far as it was pushed
//   {kind: "axis", index, rest, sign, span}   deflection = (value − rest)·sign / span
//   {kind: "hat", index, value}               a D-pad folded into one axis: each direction is a value of its own
// No button or axis number is known beforehand: the same pad is numbered differently in different browsers.

import { t, tc } from "../common/language.js";

/** @import { Input } from "../../tests/javascript/wire.d.ts" */
/** @typedef {typeof ACTIONS[number] | typeof OPTIONAL[number]} Action */
/** @typedef {NonNullable<Input["direction"]>} Direction x, y, z in the world frame */
/** @typedef {{ axes: number[], buttons: number[] }} PadState */
/**
 * @typedef {{ kind: "button", index: number, rest?: number, span?: number }
 *   | { kind: "axis", index: number, rest: number, sign: number, span: number }
 *   | { kind: "hat", index: number, value: number }} Control
 */
/** @typedef {Record<typeof ACTIONS[number], Control> & Partial<Record<typeof OPTIONAL[number], Control>>} Mapping */

export const ACTIONS = /** @type {const} */ (["forward", "back", "left", "right", "up", "down", "close", "open"]);
/** What a pad may do and need not; a new one has a row in LABELS, in WAYS (calibration.js) and a key in keyboard.js. */
export const OPTIONAL = /** @type {const} */ (["view"]);
export const ALL = [...ACTIONS, ...OPTIONAL];
/** @type {Record<Action, string>} */
export const LABELS = {
  forward: tc("direction", "forward"),
  back: tc("direction", "back"),
  left: tc("direction", "left"),
  right: tc("direction", "right"),
  up: tc("direction", "up"),
  down: tc("direction", "down"),
  close: t("close the gripper"),
  open: t("open the gripper"),
  view: t("switch the view"),
};
/** @type {Partial<Record<Action, Action>>} */
export const OPPOSITE = { forward: "back", left: "right", up: "down", back: "forward", right: "left", down: "up" };
/** @type {Partial<Record<Action, [axis: 0 | 1 | 2, sign: number]>>} */
const AXIS_OF = { forward: [0, 1], back: [0, -1], left: [1, 1], right: [1, -1], up: [2, 1], down: [2, -1] };
const HAT_STEP = 2 / 7; // eight directions on -1…1; beyond that range is "released"
const HAT_RANGE = 1.05;
const PUSHED = 0.5;
const STAYS = 0.8; // of a threshold: what was on stays on down to there, and rest is below
export const DEAD_ZONE = { min: 0.1, max: 0.8, default: 0.35 };

/**
 * A plain copy of a Gamepad's state. A button that has no value of its own is 0 or 1.
 *
 * @param {Gamepad} pad
 * @returns {PadState}
 */
export function snapshot(pad) {
  return {
    axes: [...pad.axes],
    buttons: pad.buttons.map(({ value, pressed }) => (value > 0 ? value : Number(pressed))),
  };
}

/**
 * Whether this is how a D-pad on one axis says that nothing is pressed: beyond the values of its directions.
 *
 * @param {number} value
 * @returns {boolean}
 */
export function isHatReleased(value) {
  return Math.abs(value) > HAT_RANGE;
}

/**
 * @param {number} a
 * @param {number} b
 * @returns {number}
 */
function hatDistance(a, b) {
  const period = HAT_STEP * 8;
  const apart = Math.abs(a - b) % period;
  return Math.min(apart, period - apart);
}

/**
 * How far a control is pushed, 0…1 (and a little beyond); 0 for what the pad does not have.
 *
 * @param {Control} control
 * @param {PadState} now
 * @returns {number}
 */
export function deflection(control, now) {
  const value = (control.kind === "button" ? now.buttons : now.axes)[control.index];
  if (value === undefined || !Number.isFinite(value)) return 0;
  if (control.kind === "hat") {
    if (isHatReleased(value)) return 0;
    return hatDistance(value, control.value) < HAT_STEP * 1.2 ? 1 : 0;
  }
  if (control.kind === "axis") return ((value - control.rest) * control.sign) / control.span;
  const { rest = 0, span = 1 - rest } = control;
  return (value - rest) / span;
}

/**
 * Whether a control stands as it was learned to stand when nobody touches it. An axis that was not reported yet reads 0,
 * which is no rest for a trigger that rests at −1, nor for a D-pad on one axis.
 *
 * @param {Control} control
 * @param {PadState} now
 * @param {number} deadZone
 * @returns {boolean}
 */
export function isAtRest(control, now, deadZone) {
  const value = (control.kind === "button" ? now.buttons : now.axes)[control.index];
  if (value === undefined || !Number.isFinite(value)) return false;
  if (control.kind === "hat") return isHatReleased(value);
  return Math.abs(deflection(control, now)) <= threshold(control, deadZone) * STAYS;
}

/**
 * @param {Control} control
 * @param {number} deadZone
 * @returns {number}
 */
function threshold(control, deadZone) {
  return control.kind === "axis" ? deadZone : PUSHED;
}

/**
 * Reads one pad while it stays connected. A control counts only after it was seen at rest; what is on stays on until well
 * inside the dead zone, so that a stick at its edge does not flutter.
 */
export class PadReader {
  /**
   * @param {Partial<Mapping>} mapping
   * @param {number} deadZone
   */
  constructor(mapping, deadZone) {
    this.mapping = mapping;
    this.deadZone = deadZone;
    /** @type {Set<Action>} */
    this.on = new Set();
    /** @type {Set<Action>} pushed, and not seen at rest before */
    this.waiting = new Set();
    /** @type {Set<Action>} */
    this._rested = new Set();
  }

  /**
   * Lets go of everything: each control has to be seen at rest anew.
   *
   * @returns {void}
   */
  begin() {
    this.on = new Set();
    this.waiting = new Set();
    this._rested.clear();
  }

  /**
   * The actions that are on.
   *
   * @param {PadState} now
   * @returns {Set<Action>}
   */
  read(now) {
    const before = this.on;
    this.on = new Set();
    this.waiting = new Set();
    for (const [action, control] of /** @type {[Action, Control][]} */ (Object.entries(this.mapping))) {
      if (isAtRest(control, now, this.deadZone)) this._rested.add(action);
      const least = threshold(control, this.deadZone) * (before.has(action) ? STAYS : 1);
      if (deflection(control, now) > least) (this._rested.has(action) ? this.on : this.waiting).add(action);
    }
    return this.on;
  }
}

/**
 * [x, y, z] of a set of actions; opposites cancel.
 *
 * @param {Iterable<Action>} actions
 * @returns {Direction}
 */
export function directionOf(actions) {
  /** @type {[number, number, number]} */
  const direction = [0, 0, 0];
  for (const action of actions) {
    const pair = AXIS_OF[action];
    if (pair) direction[pair[0]] += pair[1];
  }
  return /** @type {Direction} */ (direction);
}

/**
 * @param {Control} a
 * @param {Control} b
 * @returns {boolean}
 */
export function same(a, b) {
  if (a.index !== b.index) return false;
  if (a.kind === "axis") return b.kind === "axis" && a.sign === b.sign;
  if (a.kind === "hat") return b.kind === "hat" && hatDistance(a.value, b.value) < HAT_STEP / 2;
  return b.kind === "button";
}

/**
 * A mapping read from storage, or null when it is not one.
 *
 * @param {unknown} mapping
 * @returns {Mapping | null}
 */
export function validMapping(mapping) {
  if (typeof mapping !== "object" || mapping === null) return null;
  const kept = /** @type {Partial<Mapping>} */ (mapping);
  const whole = /** @param {Control | undefined} control */ (control) =>
    control &&
    Number.isInteger(control.index) &&
    control.index >= 0 &&
    ((control.kind === "button" && (control.rest ?? 0) < 1 && (control.span ?? 1) > 0) ||
      (control.kind === "hat" && Number.isFinite(control.value)) ||
      (control.kind === "axis" && Number.isFinite(control.rest) && Math.abs(control.sign) === 1 && control.span > 0));
  const isWhole = ACTIONS.every((action) => whole(kept[action]));
  const isGood = OPTIONAL.every((action) => kept[action] === undefined || whole(kept[action]));
  return isWhole && isGood ? /** @type {Mapping} */ (kept) : null;
}
