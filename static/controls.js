// What each control does, in words: for the set-up, the side of the drive page, and Help.

import { h } from "./dom.js";
import { LEGEND } from "./keyboard.js";
import { ACTIONS, controlName, LABELS } from "./mapping.js";

const key = (text) => h("kbd", {}, text);

/** A table of keys; both columns do the same. */
export function keyboardLegend() {
  return h(
    "table",
    { class: "legend" },
    h("caption", { class: "visually-hidden" }, "Keys that drive the robot"),
    h("tbody", {}, LEGEND.map(([what, first, second]) => h("tr", {}, h("th", { scope: "row" }, what), h("td", {}, first.map(key)), h("td", {}, second.map(key))))),
  );
}

/** A table of the learned controls of a pad. */
export function padLegend(mapping) {
  return h(
    "table",
    { class: "legend" },
    h("caption", { class: "visually-hidden" }, "Buttons and sticks that drive the robot"),
    h("tbody", {}, ACTIONS.map((action) => h("tr", {}, h("th", { scope: "row" }, LABELS[action][0].toUpperCase() + LABELS[action].slice(1)), h("td", {}, key(controlName(mapping[action])))))),
  );
}

/** The legend of the device in use. */
export function legendFor(input) {
  return input.device === "gamepad" && input.pads.mapping ? padLegend(input.pads.mapping) : keyboardLegend();
}
