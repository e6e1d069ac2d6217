// One axis or button while its pad is learned: what was seen of it, and what that makes of it. Pure.

import { t } from "../common/language.js";
import { isHatReleased } from "./mapping.js";

/** @import { Control } from "./mapping.js" */
/**
 * One axis or button, as it was seen so far.
 *
 * @typedef {object} Track
 * @property {"axis" | "button"} kind
 * @property {number} index
 * @property {number} value now
 * @property {number} rest as learned: where it stands untouched
 * @property {number} base where it came to rest last: pushes are measured from there
 * @property {boolean} isSure the rest is known, and not only believed
 * @property {boolean} isLeftOut it never keeps still
 * @property {number} anchor it has been near this value
 * @property {number} sinceMs since then
 * @property {boolean} hasMoved since it was seen first
 * @property {number} slack how far from its rest it came to rest
 * @property {Push | null} push
 */
/** @typedef {{ startMs: number, peak: number, amount: number, low: number, high: number, dwell: Map<number, number> }} Push */

export const PUSHED = 0.5;

/**
 * What to call a control that stands in the way, counted as pads that print numbers count theirs.
 *
 * @param {Track} track
 * @returns {string}
 */
export function nameOf({ kind, index }) {
  return kind === "button" ? t("Button {n}", { n: index + 1 }) : t("Axis {n}", { n: index + 1 });
}

/**
 * Whether it stands as nothing stands untouched. −1 is where triggers rest.
 *
 * @param {Track} track
 * @returns {boolean}
 */
export function isHeld({ kind, value }) {
  if (kind === "button") return value > 0.25;
  return !isHatReleased(value) && (value > 0.3 || (value < -0.3 && value > -0.95));
}

/**
 * Whether an axis that read 0 until now has a value of a D-pad on one axis: those are sevenths.
 *
 * @param {number} value
 * @returns {boolean}
 */
export function couldBeHat(value) {
  const sevenths = value * 7;
  return Math.abs(value) > 0.1 && Math.abs(sevenths - Math.round(sevenths)) < 0.02 && Math.round(sevenths) % 2 !== 0;
}

/**
 * Of all that was pushed and let go, what was meant: a button that did not come later than an axis (triggers are often
 * reported as both; a stick's own button comes later), else what was pushed furthest.
 *
 * @param {Track[]} tracks at least one
 * @returns {Track}
 */
export function chosenOf(tracks) {
  const startMs = (/** @type {Track} */ { push }) => push?.startMs ?? 0;
  const axes = tracks.filter(({ kind }) => kind === "axis");
  const firstMs = Math.min(...axes.map(startMs));
  const buttons = tracks.filter((track) => track.kind === "button" && startMs(track) <= firstMs);
  const among = buttons.length > 0 ? buttons : axes.length > 0 ? axes : tracks;
  return among.reduce((best, one) => ((one.push?.amount ?? 0) > (best.push?.amount ?? 0) ? one : best));
}

/**
 * @param {Track} track that was pushed
 * @returns {Control | null} null for what was hardly touched
 */
export function controlOf({ kind, index, value, rest, push }) {
  if (push === null) return null;
  if (kind === "button") {
    return rest === 0 && push.peak === 1
      ? { kind, index }
      : { kind, index, rest, span: Math.max(0.05, push.peak - rest) };
  }
  if (isHatReleased(rest) || isHatReleased(value)) {
    const [longest] = [...push.dwell].sort(([, a], [, b]) => b - a);
    return longest ? { kind: "hat", index, value: longest[0] } : null;
  }
  if (push.amount <= PUSHED) return null;
  return { kind, index, rest, sign: Math.sign(push.peak - rest), span: Math.max(PUSHED, Math.abs(push.peak - rest)) };
}
