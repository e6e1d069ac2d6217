// What a person's pad does, learned from what they pressed. Pure: snapshots of axes and buttons in, meanings out.
//
// A control is one of
//   {kind: "button", index}
//   {kind: "axis", index, rest, sign, span}   deflection = (value − rest)·sign / span, 1 = as far as it was pushed
//   {kind: "hat", index, value}               a D-pad folded into one axis: each direction is a value of its own
// No button or axis number is known beforehand: the same pad is numbered differently in different browsers.

export const ACTIONS = ["forward", "back", "left", "right", "up", "down", "close", "open"];
export const LABELS = {
  forward: "forward",
  back: "back",
  left: "left",
  right: "right",
  up: "up",
  down: "down",
  close: "close the gripper",
  open: "open the gripper",
};
const OPPOSITE = { forward: "back", left: "right", up: "down", back: "forward", right: "left", down: "up" };
const AXIS_OF = { forward: [0, 1], back: [0, -1], left: [1, 1], right: [1, -1], up: [2, 1], down: [2, -1] };
const HAT_STEP = 2 / 7; // eight directions on -1…1; beyond that range is "released"
const PUSHED = 0.5;
const RELEASED = 0.25;
export const DEAD_ZONE = { min: 0.1, max: 0.8, default: 0.35 };

/** A plain copy of a Gamepad's state. */
export function snapshot(pad) {
  return { axes: [...pad.axes], buttons: pad.buttons.map((button) => Math.max(button.value, button.pressed ? 1 : 0)) };
}

function hatDistance(a, b) {
  const period = HAT_STEP * 8;
  const apart = Math.abs(a - b) % period;
  return Math.min(apart, period - apart);
}

/** How far a control is pushed, 0…1 (and a little beyond). */
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

/** The actions that are on; what was on stays on until well inside the dead zone, so that a stick at its edge does not flutter. */
export function active(now, mapping, deadZone, before = new Set()) {
  const on = new Set();
  for (const [action, control] of Object.entries(mapping)) {
    const threshold = control.kind === "axis" ? deadZone : PUSHED;
    if (deflection(control, now) > threshold * (before.has(action) ? 0.8 : 1)) on.add(action);
  }
  return on;
}

/** [x, y, z] of a set of actions; opposites cancel. */
export function directionOf(actions) {
  const direction = [0, 0, 0];
  for (const action of actions) {
    const pair = AXIS_OF[action];
    if (pair) direction[pair[0]] += pair[1];
  }
  return direction;
}

/** What to print on a key cap for a control. */
export function controlName(control) {
  if (control.kind === "button") return `Button ${control.index}`;
  if (control.kind === "hat") return `D-pad ${control.index}`;
  return `Axis ${control.index} ${control.sign > 0 ? "+" : "−"}`;
}

function same(a, b) {
  if (a.kind !== b.kind || a.index !== b.index) return false;
  if (a.kind === "button") return true;
  return a.kind === "hat" ? hatDistance(a.value, b.value) < HAT_STEP / 2 : a.sign === b.sign;
}

/** A mapping read from storage, or null when it is not one. */
export function validMapping(mapping) {
  if (typeof mapping !== "object" || mapping === null) return null;
  const whole = (control) =>
    control &&
    Number.isInteger(control.index) &&
    control.index >= 0 &&
    (control.kind === "button" ||
      (control.kind === "hat" && Number.isFinite(control.value)) ||
      (control.kind === "axis" && Number.isFinite(control.rest) && Math.abs(control.sign) === 1 && control.span > 0));
  return ACTIONS.every((action) => whole(mapping[action])) ? mapping : null;
}

/** "Press what the page asks": feed snapshots; `step` is the action asked for, null when all are learned. */
export class Calibration {
  constructor(rest) {
    this.rest = rest;
    this.mapping = {};
    this.inferred = new Set();
    this.message = "";
    this._best = null;
    this._mustRelease = false;
  }

  get step() {
    return ACTIONS.find((action) => !(action in this.mapping)) ?? null;
  }

  get done() {
    return this.step === null;
  }

  /** Takes one snapshot. Returns true when something to show has changed. */
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
      const control = this._control(this._best);
      this._best = null;
      this._learn(control);
      return true;
    }
    return false;
  }

  /** Something is pressed and not yet let go. */
  get holding() {
    return this._best !== null || this._mustRelease;
  }

  _learn(control) {
    const taken = Object.keys(this.mapping).find((action) => same(this.mapping[action], control));
    if (taken) {
      this.message = `That one already means “${LABELS[taken]}”. Press another one.`;
      return;
    }
    const action = this.step;
    this.message = "";
    this.mapping[action] = control;
    const other = OPPOSITE[action];
    if (control.kind === "axis" && other && !(other in this.mapping) && Math.abs(control.rest) < 0.5) {
      this.mapping[other] = { ...control, sign: -control.sign }; // the other way on the same stick
      this.inferred.add(other);
    }
  }

  _strongest(now) {
    const level = this._best || this._mustRelease ? RELEASED : PUSHED;
    let best = null;
    const offer = (amount, what) => {
      if (amount > level && (!best || amount > best.amount)) best = { amount, ...what };
    };
    now.axes.forEach((value, index) => {
      const rest = this.rest.axes[index] ?? 0;
      if (!Number.isFinite(value)) return;
      if (Math.abs(rest) > 1.05) {
        if (Math.abs(value) <= 1.05) offer(1, { kind: "hat", index, value });
      } else offer(Math.abs(value - rest), { kind: "axis", index, rest, sign: Math.sign(value - rest) });
    });
    now.buttons.forEach((value, index) => {
      // A little ahead of axes: triggers are often reported as both, and the button is the simpler one.
      if ((this.rest.buttons[index] ?? 0) < PUSHED) offer(value > 0 ? value + 0.1 : 0, { kind: "button", index });
    });
    return best;
  }

  _control({ amount, ...control }) {
    return control.kind === "axis" ? { ...control, span: Math.max(PUSHED, Math.min(amount, 2)) } : control;
  }
}
