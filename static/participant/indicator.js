// A small picture of the hands: which directions are on, which device they come from.

import { h, icon, s, setText } from "../common/dom.js";

const ARROWS = [
  ["forward", 0, 1, "M40 6 52 22H28z", "↑"],
  ["back", 0, -1, "M40 74 28 58h24z", "↓"],
  ["left", 1, 1, "M6 40 22 28v24z", "←"],
  ["right", 1, -1, "M74 40 58 52V28z", "→"],
  ["up", 2, 1, "M104 8 118 28H90z", ""],
  ["down", 2, -1, "M104 72 90 52h28z", ""],
];
const DEVICE = {
  gamepad: ["gamepad", "Gamepad"],
  keyboard: ["keyboard", "Keyboard"],
  none: ["keyboard", "Keyboard"], // it drives unless something else was chosen
};

/** Follows `input`; `element` shows the arrows, their words are for everybody. */
export function indicator(input) {
  const arrows = new Map();
  const drawn = ARROWS.map(([name, axis, sign, d]) => {
    const path = s("path", { d, class: "arrow-key", data: {} });
    arrows.set(name, { path, axis, sign });
    return path;
  });
  const words = h("span", { class: "hands-words", data: { testid: "hands" } }, "hands off");
  const device = h("span", { class: "hands-device", data: { testid: "device" } });
  const text = (x, y, label) => s("text", { x, y, "text-anchor": "middle", class: "arrow-label" }, label);
  const element = h(
    "div",
    { class: "hands" },
    s(
      "svg",
      { class: "hands-picture", viewBox: "0 0 124 80", "aria-hidden": "true", focusable: "false" },
      s("rect", { x: 27, y: 27, width: 26, height: 26, rx: 6, class: "hands-hub" }),
      drawn,
      text(104, 38, "up"),
      text(104, 49, "down"),
    ),
    h("div", { class: "hands-text" }, device, words),
  );
  const show = ({ direction, device: name }) => {
    const on = [];
    for (const [label, { path, axis, sign }] of arrows) {
      const lit = direction !== null && direction[axis] === sign;
      path.classList.toggle("on", lit);
      if (lit) on.push(label);
    }
    setText(words, on.length ? on.join(" + ") : "hands off");
    if (device.dataset.name !== name) {
      device.dataset.name = name;
      device.replaceChildren(icon(DEVICE[name][0]), h("span", {}, DEVICE[name][1]));
    }
  };
  const listen = (event) => show(event.detail);
  input.addEventListener("hands", listen);
  show({ direction: input.hands(), device: input.device });
  return { element, close: () => input.removeEventListener("hands", listen) };
}
