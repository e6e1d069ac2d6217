// "Press what the page asks": finds the pad that was touched, waits for it to rest, and learns one control after another.

import { h, icon, setText } from "../common/dom.js";
import { ACTIONS, Calibration, DEAD_ZONE, LABELS, OPTIONAL, snapshot } from "./mapping.js";

/** @import { Pads, remembered } from "./gamepad.js" */
/** @import { Pad } from "./input.js" */
/** @import { Action, Mapping } from "./mapping.js" */

/** @type {Record<Action, string>} */
const WAYS = {
  forward: "Push forward, away from the robot",
  left: "Push left",
  up: "The control for up",
  back: "Pull back, towards the robot",
  right: "Push right",
  down: "The control for down",
  close: "The button that closes the gripper",
  open: "The button that opens the gripper",
  view: "A button that switches the view",
};

/**
 * Asks for one control after another; `known` offers what was learned of a pad before.
 *
 * @param {{ pads: Pads, known: typeof remembered, onDone: (pad: Pad) => void }} wiring
 * @returns {{ element: HTMLElement, close: () => void }}
 */
export function calibrate({ pads, known, onDone }) {
  const title = h("h3", { "aria-live": "assertive", data: { testid: "calibration-prompt" } });
  const hint = h("p", { class: "hint" });
  const warnText = h("span", {});
  const warn = h("p", { class: "field-error", role: "alert", hidden: true }, icon("warning"), warnText);
  const items = [...ACTIONS, ...OPTIONAL].map((action) => {
    const mark = h("span", { class: "mark", "aria-hidden": "true" });
    return { action, mark, element: h("li", { data: { action } }, mark, h("span", {}, LABELS[action])) };
  });
  const list = h(
    "ol",
    { class: "calibration-list" },
    items.map((item) => item.element),
  );
  const restart = h(
    "button",
    { type: "button", class: "secondary small", hidden: true, data: { testid: "calibration-restart" } },
    icon("reset"),
    "Start over",
  );
  const skip = h(
    "button",
    { type: "button", class: "secondary small", hidden: true, data: { testid: "calibration-skip" } },
    "Go on without it",
  );
  const element = h(
    "div",
    { class: "calibration", data: { testid: "calibration", step: "wake" } },
    h(
      "div",
      { class: "calibration-ask" },
      icon("gamepad"),
      h("div", {}, title, hint, warn, h("div", { class: "actions" }, skip, restart)),
    ),
    list,
  );
  // Waiting for a touch: no pad. Waiting for it to rest: a pad. Learning: both.
  /** @type {string | null} */
  let padId = null;
  /** @type {Calibration | null} */
  let learning = null;

  function draw() {
    const asked = learning?.step ?? null;
    element.dataset.step = padId === null ? "wake" : learning === null ? "rest" : (asked ?? "done");
    restart.hidden = learning === null;
    skip.hidden = !learning?.isOptional;
    if (padId === null) {
      setText(title, "Press any button on your gamepad");
      setText(
        hint,
        pads.seen.length
          ? "Connected. The page starts with the pad you touch."
          : "Plug it in or switch it on first. Browsers show a pad only after a button was pressed.",
      );
    } else if (learning === null) {
      setText(title, "Let go of everything");
      setText(hint, padId);
    } else {
      setText(title, learning.holding || asked === null ? "Good, now let go" : `${WAYS[asked]}, then let go`);
      setText(
        hint,
        learning.isOptional
          ? "If you like: you can also switch it with the keyboard or the mouse."
          : "Use the stick, cross or button you would like to use for it.",
      );
    }
    warn.hidden = !learning?.message;
    setText(warnText, learning?.message ?? "");
    for (const item of items) {
      const learned = learning !== null && item.action in learning.mapping;
      item.element.className = learned ? "learned" : item.action === asked ? "asked" : "";
      item.mark.replaceChildren(...(learned ? [icon("check")] : []));
    }
  }

  function poll() {
    if (padId === null) {
      const touched = pads.touched();
      if (!touched) return;
      padId = touched.id;
      const before = known(padId);
      if (before) {
        close();
        onDone({ padId, mapping: before.mapping, deadZone: before.dead_zone });
      } else draw();
      return;
    }
    const now = pads.find(padId);
    if (!now) {
      padId = null;
      learning = null;
      draw();
      return;
    }
    const state = snapshot(now);
    if (learning === null) {
      if (state.buttons.some((value) => value > 0.25)) return;
      learning = new Calibration(state);
      draw();
      return;
    }
    const changed = learning.feed(state);
    if (learning.learned) finish(learning.learned);
    else if (changed) draw();
  }

  /** @param {Mapping} mapping */
  function finish(mapping) {
    if (padId === null) return;
    close();
    onDone({ padId, mapping, deadZone: DEAD_ZONE.default });
  }

  const onPads = () => draw();
  restart.addEventListener("click", () => {
    learning = null;
    draw();
  });
  skip.addEventListener("click", () => {
    learning?.skip();
    if (learning?.learned) finish(learning.learned);
    else draw();
  });
  pads.addEventListener("poll", poll);
  pads.addEventListener("pads", onPads);
  function close() {
    pads.removeEventListener("poll", poll);
    pads.removeEventListener("pads", onPads);
  }
  draw();
  return { element, close };
}
