// What each control does, in words: for the set-up, the side of the drive page, and Help.

import { h } from "../common/dom.js";
import { LEGEND } from "../hands/keyboard.js";
import { controlName } from "../hands/mapping.js";

/** @import { Input } from "../hands/input.js" */
/** @import { Pad } from "../hands/gamepad.js" */
/** @import { KeyLabels } from "../hands/layout.js" */
/** @import { Action } from "../hands/mapping.js" */

/** @type {[what: string, ...actions: Action[]][]} */
const PAIRS = [
  ["Forward, back", "forward", "back"],
  ["Left, right", "left", "right"],
  ["Up, down", "up", "down"],
  ["Grip, let go", "close", "open"],
  ["Switch the view", "view"],
];

export const UNKNOWN_KEY =
  "This keyboard does not tell which key was pressed, as keyboards on a touch screen do. Use one with real keys, or a gamepad.";
const key = (/** @type {string} */ text) => h("kbd", {}, text);

/**
 * A table of keys, as they are printed on this person's keyboard; both columns do the same.
 *
 * @param {KeyLabels} labels
 * @returns {HTMLTableElement}
 */
export function keyboardLegend(labels) {
  const printed = (/** @type {string} */ name) => key(labels.of(name));
  return h(
    "table",
    { class: "legend" },
    h("caption", { class: "visually-hidden" }, "Keys that drive the robot"),
    h(
      "tbody",
      {},
      LEGEND.map(([what, first, second]) =>
        h("tr", {}, h("th", { scope: "row" }, what), h("td", {}, first.map(printed)), h("td", {}, second.map(key))),
      ),
    ),
  );
}

/**
 * A table of the learned controls of a pad.
 *
 * @param {Pad} pad
 * @returns {HTMLTableElement}
 */
export function padLegend({ mapping }) {
  return h(
    "table",
    { class: "legend" },
    h("caption", { class: "visually-hidden" }, "Buttons and sticks that drive the robot"),
    h(
      "tbody",
      {},
      PAIRS.map(([what, ...actions]) => {
        const controls = actions.map((action) => mapping[action]).filter((control) => control !== undefined);
        const names = controls.map((control) => key(controlName(control)));
        return names.length > 0 ? h("tr", {}, h("th", { scope: "row" }, what), h("td", {}, names)) : null;
      }),
    ),
  );
}

/**
 * The legend of the device in use.
 *
 * @param {Input} input
 * @returns {HTMLTableElement}
 */
export function legendFor(input) {
  return input.device === "gamepad" && input.pads.pad
    ? padLegend(input.pads.pad)
    : keyboardLegend(input.keyboard.labels);
}
