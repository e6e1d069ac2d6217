// "Press what the page asks": finds the pad that was touched, waits for it to rest, and learns one control after another.

import { h, icon, setText } from "../common/dom.js";
import { ACTIONS, Calibration, DEAD_ZONE, LABELS, snapshot } from "./mapping.js";

const WAYS = {
  forward: "Push forward, away from the robot",
  left: "Push left",
  up: "The control for up",
  back: "Pull back, towards the robot",
  right: "Push right",
  down: "The control for down",
  close: "The button that closes the gripper",
  open: "The button that opens the gripper",
};

/** `onDone({padId, mapping, deadZone})`; `known(padId)` offers what was learned before. */
export function calibrate({ pads, known, onDone }) {
  const title = h("h3", { "aria-live": "assertive", data: { testid: "calibration-prompt" } });
  const hint = h("p", { class: "hint" });
  const warn = h("p", { class: "field-error", role: "alert", hidden: true }, icon("warning"), h("span", {}));
  const list = h(
    "ol",
    { class: "calibration-list" },
    ACTIONS.map((action) =>
      h("li", { data: { action } }, h("span", { class: "mark", "aria-hidden": "true" }), h("span", {}, LABELS[action])),
    ),
  );
  const restart = h(
    "button",
    { type: "button", class: "secondary small", hidden: true, data: { testid: "calibration-restart" } },
    icon("reset"),
    "Start over",
  );
  const element = h(
    "div",
    { class: "calibration", data: { testid: "calibration", step: "wake" } },
    h("div", { class: "calibration-ask" }, icon("gamepad"), h("div", {}, title, hint, warn, restart)),
    list,
  );
  let pad = null; // {id}
  let phase = "wake"; // wake → rest → learn → done
  let learning = null;

  const setPhase = (next) => {
    phase = next;
    draw();
  };

  function draw() {
    const step = phase === "learn" ? learning.step : phase;
    element.dataset.step = step ?? "done";
    restart.hidden = phase !== "learn";
    if (phase === "wake") {
      setText(title, "Press any button on your gamepad");
      setText(
        hint,
        pads.seen.length
          ? "Connected. The page starts with the pad you touch."
          : "Plug it in or switch it on first. Browsers show a pad only after a button was pressed.",
      );
    } else if (phase === "rest") {
      setText(title, "Let go of everything");
      setText(hint, pad.id);
    } else {
      setText(title, learning.holding ? "Good, now let go" : `${WAYS[step]}, then let go`);
      setText(hint, "Use the stick, cross or button you would like to use for it.");
    }
    warn.hidden = !learning?.message;
    setText(warn.lastChild, learning?.message ?? "");
    for (const item of list.children) {
      const { action } = item.dataset;
      const learned = learning !== null && action in learning.mapping;
      item.className = learned ? "learned" : action === step ? "asked" : "";
      item.firstChild.replaceChildren(...(learned ? [icon("check")] : []));
    }
  }

  function poll() {
    if (phase === "wake") {
      const touched = pads.touched();
      if (!touched) return;
      pad = { id: touched.id };
      const before = known(touched.id);
      if (before) {
        close();
        onDone({ padId: pad.id, mapping: before.mapping, deadZone: before.dead_zone });
        return;
      }
      setPhase("rest");
      return;
    }
    const now = pads.find(pad.id);
    if (!now) {
      pad = null;
      learning = null;
      setPhase("wake");
      return;
    }
    const state = snapshot(now);
    if (phase === "rest") {
      if (state.buttons.some((value) => value > 0.25)) return;
      learning = new Calibration(state);
      setPhase("learn");
    } else if (phase === "learn") {
      const changed = learning.feed(state);
      if (learning.done) {
        close();
        onDone({ padId: pad.id, mapping: learning.mapping, deadZone: DEAD_ZONE.default });
      } else if (changed) draw();
    }
  }

  const onPads = () => draw();
  restart.addEventListener("click", () => {
    learning = null;
    setPhase("rest");
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
