// The check of the device before consent: looks at what the study asks for, lets the lab judge, says what would help.
// The lab measures the connection by pings of its own; the page only shows how far that is.

import { freshId, h, icon, setText, whileBusy } from "../../common/dom.js";
import { number, t } from "../../common/language.js";
import { ask, card } from "../../common/shell.js";
import { canDraw } from "../webgl.js";

/** @import { Refusal } from "../../wire/socket.js" */
/** @import { Context, PageOf, View } from "../view.js" */
/** @typedef {keyof typeof LABELS} Check */
/** @typedef {keyof typeof MARKS} Mark */
/** @typedef {{ checks: Check[], gamepad: "any" | "preferred" | "required", tones: number[] }} Content */

const LABELS = {
  browser: t("Browser"),
  touch: t("Keyboard or mouse"),
  window: t("Size of this page"),
  webgl: t("3-D graphics"),
  round_trip: t("Connection to the robot"),
  gamepad: t("Gamepad"),
  sound: t("Sound"),
};
const MARKS = /** @type {const} */ ({ open: "clock", good: "check", bad: "warning" });
const CHOICES = [1, 2, 3, 4, 5, 6];

/** A finger is all there is: no mouse, no pen, no trackpad. */
function touchOnly() {
  return (
    navigator.maxTouchPoints > 0 &&
    !matchMedia("(any-pointer: fine)").matches &&
    !matchMedia("(any-hover: hover)").matches
  );
}

/**
 * One line of the list: what is checked, how it stands, and what the person can do about it.
 *
 * @param {Check} check
 */
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
  const mark = (/** @type {Mark} */ name, text = "") => {
    element.dataset.state = name;
    sign.replaceChildren(icon(MARKS[name]));
    problem.hidden = text === "";
    setText(problem, text);
  };
  mark("open");
  return { element, body, mark, say: (/** @type {string} */ text) => setText(state, text) };
}

/**
 * @param {Context} context
 * @param {PageOf<Content>} page
 * @returns {View}
 */
export function view({ socket, pads, sound }, page) {
  const { checks, gamepad, tones } = page.content;
  const rows = new Map(checks.map((check) => [check, row(check)]));
  const [round_trip, size, pad, tone] = /** @type {Check[]} */ (["round_trip", "window", "gamepad", "sound"]).map(
    (check) => rows.get(check),
  );
  /** @type {(() => void)[]} */
  const closers = [];

  // Connection: the lab says in each ping how many follow.
  let measured = !round_trip;
  let whenMeasured = () => {};
  function unmeasured() {
    if (!round_trip) return;
    measured = false;
    round_trip.say(t("is being measured"));
  }
  unmeasured();
  closers.push(
    socket.on("welcome", unmeasured),
    socket.on("ping", ({ detail: { left = null } }) => {
      if (!round_trip || left === null) return;
      measured = left === 0;
      round_trip.say(measured ? t("is measured") : t("is being measured, {n} to go", { n: left }));
      if (measured) whenMeasured();
    }),
  );

  // Size of the page: live, so that enlarging the window is seen to help.
  if (size) {
    const measure = () => size.say(`${number(innerWidth)} × ${number(innerHeight)}`);
    measure();
    addEventListener("resize", measure);
    closers.push(() => removeEventListener("resize", measure));
  }

  // Gamepad: browsers show one only after a button was pressed.
  /** @type {string | null} */
  let padId = null;
  if (pad) {
    const words = () =>
      pad.say(
        padId
          ? t("is connected: {pad}", { pad: padId })
          : gamepad === "required"
            ? t("– connect one and press any of its buttons")
            : t("– recommended: connect one and press any of its buttons, or go on with the keyboard"),
      );
    words();
    const forbidden = () => {
      if (pads.problem) pad.mark("bad", t("This browser shows no gamepads to this page. Another browser may."));
    };
    forbidden();
    closers.push(pads.on("pads", forbidden));
    const look = () => {
      const touched = pads.touched();
      if (touched && touched.id !== padId) padId = touched.id;
      else if (padId && !pads.find(padId)) padId = null;
      else return;
      pad.mark(padId ? "good" : "open");
      words();
    };
    closers.push(pads.on("poll", look));
  }

  // Sound: whoever hears nothing cannot count.
  let attempt = 0;
  /** @type {number | null} */
  let heard = null;
  let askAgain = () => {};
  if (tone) {
    tone.say(t("– play some tones and say how many there were"));
    const play = h(
      "button",
      { type: "button", class: "secondary small", data: { testid: "tones-play" } },
      icon("sound"),
      t("Play the tones"),
    );
    const name = freshId("tones");
    const choices = CHOICES.map((count) => {
      const radio = h("input", { type: "radio", name, value: String(count) });
      radio.addEventListener("change", () => {
        heard = count;
        tone.mark("open");
      });
      return radio;
    });
    play.addEventListener("click", async () => {
      if (!(await sound.tones(tones[attempt % tones.length] ?? 1)))
        tone.mark("open", t("This browser did not let the sound through. Press the button once more."));
    });
    tone.body.append(
      h(
        "div",
        { class: "tones" },
        play,
        h(
          "fieldset",
          { class: "options" },
          h("legend", { class: "visually-hidden" }, t("How many tones did you hear?")),
          choices.map((radio) => h("label", { class: "option" }, radio, number(Number(radio.value)))),
        ),
      ),
    );
    askAgain = () => {
      attempt += 1;
      heard = null;
      for (const radio of choices) radio.checked = false;
    };
  }

  function report() {
    return {
      ...(rows.has("browser") && { user_agent: navigator.userAgent.slice(0, 500) }),
      ...(rows.has("touch") && { has_touch_only: touchOnly() }),
      ...(rows.has("window") && { width_px: innerWidth, height_px: innerHeight }),
      ...(rows.has("webgl") && { has_webgl: canDraw() }),
      ...(rows.has("gamepad") && { is_secure: window.isSecureContext, pad_id: padId?.slice(0, 200) ?? null }),
      ...(rows.has("sound") && { tones: heard, tone_try: attempt }),
    };
  }

  const summary = h(
    "p",
    { class: "error-summary", role: "alert", hidden: true, data: { testid: "check-summary" } },
    icon("warning"),
    h("span", {}, t("Something is missing. What may help stands beside it; then check again.")),
  );
  const go = h(
    "button",
    { type: "button", class: "primary large", data: { testid: "check-submit" } },
    t("Check and continue"),
  );
  const leave = h(
    "button",
    { type: "button", class: "secondary large", hidden: true, data: { testid: "check-leave" } },
    t("I cannot change this"),
  );
  go.addEventListener("click", () =>
    whileBusy(go, t("Checking"), async () => {
      if (!measured) {
        await new Promise((resolve) => {
          whenMeasured = () => resolve(null);
        });
      }
      summary.hidden = true;
      await socket.submit("eligibility", report()).catch(() => {});
    }),
  );
  leave.addEventListener("click", async () => {
    const answer = await ask({
      title: t("Leave the study?"),
      text: [
        t(
          "If nothing can be done about what is missing, the study ends here for you. You cannot take it up again with this link.",
        ),
      ],
      confirm: t("Leave the study"),
      danger: true,
      testid: "leave-dialog",
    });
    if (answer !== null) whileBusy(leave, t("Leaving"), () => socket.submit("leave").catch(() => {}));
  });
  /** @type {string | null} */
  let refusedId = null;
  const refused = (/** @type {CustomEvent<Refusal>} */ event) => {
    const { field, message, id } = event.detail;
    const line = rows.get(/** @type {Check} */ (field));
    if (!line) return;
    event.preventDefault(); // shown here, so no toast
    if (id !== refusedId) {
      refusedId = id;
      for (const one of rows.values()) one.mark("good");
      unmeasured(); // the lab measures once more
    }
    line.mark("bad", message);
    if (line === tone) askAgain();
    summary.hidden = false;
    leave.hidden = false;
  };
  closers.push(socket.on("refused", refused));

  const element = card({
    title: t("Does your device fit?"),
    testid: "page-eligibility",
    lines: [
      t("Before you begin, this page looks at what the study needs. What it finds is kept, and nothing about you."),
    ],
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
  if (!pad && !tone) queueMicrotask(() => go.click());
  const close = () => {
    for (const stop of closers) stop();
  };
  return { element, close };
}
