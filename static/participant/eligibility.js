// The check of the device before consent: looks at what the study asks for, lets the lab judge, says what would help.
// The lab measures the connection by pings of its own; the page only shows how far that is.

import { freshId, h, icon, setText, whileBusy } from "../common/dom.js";
import { ask, card } from "../common/shell.js";

const LABELS = {
  browser: "Browser",
  touch: "Keyboard or mouse",
  window: "Size of this page",
  webgl: "3-D graphics",
  round_trip: "Connection to the robot",
  gamepad: "Gamepad",
  sound: "Sound",
};
const CHOICES = [1, 2, 3, 4, 5, 6];

/** Whether anything 3-D can be drawn; software drawing counts. */
function drawsIn3D() {
  try {
    const canvas = document.createElement("canvas");
    return Boolean(canvas.getContext("webgl2") ?? canvas.getContext("webgl"));
  } catch {
    return false;
  }
}

/** A finger is all there is: no mouse, no pen, no trackpad. */
function touchOnly() {
  return (
    navigator.maxTouchPoints > 0 &&
    !matchMedia("(any-pointer: fine)").matches &&
    !matchMedia("(any-hover: hover)").matches
  );
}

/** One line of the list: what is checked, how it stands, and what the person can do about it. */
function row(check) {
  const sign = h("span", { class: "check-sign", "aria-hidden": "true" });
  const state = h("span", { class: "check-state" });
  const problem = h("p", { class: "check-problem", hidden: true });
  const body = h("div", { class: "check-body" });
  const element = h(
    "li",
    { class: "check", data: { testid: `check-${check}`, state: "open" } },
    sign,
    h("div", {}, h("p", {}, h("strong", {}, LABELS[check]), " ", state), problem, body),
  );
  const mark = (name, text = "") => {
    element.dataset.state = name;
    sign.replaceChildren(icon({ open: "clock", good: "check", bad: "warning" }[name]));
    problem.hidden = text === "";
    setText(problem, text);
  };
  mark("open");
  return { element, body, mark, say: (text) => setText(state, text) };
}

export function eligibilityView({ socket, pads, sound }, page) {
  const { checks, gamepad, tones } = page.content;
  const asks = (check) => checks.includes(check);
  const rows = new Map(checks.map((check) => [check, row(check)]));
  const listeners = [];
  const listen = (target, name, handler) => {
    target.addEventListener(name, handler);
    listeners.push(() => target.removeEventListener(name, handler));
  };

  // Connection: the lab says in each ping how many follow.
  let measured = !asks("round_trip");
  let whenMeasured = () => {};
  function unmeasured() {
    if (!asks("round_trip")) return;
    measured = false;
    rows.get("round_trip").say("is being measured");
  }
  unmeasured();
  listen(socket, "welcome", unmeasured);
  listen(socket, "ping", ({ detail }) => {
    if (!asks("round_trip") || detail.left === null || detail.left === undefined) return;
    measured = detail.left === 0;
    rows.get("round_trip").say(measured ? "is measured" : `is being measured, ${detail.left} to go`);
    if (measured) whenMeasured();
  });

  // Size of the page: live, so that enlarging the window is seen to help.
  if (asks("window")) {
    const size = () => rows.get("window").say(`${innerWidth} × ${innerHeight}`);
    size();
    listen(window, "resize", size);
  }

  // Gamepad: browsers show one only after a button was pressed.
  let padId = null;
  if (asks("gamepad")) {
    const line = rows.get("gamepad");
    const words = () =>
      line.say(
        padId
          ? `is connected: ${padId}`
          : gamepad === "required"
            ? "– connect one and press any of its buttons"
            : "– recommended: connect one and press any of its buttons, or go on with the keyboard",
      );
    words();
    listen(pads, "poll", () => {
      const touched = pads.touched();
      if (touched && touched.id !== padId) padId = touched.id;
      else if (padId && !pads.find(padId)) padId = null;
      else return;
      line.mark(padId ? "good" : "open");
      words();
    });
  }

  // Sound: whoever hears nothing cannot count.
  let attempt = 0;
  let heard = null;
  if (asks("sound")) {
    const line = rows.get("sound");
    line.say("– play some tones and say how many there were");
    const play = h(
      "button",
      { type: "button", class: "secondary small", data: { testid: "tones-play" } },
      icon("sound"),
      "Play the tones",
    );
    const name = freshId("tones");
    const choices = CHOICES.map((count) => {
      const radio = h("input", { type: "radio", name, value: String(count) });
      radio.addEventListener("change", () => {
        heard = count;
        line.mark("open");
      });
      return h("label", { class: "option" }, radio, String(count));
    });
    play.addEventListener("click", async () => {
      if (!(await sound.tones(tones[attempt % tones.length])))
        line.mark("open", "This browser did not let the sound through. Press the button once more.");
    });
    line.body.append(
      h(
        "div",
        { class: "tones" },
        play,
        h(
          "fieldset",
          { class: "options" },
          h("legend", { class: "visually-hidden" }, "How many tones did you hear?"),
          choices,
        ),
      ),
    );
    line.another = () => {
      attempt += 1;
      heard = null;
      for (const choice of choices) choice.querySelector("input").checked = false;
    };
  }

  function report() {
    const device = {};
    if (asks("browser")) device.user_agent = navigator.userAgent.slice(0, 500);
    if (asks("touch")) device.has_touch_only = touchOnly();
    if (asks("window")) Object.assign(device, { width_px: innerWidth, height_px: innerHeight });
    if (asks("webgl")) device.has_webgl = drawsIn3D();
    if (asks("gamepad"))
      Object.assign(device, { is_secure: window.isSecureContext, pad_id: padId?.slice(0, 200) ?? null });
    if (asks("sound")) Object.assign(device, { tones: heard, tone_try: attempt });
    return device;
  }

  const summary = h(
    "p",
    { class: "error-summary", role: "alert", hidden: true, data: { testid: "check-summary" } },
    icon("warning"),
    h("span", {}, "Something is missing. What may help stands beside it; then check again."),
  );
  const go = h(
    "button",
    { type: "button", class: "primary large", data: { testid: "check-submit" } },
    "Check and continue",
  );
  const leave = h(
    "button",
    { type: "button", class: "secondary large", hidden: true, data: { testid: "check-leave" } },
    "I cannot change this",
  );
  go.addEventListener("click", () =>
    whileBusy(go, "Checking", async () => {
      if (!measured) await new Promise((resolve) => (whenMeasured = resolve));
      summary.hidden = true;
      await socket.submit("eligibility", report()).catch(() => {});
    }),
  );
  leave.addEventListener("click", async () => {
    const answer = await ask({
      title: "Leave the study?",
      text: [
        "If nothing can be done about what is missing, the study ends here for you. You cannot take it up again with this link.",
      ],
      confirm: "Leave the study",
      danger: true,
      testid: "leave-dialog",
    });
    if (answer !== null) whileBusy(leave, "Leaving", () => socket.submit("leave").catch(() => {}));
  });
  let refusedId = null;
  listen(socket, "refused", (event) => {
    const { field, message, id } = event.detail;
    if (!rows.has(field)) return;
    event.preventDefault(); // shown here, so no toast
    if (id !== refusedId) {
      refusedId = id;
      for (const line of rows.values()) line.mark("good");
      unmeasured(); // the lab measures once more
    }
    rows.get(field).mark("bad", message);
    rows.get(field).another?.();
    summary.hidden = leave.hidden = false;
  });

  const element = card({
    title: "Does your device fit?",
    testid: "page-eligibility",
    lines: ["Before you begin, this page looks at what the study needs. What it finds is kept, and nothing about you."],
    body: [
      summary,
      h(
        "ul",
        { class: "checks" },
        [...rows.values()].map((line) => line.element),
      ),
      h("div", { class: "actions" }, go, leave),
    ],
  });
  // With nothing for the person to do, it checks by itself.
  if (!asks("gamepad") && !asks("sound")) queueMicrotask(() => go.click());
  return { element, close: () => listeners.forEach((stop) => stop()) };
}
