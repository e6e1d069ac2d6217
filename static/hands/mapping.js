// What a person's pad does, learned from what they pressed. Pure: snapshots of axes and buttons in, meanings out.
//
// A control is one of
//   {kind: "button", index}
//   {kind: "axis", index, rest, sign, span}   deflection = (value − rest)·sign / span, 1 = as far as it was pushed
//   {kind: "hat", index, value}               a D-pad folded into one axis: each direction is a value of its own
// No button or axis number is known beforehand: the same pad is numbered differently in different browsers.

/** @import { Input } from "../../tests/javascript/wire.d.ts" */
/** @typedef {typeof ACTIONS[number] | typeof OPTIONAL[number]} Action */
/** @typedef {NonNullable<Input["direction"]>} Direction x, y, z in the world frame */
/** @typedef {{ axes: number[], buttons: number[] }} PadState */
/**
 * @typedef {{ kind: "button", index: number }
 *   | { kind: "axis", index: number, rest: number, sign: number, span: number }
 *   | { kind: "hat", index: number, value: number }} Control
 */
/** @typedef {Record<typeof ACTIONS[number], Control> & Partial<Record<typeof OPTIONAL[number], Control>>} Mapping */

export const ACTIONS = /** @type {const} */ (["forward", "back", "left", "right", "up", "down", "close", "open"]);
/** What a pad may do and need not; a new one has a row in LABELS, in WAYS (calibration.js) and a key in keyboard.js. */
export const OPTIONAL = /** @type {const} */ (["view"]);
const ALL = [...ACTIONS, ...OPTIONAL];
/** @type {Record<Action, string>} */
export const LABELS = {
  forward: "forward",
  back: "back",
  left: "left",
  right: "right",
  up: "up",
  down: "down",
  close: "close the gripper",
  open: "open the gripper",
  view: "switch the view",
};
/** @type {Partial<Record<Action, Action>>} */
const OPPOSITE = { forward: "back", left: "right", up: "down", back: "forward", right: "left", down: "up" };
/** @type {Partial<Record<Action, [axis: 0 | 1 | 2, sign: number]>>} */
const AXIS_OF = { forward: [0, 1], back: [0, -1], left: [1, 1], right: [1, -1], up: [2, 1], down: [2, -1] };
const HAT_STEP = 2 / 7; // eight directions on -1…1; beyond that range is "released"
const PUSHED = 0.5;
const RELEASED = 0.25;
export const DEAD_ZONE = { min: 0.1, max: 0.8, default: 0.35 };

/**
 * A plain copy of a Gamepad's state.
 *
 * @param {Gamepad} pad
 * @returns {PadState}
 */
export function snapshot(pad) {
  return { axes: [...pad.axes], buttons: pad.buttons.map((button) => Math.max(button.value, button.pressed ? 1 : 0)) };
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
 * How far a control is pushed, 0…1 (and a little beyond).
 *
 * @param {Control} control
 * @param {PadState} now
 * @returns {number}
 */
export function deflection(control, now) {
  if (control.kind === "button") return now.buttons[control.index] ?? 0;
  const value = now.axes[control.index];
  if (value === undefined || !Number.isFinite(value)) return 0;
  if (control.kind === "hat") {
    if (Math.abs(value) > 1.05) return 0;
    return hatDistance(value, control.value) < HAT_STEP * 1.2 ? 1 : 0;
  }
  return ((value - control.rest) * control.sign) / control.span;
}

/**
 * The actions that are on; what was on stays on until well inside the dead zone, so that a stick at its edge does not flutter.
 *
 * @param {PadState} now
 * @param {Partial<Mapping>} mapping
 * @param {number} deadZone
 * @param {ReadonlySet<Action>} [before]
 * @returns {Set<Action>}
 */
export function active(now, mapping, deadZone, before = new Set()) {
  /** @type {Set<Action>} */
  const on = new Set();
  for (const [action, control] of /** @type {[Action, Control][]} */ (Object.entries(mapping))) {
    const threshold = control.kind === "axis" ? deadZone : PUSHED;
    if (deflection(control, now) > threshold * (before.has(action) ? 0.8 : 1)) on.add(action);
  }
  return on;
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
 * What to print on a key cap for a control.
 *
 * @param {Control} control
 * @returns {string}
 */
export function controlName(control) {
  if (control.kind === "button") return `Button ${control.index}`;
  if (control.kind === "hat") return `D-pad ${control.index}`;
  return `Axis ${control.index} ${control.sign > 0 ? "+" : "−"}`;
}

/**
 * @param {Control} a
 * @param {Control} b
 * @returns {boolean}
 */
function same(a, b) {
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
    (control.kind === "button" ||
      (control.kind === "hat" && Number.isFinite(control.value)) ||
      (control.kind === "axis" && Number.isFinite(control.rest) && Math.abs(control.sign) === 1 && control.span > 0));
  const isWhole = ACTIONS.every((action) => whole(kept[action]));
  const isGood = OPTIONAL.every((action) => kept[action] === undefined || whole(kept[action]));
  return isWhole && isGood ? /** @type {Mapping} */ (kept) : null;
}

/** "Press what the page asks": feed snapshots; `step` is the action asked for, null when all are learned. */
export class Calibration {
  /** @param {PadState} rest how the pad stands when nobody touches it */
  constructor(rest) {
    this.rest = rest;
    /** @type {Partial<Mapping>} */
    this.mapping = {};
    this.message = "";
    /** @type {{ amount: number, control: Control } | null} */
    this._best = null;
    this._mustRelease = false;
    /** @type {Set<Action>} */
    this._skipped = new Set();
  }

  /** @returns {Action | null} */
  get step() {
    return ALL.find((action) => !(action in this.mapping) && !this._skipped.has(action)) ?? null;
  }

  /**
   * Whether the action asked for may be left out.
   *
   * @returns {boolean}
   */
  get isOptional() {
    return OPTIONAL.some((action) => action === this.step);
  }

  /**
   * Leaves out the action asked for, when it is an optional one.
   *
   * @returns {void}
   */
  skip() {
    const action = this.step;
    if (action === null || !this.isOptional) return;
    this._skipped.add(action);
    this.message = "";
    this._mustRelease = this._best !== null;
    this._best = null;
  }

  /** @returns {boolean} */
  get done() {
    return this.step === null;
  }

  /**
   * The whole mapping, once everything is learned.
   *
   * @returns {Mapping | null}
   */
  get learned() {
    return this.done ? /** @type {Mapping} */ (this.mapping) : null;
  }

  /**
   * Takes one snapshot. Returns true when something to show has changed.
   *
   * @param {PadState} now
   * @returns {boolean}
   */
  feed(now) {
    if (this.done) return false;
    const pushed = this._strongest(now);
    if (this._mustRelease) {
      if (pushed) return false;
      this._mustRelease = false;
      return true;
    }
    if (pushed && (!this._best || pushed.amount > this._best.amount)) {
      const first = !this._best;
      this._best = pushed;
      return first;
    }
    if (!pushed && this._best) {
      const { control } = this._best;
      this._best = null;
      this._learn(control);
      return true;
    }
    return false;
  }

  /**
   * Something is pressed and not yet let go.
   *
   * @returns {boolean}
   */
  get holding() {
    return this._best !== null || this._mustRelease;
  }

  /** @param {Control} control */
  _learn(control) {
    const taken = ALL.find((action) => {
      const learned = this.mapping[action];
      return learned !== undefined && same(learned, control);
    });
    if (taken) {
      this.message = `That one already means “${LABELS[taken]}”. Press another one.`;
      return;
    }
    const action = this.step;
    if (action === null) return;
    this.message = "";
    this.mapping[action] = control;
    const other = OPPOSITE[action];
    if (control.kind === "axis" && other && !(other in this.mapping) && Math.abs(control.rest) < 0.5) {
      this.mapping[other] = { ...control, sign: -control.sign }; // the other way on the same stick
    }
  }

  /** @param {PadState} now */
  _strongest(now) {
    const level = this._best || this._mustRelease ? RELEASED : PUSHED;
    /** @type {{ amount: number, control: Control }[]} */
    const offers = [];
    now.axes.forEach((value, index) => {
      const rest = this.rest.axes[index] ?? 0;
      if (!Number.isFinite(value)) return;
      const amount = Math.abs(value - rest);
      if (Math.abs(rest) <= 1.05) {
        const span = Math.max(PUSHED, Math.min(amount, 2));
        offers.push({ amount, control: { kind: "axis", index, rest, sign: Math.sign(value - rest), span } });
      } else if (Math.abs(value) <= 1.05) offers.push({ amount: 1, control: { kind: "hat", index, value } });
    });
    now.buttons.forEach((value, index) => {
      // A little ahead of axes: triggers are often reported as both, and the button is the simpler one.
      const isAtRest = (this.rest.buttons[index] ?? 0) < PUSHED;
      if (isAtRest && value > 0) offers.push({ amount: value + 0.1, control: { kind: "button", index } });
    });
    const strong = offers.filter(({ amount }) => amount > level);
    return strong.length > 0 ? strong.reduce((best, one) => (one.amount > best.amount ? one : best)) : null;
  }
}
