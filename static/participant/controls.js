// What each control does, in words: for the set-up, the side of the drive page, and Help.

import { h } from "../common/dom.js";
import { t } from "../common/language.js";
import { LEGEND } from "../hands/keyboard.js";
import { nameOf, padPicture } from "./pad_words.js";

/** @import { Input } from "../hands/input.js" */
/** @import { Pad, Pads } from "../hands/gamepad.js" */
/** @import { KeyLabels } from "../hands/layout.js" */
/** @import { Action } from "../hands/mapping.js" */
/** @import { Named } from "./pad_words.js" */

/** @type {[what: string, ...actions: Action[]][]} */
const PAIRS = [
  [t("Forward, back"), "forward", "back"],
  [t("Left, right"), "left", "right"],
  [t("Up, down"), "up", "down"],
  [t("Grip, let go"), "close", "open"],
  [t("Switch the view"), "view"],
];

export const UNKNOWN_KEY = t(
  "This keyboard does not tell which key was pressed, as keyboards on a touch screen do. Use one with real keys, or a gamepad.",
);
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
    h("caption", { class: "visually-hidden" }, t("Keys that drive the robot")),
    h(
      "tbody",
      {},
      LEGEND.map(([what, first, second]) =>
        h(
          "tr",
          {},
          h("th", { scope: "row" }, what),
          h("td", { dir: "ltr" }, first.map(printed)),
          h("td", { dir: "ltr" }, second.map(key)),
        ),
      ),
    ),
  );
}

/**
 * A table of the learned controls of a pad, with a picture where it is known how the pad looks.
 *
 * @param {Pad} pad
 * @returns {HTMLTableElement}
 */
export function padLegend({ mapping, isStandard }) {
  return h(
    "table",
    { class: "legend pad-legend" },
    h("caption", { class: "visually-hidden" }, t("Buttons and sticks that drive the robot")),
    h(
      "tbody",
      {},
      PAIRS.map(([what, ...actions]) => {
        const named = actions.flatMap((action) => {
          const control = mapping[action];
          return control ? [{ action, ...nameOf(action, control, isStandard) }] : [];
        });
        const [first, second] = named;
        const chip = (/** @type {string} */ action, /** @type {Named} */ { words, arrow, place }) =>
          h("kbd", { data: { action } }, place && padPicture(place), `${words} ${arrow}`.trim());
        // Both ways of one stick, or of one cross, in one.
        const isOne = first && second && first.arrow && first.words === second.words;
        const names = isOne
          ? [chip(`${first.action} ${second.action}`, { ...first, arrow: `${first.arrow} ${second.arrow}` })]
          : named.map((one) => chip(one.action, one));
        return names.length > 0 ? h("tr", {}, h("th", { scope: "row" }, what), h("td", {}, names)) : null;
      }),
    ),
  );
}

/**
 * Marks in a pad's legend what is pushed now, so that a person sees which control is meant.
 *
 * @param {HTMLElement} legend
 * @param {Pads} pads
 * @returns {() => void} stops it
 */
export function lightUp(legend, pads) {
  return pads.on("hands", () => {
    for (const chip of legend.querySelectorAll("kbd"))
      chip.classList.toggle(
        "on",
        (chip.dataset.action ?? "").split(" ").some((action) => pads.isOn(/** @type {Action} */ (action))),
      );
  });
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
