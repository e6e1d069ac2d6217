// What the controls of a pad are called, and where they are. A pad that the browser knows ("standard") has a picture with
// the control in it; of any other only its kind is known, and which way the person pushed it.

import { s } from "../common/dom.js";
import { t } from "../common/language.js";

/** @import { Action, Control } from "../hands/mapping.js" */
/** @typedef {{ words: string, arrow: string, place: [x: number, y: number, r: number] | null }} Named place: in the picture */

const ARROWS = /** @type {Partial<Record<Action, string>>} */ ({
  forward: "↑",
  back: "↓",
  left: "←",
  right: "→",
  up: "↑",
  down: "↓",
});
/** @type {[words: string, x: number, y: number, arrow?: string][]} of a standard pad, as the Gamepad specification numbers them */
const BUTTONS = [
  [t("bottom button"), 46, 23],
  [t("right button"), 51, 18],
  [t("left button"), 41, 18],
  [t("top button"), 46, 13],
  [t("left shoulder"), 14, 7],
  [t("right shoulder"), 46, 7],
  [t("left trigger"), 14, 3],
  [t("right trigger"), 46, 3],
  [t("middle left"), 25, 14],
  [t("middle right"), 35, 14],
  [t("left stick, pressed"), 22, 26],
  [t("right stick, pressed"), 38, 26],
  [t("cross"), 14, 13, "↑"],
  [t("cross"), 14, 23, "↓"],
  [t("cross"), 9, 18, "←"],
  [t("cross"), 19, 18, "→"],
  [t("centre button"), 30, 20],
];
/** @type {[words: string, x: number, y: number][]} */
const STICKS = [
  [t("left stick"), 22, 26],
  [t("right stick"), 38, 26],
];
const OUTLINE =
  "M14 9h32c6 0 8 4 10 12 2 9 1 15-4 15-4 0-6-4-9-7-2-1-24-1-26 0-3 3-5 7-9 7-5 0-6-6-4-15 2-8 4-12 10-12z";

/**
 * @param {Action} action
 * @param {Control} control
 * @param {boolean} isStandard
 * @returns {Named}
 */
export function nameOf(action, control, isStandard) {
  const arrow = ARROWS[action] ?? "";
  if (control.kind === "hat") return { words: t("cross"), arrow, place: null };
  if (control.kind === "button") {
    const known = isStandard ? BUTTONS[control.index] : undefined;
    if (known) return { words: known[0], arrow: known[3] ?? "", place: [known[1], known[2], 2.6] };
    return { words: t("button {n}", { n: control.index + 1 }), arrow: "", place: null }; // as pads that print numbers count them
  }
  if (Math.abs(control.rest) >= 0.5) return { words: t("trigger"), arrow: "", place: null };
  const known = isStandard ? STICKS[control.index >> 1] : undefined;
  if (known) return { words: known[0], arrow: way(control.index, control.sign), place: [known[1], known[2], 4] };
  return { words: control.index < 2 ? t("stick") : t("other stick"), arrow, place: null };
}

/**
 * On a standard pad even axes count to the right, odd ones down.
 *
 * @param {number} index
 * @param {number} sign
 * @returns {string}
 */
function way(index, sign) {
  if (index % 2 === 0) return sign > 0 ? "→" : "←";
  return sign > 0 ? "↓" : "↑";
}

/**
 * A pad with one control marked; the words beside it say the same.
 *
 * @param {[x: number, y: number, r: number]} place
 * @returns {SVGSVGElement}
 */
export function padPicture([cx, cy, r]) {
  return s(
    "svg",
    { class: "pad-picture", viewBox: "0 0 60 38", "aria-hidden": "true", focusable: "false" },
    s("path", { d: OUTLINE, class: "pad-outline" }),
    STICKS.map(([, x, y]) => s("circle", { cx: x, cy: y, r: 3.2, class: "pad-outline" })),
    BUTTONS.slice(0, 4).map(([, x, y]) => s("circle", { cx: x, cy: y, r: 1.7, class: "pad-outline" })),
    s("path", { d: "M14 13v10M9 18h10", class: "pad-outline" }),
    s("circle", { cx, cy, r, class: "pad-mark" }),
  );
}
