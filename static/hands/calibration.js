// "Press what the page asks": finds the pad that was touched, waits for it to rest, and learns one control after another.
// Whatever stands in the way is named, and there is always a way back.

import { h, icon, setText } from "../common/dom.js";
import { t } from "../common/language.js";
import { Learning } from "./learning.js";
import { ACTIONS, LABELS, OPTIONAL, snapshot } from "./mapping.js";

/** @import { Pad, PadProblem, Pads } from "./gamepad.js" */
/** @import { Action } from "./mapping.js" */

/** @type {Record<Action, string>} */
const WAYS = {
  forward: t("Push forward, away from the robot"),
  left: t("Push left"),
  up: t("The control for up"),
  back: t("Pull back, towards the robot"),
  right: t("Push right"),
  down: t("The control for down"),
  close: t("The button that closes the gripper"),
  open: t("The button that opens the gripper"),
  view: t("A button that switches the view"),
};
/** @type {Record<PadProblem, string>} */
const PROBLEMS = {
  absent: t(
    "This browser gives this page no gamepads: it is too old, or the page was not opened over https. Chrome, Edge and Firefox can do it.",
  ),
  refused: t("This browser refuses to show gamepads to this page. A setting or an extension forbids it."),
};

/**
 * Asks for one control after another.
 *
 * @param {object} wiring
 * @param {Pads} wiring.pads
 * @param {(padId: string) => Pad | null} wiring.known what was learned of a pad before
 * @param {(pad: Pad, slot: number) => void} wiring.onDone
 * @param {(() => void) | null} wiring.useKeyboard null where the study needs a gamepad
 * @returns {{ element: HTMLElement, close: () => void }}
 */
export function calibrate({ pads, known, onDone, useKeyboard }) {
  const title = h("h3", { "aria-live": "assertive", data: { testid: "calibration-prompt" } });
  const hint = h("p", { class: "hint" });
  const warnText = h("span", {});
  const warn = h("p", { class: "field-error", role: "alert", hidden: true }, icon("warning"), warnText);
  const blockText = h("span", { data: { testid: "calibration-blocking" } });
  const ignore = button("calibration-ignore", t("Ignore"));
  const block = h("div", { class: "calibration-block", role: "status", hidden: true }, blockText, ignore);
  const items = [...ACTIONS, ...OPTIONAL].map((action) => {
    const mark = h("span", { class: "mark", "aria-hidden": "true" });
    return { action, mark, element: h("li", { data: { action } }, mark, h("span", {}, LABELS[action])) };
  });
  const list = h(
    "ol",
    { class: "calibration-list" },
    items.map((item) => item.element),
  );
  const restart = button("calibration-restart", t("Start over"));
  restart.prepend(icon("reset"));
  const skip = button("calibration-skip", t("Go on without it"));
  const keyboard = button("calibration-keyboard", t("Use the keyboard instead"));
  const element = h(
    "div",
    { class: "calibration", data: { testid: "calibration", step: "wake" } },
    h(
      "div",
      { class: "calibration-ask" },
      icon("gamepad"),
      h("div", {}, title, hint, warn, block, h("div", { class: "actions" }, skip, restart, keyboard)),
    ),
    list,
  );
  // Waiting for a touch: no pad. Learning, which begins with waiting for rest: a pad.
  /** @type {{ padId: string, slot: number, isStandard: boolean } | null} */
  let pad = null;
  let learning = new Learning();
  let isAnew = false; // what was learned before was not wanted

  function draw() {
    const asked = learning.step;
    element.dataset.step = pad === null ? "wake" : (asked ?? (learning.learned ? "done" : "rest"));
    keyboard.hidden = useKeyboard === null || (pads.problem === null && pad !== null);
    skip.hidden = !learning.isOptional;
    restart.hidden = pads.problem !== null;
    if (pads.problem !== null) {
      setText(title, t("No gamepad can be used here"));
      setText(
        hint,
        `${PROBLEMS[pads.problem]} ${useKeyboard ? t("The keyboard does the same.") : t("This study needs a gamepad: please tell whoever gave you the link.")}`,
      );
    } else if (pad === null) {
      setText(title, t("Press any button on your gamepad"));
      setText(
        hint,
        pads.seen.length
          ? t("Connected. The page starts with the pad you touch.")
          : t("Plug it in or switch it on first. Browsers show a pad only after a button was pressed."),
      );
    } else if (learning.phase === "rest") {
      setText(title, t("Let go of everything"));
      setText(hint, pad.padId);
    } else {
      setText(
        title,
        learning.holding || asked === null ? t("Good, now let go") : t("{what}, then let go", { what: WAYS[asked] }),
      );
      setText(
        hint,
        learning.isOptional
          ? t("If you like: you can also switch it with the keyboard or the mouse.")
          : t("Use the stick, cross or button you would like to use for it."),
      );
    }
    warn.hidden = !learning.message;
    setText(warnText, learning.message);
    drawBlocking();
    for (const item of items) {
      const learned = item.action in learning.mapping;
      item.element.className = learned ? "learned" : item.action === asked ? "asked" : "";
      item.mark.replaceChildren(...(learned ? [icon("check")] : []));
    }
  }

  function drawBlocking() {
    const stuck = pad === null ? pads.stuck() : [];
    const held = pad === null ? stuck : learning.blocking;
    block.hidden = held.length === 0;
    ignore.hidden = pad === null;
    const what = `${held.slice(0, 3).join(", ")}${held.length > 3 ? ", …" : ""}`;
    const words = pad
      ? t("{what}: let go, or press Ignore if nobody touches it.", { what })
      : t("{what} is held down: let go. What stays pressed is left alone.", { what });
    setText(blockText, held.length > 0 ? words : "");
  }

  function poll() {
    if (pad === null) {
      const touched = pads.touched();
      drawBlocking();
      if (!touched) return;
      pad = { padId: touched.id, slot: touched.index, isStandard: touched.mapping === "standard" };
      learning = new Learning();
      const before = isAnew ? null : known(pad.padId);
      if (before) finish(before);
      else draw();
      return;
    }
    const now = pads.find(pad.padId, pad.slot);
    if (!now) return startOver();
    const changed = learning.feed(snapshot(now), performance.now());
    if (!finishLearned() && changed) draw();
  }

  /** @returns {boolean} */
  function finishLearned() {
    const mapping = learning.learned;
    if (pad === null || mapping === null) return false;
    finish({ padId: pad.padId, mapping, deadZone: learning.deadZone, isStandard: pad.isStandard });
    return true;
  }

  /** @param {Pad} learned */
  function finish(learned) {
    if (pad === null) return;
    close();
    onDone(learned, pad.slot);
  }

  function startOver() {
    pad = null;
    learning = new Learning();
    draw();
  }

  restart.addEventListener("click", () => {
    isAnew = true;
    startOver();
  });
  skip.addEventListener("click", () => {
    learning.skip();
    if (!finishLearned()) draw();
  });
  ignore.addEventListener("click", () => {
    learning.ignore();
    draw();
  });
  keyboard.addEventListener("click", () => useKeyboard?.());
  pads.addEventListener("poll", poll);
  pads.addEventListener("pads", draw);
  function close() {
    pads.removeEventListener("poll", poll);
    pads.removeEventListener("pads", draw);
  }
  draw();
  return { element, close };
}

/**
 * @param {string} testid
 * @param {string} label
 * @returns {HTMLButtonElement}
 */
function button(testid, label) {
  return h("button", { type: "button", class: "secondary small", data: { testid } }, label);
}
