// A small picture of the hands: which directions are on, which device they come from.

import { h, icon, s, setText } from "../common/dom.js";
import { t } from "../common/language.js";
import { LABELS } from "../hands/mapping.js";

/** @import { IconName } from "../common/dom.js" */
/** @import { Device, Hands, Input } from "../hands/input.js" */
/** @import { Action } from "../hands/mapping.js" */

/** @type {[name: Action, axis: number, sign: number, outline: string][]} */
const ARROWS = [
  ["forward", 0, 1, "M40 6 52 22H28z"],
  ["back", 0, -1, "M40 74 28 58h24z"],
  ["left", 1, 1, "M6 40 22 28v24z"],
  ["right", 1, -1, "M74 40 58 52V28z"],
  ["up", 2, 1, "M104 8 118 28H90z"],
  ["down", 2, -1, "M104 72 90 52h28z"],
];
/** @type {Record<Device, [sign: IconName, label: string]>} */
const DEVICE = {
  gamepad: ["gamepad", t("Gamepad")],
  keyboard: ["keyboard", t("Keyboard")],
  none: ["keyboard", t("Keyboard")], // it drives unless something else was chosen
};

/**
 * Follows `input`; `element` shows the arrows, and `words`, inside it, says the same in words.
 *
 * @param {Input} input
 * @returns {{ element: HTMLElement, words: HTMLElement, close: () => void }}
 */
export function indicator(input) {
  const arrows = ARROWS.map(([name, axis, sign, d]) => ({
    name,
    axis,
    sign,
    path: s("path", { d, class: "arrow-key" }),
  }));
  const held = h("span", { class: "hands-words", data: { testid: "hands" } }, t("hands off"));
  const device = h("span", { class: "hands-device", data: { testid: "device" } });
  const words = h("div", { class: "hands-text" }, device, held);
  const text = (/** @type {number} */ x, /** @type {number} */ y, /** @type {string} */ label) =>
    s("text", { x, y, "text-anchor": "middle", class: "arrow-label" }, label);
  const element = h(
    "div",
    { class: "hands" },
    s(
      "svg",
      { class: "hands-picture", viewBox: "0 0 124 80", "aria-hidden": "true", focusable: "false" },
      s("rect", { x: 27, y: 27, width: 26, height: 26, rx: 6, class: "hands-hub" }),
      arrows.map((arrow) => arrow.path),
      text(104, 38, LABELS.up),
      text(104, 49, LABELS.down),
    ),
    words,
  );
  const show = (/** @type {Hands} */ { direction, device: name, waiting }) => {
    const on = [];
    for (const arrow of arrows) {
      const lit = direction !== null && direction[arrow.axis] === arrow.sign;
      arrow.path.classList.toggle("on", lit);
      if (lit) on.push(LABELS[arrow.name]);
    }
    const once = waiting.map((action) => LABELS[action]).join(", ");
    setText(held, on.length ? on.join(" + ") : once ? t("let go of it once: {what}", { what: once }) : t("hands off"));
    if (device.dataset.name !== name) {
      device.dataset.name = name;
      device.replaceChildren(icon(DEVICE[name][0]), h("span", {}, DEVICE[name][1]));
    }
  };
  const close = input.on("hands", (event) => show(event.detail));
  show({ direction: input.hands(), device: input.device, waiting: [] });
  return { element, words, close };
}
