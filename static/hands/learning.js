// Learns what a person's pad does by what changes. Pure: snapshots of axes and buttons and the time in, a mapping out.
//
// First everything has to be still, then one control after another is pushed and let go. What a control is compared with
// is where it stood when nobody touched it, not 0: triggers rest at −1, worn sticks beside their middle, a D-pad on one
// axis beyond its range. An axis that was not reported yet reads 0 as well, so an exact 0 is only believed until the
// control has moved. What never changes is never learned; what stands in the way has a name.

import { number, t } from "../common/language.js";
import { ALL, DEAD_ZONE, isHatReleased, LABELS, OPPOSITE, OPTIONAL, same } from "./mapping.js";
import { chosenOf, controlOf, couldBeHat, isHeld, nameOf, PUSHED } from "./tracks.js";

/** @import { Action, Control, Mapping, PadState } from "./mapping.js" */
/** @import { Track } from "./tracks.js" */

const STILL = 0.06;
const SETTLED_MS = 250;
const WOKEN_MS = 500; // what jumped from an unreported 0 to its rest stays there
const ACCEPTED_MS = 4000; // what keeps still that long while everything is to be let go rests there
const RESTLESS_MS = 1500; // what still moves then is named
const NAMED_MS = 2500; // what is held that long is named as what stands in the way

/** "Press what the page asks": feed snapshots; `step` is the action asked for, null while all is to be let go, or is done. */
export class Learning {
  constructor() {
    /** @type {"rest" | "learn"} */
    this.phase = "rest";
    /** @type {Partial<Mapping>} */
    this.mapping = {};
    this.message = "";
    /** @type {string[]} what is held or keeps moving, in words */
    this.blocking = [];
    /** @type {Set<Action>} */
    this._skipped = new Set();
    /** @type {Track[]} */
    this._tracks = [];
    /** @type {Track[]} */
    this._inTheWay = [];
    this._nowMs = 0;
    /** @type {number | null} */
    this._startMs = null;
  }

  /** @returns {Action | null} */
  get _next() {
    return ALL.find((action) => !(action in this.mapping) && !this._skipped.has(action)) ?? null;
  }

  /** @returns {Action | null} */
  get step() {
    return this.phase === "rest" ? null : this._next;
  }

  /**
   * The whole mapping, once everything is learned.
   *
   * @returns {Mapping | null}
   */
  get learned() {
    return this._next === null ? /** @type {Mapping} */ (this.mapping) : null;
  }

  /**
   * As wide as the sticks need, which do not always come back to the same place.
   *
   * @returns {number}
   */
  get deadZone() {
    const needed = Object.values(this.mapping).map((control) => {
      const slack = this._tracks.find(({ kind, index }) => kind === "axis" && index === control.index)?.slack ?? 0;
      return control.kind === "axis" ? (slack / control.span) * 1.25 + 0.05 : 0;
    });
    return Math.min(DEAD_ZONE.max, Math.max(DEAD_ZONE.default, ...needed));
  }

  /**
   * Something is pressed and not yet let go.
   *
   * @returns {boolean}
   */
  get holding() {
    return this._tracks.some(({ push }) => push !== null);
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
  }

  /**
   * Nobody touches what stands in the way: it rests there, or is left out when it never keeps still.
   *
   * @returns {void}
   */
  ignore() {
    for (const track of this._inTheWay) {
      track.isLeftOut = this._moves(track);
      track.rest = track.base = track.value;
      track.isSure = true;
      track.push = null;
    }
    this._inTheWay = [];
    this.blocking = [];
  }

  /**
   * Takes one snapshot. Returns true when something to show has changed.
   *
   * @param {PadState} now
   * @param {number} nowMs
   * @returns {boolean}
   */
  feed(now, nowMs) {
    const before = JSON.stringify([this.phase, this._next, this.holding, this.message, this.blocking]);
    this._nowMs = nowMs;
    this._startMs ??= nowMs;
    this._follow("axis", now.axes);
    this._follow("button", now.buttons);
    if (this.phase === "rest") this._waitForRest();
    else if (this.learned === null) this._learnStep();
    return JSON.stringify([this.phase, this._next, this.holding, this.message, this.blocking]) !== before;
  }

  /**
   * @param {"axis" | "button"} kind
   * @param {number[]} values
   */
  _follow(kind, values) {
    values.forEach((value, index) => {
      if (!Number.isFinite(value)) return;
      let track = this._tracks.find((one) => one.kind === kind && one.index === index);
      if (!track) {
        const fresh = {
          rest: value,
          base: value,
          isSure: false,
          isLeftOut: false,
          hasMoved: false,
          slack: 0,
          push: null,
        };
        track = { kind, index, value, anchor: value, sinceMs: this._nowMs, ...fresh };
        this._tracks.push(track);
      }
      track.value = value;
      if (Math.abs(value - track.anchor) <= STILL) return;
      track.anchor = value;
      track.sinceMs = this._nowMs;
      track.hasMoved = true;
    });
  }

  /** @param {Track} track */
  _stillMs(track) {
    return this._nowMs - track.sinceMs;
  }

  /** @param {Track} track */
  _moves(track) {
    return track.hasMoved && this._stillMs(track) < SETTLED_MS;
  }

  _waitForRest() {
    const inTheWay = this._tracks.filter((track) => {
      if (track.isLeftOut || track.isSure) return false;
      if (this._stillMs(track) < SETTLED_MS) return true;
      const mayRest = track.kind === "button" || track.value < 0.95; // at 1 rests hardly anything: that is asked
      return isHeld(track) && !(mayRest && this._stillMs(track) >= ACCEPTED_MS);
    });
    const isLong = this._nowMs - (this._startMs ?? 0) > RESTLESS_MS; // what was just let go moves as well
    this._block(inTheWay.filter((track) => isHeld(track) || (isLong && this._moves(track))));
    if (inTheWay.length > 0) return;
    for (const track of this._tracks) {
      track.rest = track.base = track.value;
      // −1 may be a stick that is held, and 0 an axis that was not reported yet: believed until it moves.
      track.isSure ||= !isHeld(track) && track.value !== 0 && track.value > -0.95;
    }
    this._block([]);
    this.phase = "learn";
  }

  /** @param {Track[]} tracks */
  _block(tracks) {
    this._inTheWay = tracks;
    this.blocking = tracks.map((track) =>
      this._moves(track)
        ? t("{what} moves", { what: nameOf(track) })
        : t("{what} is held at {value}", { what: nameOf(track), value: number(track.value, 1) }),
    );
  }

  _learnStep() {
    const tracks = this._tracks.filter((track) => !track.isLeftOut);
    for (const track of tracks) this._wake(track);
    for (const track of tracks) this._push(track);
    const pushed = tracks.filter((track) => track.push !== null);
    const back = pushed.filter((track) => this._isBack(track));
    const out = pushed.filter((track) => !back.includes(track));
    // Of two, the one that keeps still while the other was pushed and let go was only reported for the first time.
    const woken = out.filter((track) => back.length > 0 && !track.isSure && this._stillMs(track) >= WOKEN_MS * 2);
    for (const track of woken) this._restHere(track);
    const held = out.filter((track) => !woken.includes(track));
    this._block(held.filter((track) => this._stillMs(track) >= NAMED_MS));
    if (back.length === 0 || held.length > 0) return;
    const chosen = chosenOf(back);
    const isHalfway = !chosen.isSure && Math.abs(chosen.rest) > PUSHED && (chosen.push?.amount ?? 0) < 1.5;
    const control = isHalfway && chosen.kind === "axis" && !isHatReleased(chosen.rest) ? null : controlOf(chosen);
    for (const track of back) {
      if (isHatReleased(track.value)) track.rest = track.value;
      else track.slack = Math.max(track.slack, Math.abs(track.value - track.rest));
      track.base = track.value;
      track.isSure = true;
      track.push = null;
    }
    if (control !== null) this._learn(control);
    else if (isHalfway) this.message = t("Push it all the way, then let go.");
  }

  /**
   * A rest that was only believed turns out to be another.
   *
   * @param {Track} track
   */
  _wake(track) {
    const { kind, value, rest, push } = track;
    if (kind === "button") {
      if (value < rest - 0.1 && this._stillMs(track) >= SETTLED_MS) this._restHere(track);
      return;
    }
    if (track.isSure || isHatReleased(rest)) return;
    const still = this._stillMs(track);
    const isHatNow = rest === 0 && isHatReleased(value);
    // Held while waking, and now let go: a stick falls back to its middle, a trigger to −1.
    const wasHeld = Math.abs(rest) > PUSHED && Math.abs(value) < 0.35 && still >= WOKEN_MS;
    const fellBack = rest > 0.25 && value <= -0.9 && still >= WOKEN_MS;
    // Read 0 until it was pulled for the first time, and now rests at −1.
    const wasPulled = rest === 0 && push !== null && push.high > PUSHED && value <= -0.9 && still >= WOKEN_MS;
    if (isHatNow && push === null) {
      track.push = null;
      this._restHere(track);
    } else if (wasHeld || fellBack) {
      this._restHere(track);
      track.isSure = true;
    } else if (wasPulled && push) {
      track.rest = track.base = value;
      push.peak = push.high;
      push.amount = push.high - value;
    }
  }

  /** @param {Track} track */
  _restHere(track) {
    track.rest = track.base = track.value;
    track.push = null;
  }

  /** @param {Track} track */
  _push(track) {
    const { kind, value, base, rest } = track;
    const isOut = isHatReleased(rest)
      ? !isHatReleased(value)
      : kind === "button"
        ? rest < 0.95 && (value - rest) / (1 - rest) > PUSHED
        : Math.abs(value - base) > PUSHED || (rest === 0 && !track.isSure && couldBeHat(value));
    if (isOut && track.push === null) {
      const dwell = new Map();
      track.push = { startMs: this._nowMs, peak: value, amount: 0, low: value, high: value, dwell };
    }
    const { push } = track;
    if (push === null) return;
    push.low = Math.min(push.low, value);
    push.high = Math.max(push.high, value);
    if (!isHatReleased(value) && (isOut || isHatReleased(rest)))
      push.dwell.set(value, (push.dwell.get(value) ?? 0) + 1);
    const amount = kind === "button" ? value - rest : Math.abs(value - base);
    if (amount <= push.amount || isHatReleased(value)) return;
    push.amount = amount;
    push.peak = value;
  }

  /**
   * Pushed, and let go again. A worn stick comes back somewhere near where it was.
   *
   * @param {Track} track
   */
  _isBack(track) {
    const { kind, value, base, push, rest } = track;
    if (push === null) return false;
    if (isHatReleased(value)) return true;
    if (isHatReleased(rest)) return false;
    if (kind === "button") return (value - rest) / (1 - rest) < 0.25;
    const away = Math.abs(value - base);
    // What read 0 before it was reported may be a trigger on its way from −1: it comes by there, and does not stay.
    if (away < 0.1) return track.isSure || rest !== 0 || this._stillMs(track) >= SETTLED_MS;
    if (push.amount <= PUSHED) return false; // perhaps a D-pad on one axis, which is still pressed
    return away < Math.min(0.45, Math.max(0.25, push.amount / 2)) && this._stillMs(track) >= SETTLED_MS;
  }

  /** @param {Control} control */
  _learn(control) {
    const action = this.step;
    if (action === null) return;
    const taken = this._takenBy(control);
    if (taken) {
      this.message = t("That one already means “{what}”. Press another one.", { what: LABELS[taken] });
      return;
    }
    this.message = "";
    this.mapping[action] = control;
    const other = OPPOSITE[action];
    if (control.kind === "axis" && other && !(other in this.mapping) && Math.abs(control.rest) < 0.5) {
      const otherWay = { ...control, sign: -control.sign }; // on the same stick
      if (!this._takenBy(otherWay)) this.mapping[other] = otherWay;
    }
  }

  /**
   * What a control means already.
   *
   * @param {Control} control
   * @returns {Action | undefined}
   */
  _takenBy(control) {
    return ALL.find((action) => {
      const learned = this.mapping[action];
      return learned !== undefined && same(learned, control);
    });
  }
}
