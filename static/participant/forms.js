// The pages made of text and questions: consent, demographics, instructions, break, debrief, end.

import { freshId, h, icon, setText, whileBusy } from "../common/dom.js";
import { safeLink } from "../common/links.js";
import { ask, card, stepButton } from "../common/shell.js";
import { tab } from "../common/store.js";
import { checkAll, question, showRefusals, valuesOf } from "./questions.js";

/** @import { IconName } from "../common/dom.js" */
/** @import { Submit } from "../../tests/javascript/wire.d.ts" */
/** @import { LabSocket } from "../wire/socket.js" */
/** @import { Answer, Asked, Question } from "./questions.js" */
/** @import { Context, PageOf, View } from "./view.js" */

/** @type {(lines: string[]) => HTMLElement[]} */
const paragraphs = (lines) => lines.map((line) => h("p", {}, line));

/**
 * A form whose answers survive a reload. Refusals for single questions are shown beside them.
 *
 * @param {object} form
 * @param {LabSocket} form.socket
 * @param {Question[]} form.questions
 * @param {string} form.submitText
 * @param {Submit["step"]} form.step
 * @param {string} form.key what the answers are kept under
 * @param {string} form.testid
 * @returns {{ form: HTMLFormElement, close: () => void }}
 */
function questionForm({ socket, questions, submitText, step, key, testid }) {
  const button = h("button", { type: "submit", class: "primary large", data: { testid } }, submitText);
  const form = h(
    "form",
    { novalidate: true, class: "questions" },
    questions.map((one) => one.element),
    h("div", { class: "actions" }, button),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    for (const one of questions) one.clear();
    if (!checkAll(questions)) return;
    whileBusy(button, "Saving", async () => {
      try {
        await socket.submit(step, { answers: valuesOf(questions) });
        tab.remove(key);
      } catch {
        // said beside the question or in a message
      }
    });
  });
  return { form, close: showRefusals(socket, questions) };
}

/**
 * @param {Asked[]} items
 * @param {string} key what the answers are kept under
 * @returns {Question[]}
 */
function keptQuestions(items, key) {
  const kept = tab.get(key, /** @type {Record<string, Answer>} */ ({}));
  const onChange = (/** @type {string} */ id, /** @type {Answer} */ value) => {
    kept[id] = value;
    tab.set(key, kept);
  };
  return items.map((item) => question(item, { kept: kept[item.id] ?? null, onChange }));
}

/**
 * @param {Context} context
 * @param {PageOf<{ title: string, text: string[], contact: string, hash: string }>} page
 * @returns {View}
 */
export function consentView({ socket }, page) {
  const { title, text, contact, hash } = page.content;
  const boxId = freshId("agree");
  const box = h("input", { type: "checkbox", id: boxId, data: { testid: "consent-box" } });
  const error = h(
    "p",
    { class: "field-error", role: "alert", hidden: true },
    icon("warning"),
    h("span", {}, "Tick the box above if you agree, or choose not to take part."),
  );
  box.addEventListener("change", () => {
    error.hidden = true;
  });
  const agree = h(
    "button",
    { type: "submit", class: "primary large", data: { testid: "consent-agree" } },
    "Agree and continue",
  );
  const decline = h(
    "button",
    { type: "button", class: "secondary large", data: { testid: "consent-decline" } },
    "I do not want to take part",
  );
  decline.addEventListener("click", async () => {
    const answer = await ask({
      title: "Not take part?",
      text: ["Nothing has been recorded about you. You cannot come back with this link."],
      confirm: "Do not take part",
      danger: true,
      testid: "decline-dialog",
    });
    if (answer !== null) whileBusy(decline, "Saving", () => socket.submit("decline").catch(() => {}));
  });
  const form = h(
    "form",
    { novalidate: true },
    h("label", { class: "agree", for: boxId }, box, h("span", {}, "I have read this and I agree to take part.")),
    error,
    h("div", { class: "actions" }, agree, decline),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (!box.checked) {
      error.hidden = false;
      box.focus();
      return;
    }
    whileBusy(agree, "Saving", () => socket.submit("consent", { accepted: true, hash }).catch(() => {}));
  });
  const element = card({
    title: title || "Taking part",
    testid: "page-consent",
    body: [
      h("div", { class: "prose" }, paragraphs(text)),
      contact ? h("p", { class: "contact" }, contact) : null,
      form,
    ],
  });
  return { element };
}

/**
 * @param {Context} context
 * @param {PageOf<{ items: Asked[] }>} page
 * @returns {View}
 */
export function demographicsView({ socket, session }, page) {
  const key = `${session}:demographics`;
  const questions = keptQuestions(page.content.items, key);
  const { form, close } = questionForm({
    socket,
    questions,
    submitText: "Continue",
    step: "demographics",
    key,
    testid: "demographics-submit",
  });
  const element = card({
    title: "About you",
    lines: ["A few short questions before we begin."],
    body: form,
    testid: "page-demographics",
  });
  return { element, close };
}

/**
 * @param {Context} context
 * @param {PageOf<{ text: string[], questions: Asked[] }>} page
 * @returns {View}
 */
export function instructionsView({ socket, session }, page) {
  const key = `${session}:instructions`;
  const { text, questions: items } = page.content;
  const questions = keptQuestions(items, key);
  const { form, close } = questionForm({
    socket,
    questions,
    submitText: "Check my answers and continue",
    step: "instructions",
    key,
    testid: "instructions-submit",
  });
  const element = card({
    title: "What you will do",
    testid: "page-instructions",
    wide: true,
    body: h(
      "div",
      { class: "two-columns" },
      h(
        "ol",
        { class: "prose steps" },
        text.map((line) => h("li", {}, line)),
      ),
      h(
        "div",
        { class: "panel" },
        h("h2", {}, "Did we explain it well?"),
        h("p", {}, "Three short questions. You can try as often as you need."),
        form,
      ),
    ),
  });
  return { element, close };
}

/**
 * @param {Context} context
 * @param {PageOf<{ text: string[], next_trial: number }>} page
 * @returns {View}
 */
export function breakView({ socket }, page) {
  const { text, next_trial } = page.content;
  const element = card({
    title: "Time for a break",
    lines: text,
    sign: "hourglass",
    testid: "page-break",
    actions: [
      stepButton({
        socket,
        step: "continue",
        label: `Continue with round ${next_trial} of ${page.trials}`,
        kind: "primary large",
        testid: "continue-button",
      }),
    ],
  });
  return { element };
}

/**
 * @param {Context} context
 * @param {PageOf<{ text: string[], questions: Asked[] }>} page
 * @returns {View}
 */
export function debriefView({ socket, session }, page) {
  const key = `${session}:debrief`;
  const items = page.content.questions.map((item) => ({
    ...item,
    kind: /** @type {const} */ ("long"),
    required: false,
  }));
  const questions = keptQuestions(items, key);
  const { form, close } = questionForm({
    socket,
    questions,
    submitText: "Finish",
    step: "debrief",
    key,
    testid: "debrief-submit",
  });
  const element = card({
    title: "What this was about",
    testid: "page-debrief",
    body: [h("div", { class: "prose" }, paragraphs(page.content.text)), form],
  });
  return { element, close };
}

/** @type {Record<"done" | "withdrawn" | "aborted" | "screened_out", [title: string, sign: IconName]>} */
const ENDS = {
  done: ["Thank you", "check"],
  withdrawn: ["You have stopped taking part", "hand"],
  aborted: ["The session was ended", "warning"],
  screened_out: ["This study does not fit your device", "info"],
};

const FORWARD_S = 10;

/**
 * The last page. Its link appears when the lab has everything this browser still kept for it, and not before.
 *
 * @param {Context} context
 * @param {PageOf<{ text: string[], completion_link: string | null }, keyof typeof ENDS>} page
 * @returns {View}
 */
export function endView({ socket, session }, page) {
  const [title, sign] = ENDS[page.state];
  const link = page.content.completion_link ? safeLink(page.content.completion_link) : null;
  const last = h("div", { class: "last-words" });
  let timer = 0;
  /** @type {boolean | null} */
  let saved = null;

  /** @param {string} link */
  function forward(link) {
    const key = `${session}:forwarded`; // once: who comes back to this page wants to read it
    const onward = h(
      "a",
      { class: "button primary large", href: link, rel: "noreferrer", data: { testid: "completion-link" } },
      page.state === "done" ? "Continue to the completion page" : "Continue",
    );
    const actions = h("div", { class: "actions" }, onward);
    last.replaceChildren(actions);
    if (page.state !== "done" || tab.get(key, false)) return;
    let left = FORWARD_S;
    const words = h("p", { class: "hint", data: { testid: "forward-words" } });
    const stay = h(
      "button",
      { type: "button", class: "secondary large", data: { testid: "forward-stay" } },
      "Stay on this page",
    );
    const say = () => setText(words, `You are taken there in ${left} seconds.`);
    stay.addEventListener("click", () => {
      clearInterval(timer);
      words.remove();
      stay.remove();
      onward.focus();
    });
    timer = setInterval(() => {
      left -= 1;
      say();
      if (left > 0) return;
      clearInterval(timer);
      tab.set(key, true);
      location.assign(link);
    }, 1000);
    say();
    last.append(words);
    actions.append(stay);
  }

  function update() {
    const now = socket.outbox.waiting().length === 0;
    if (now === saved) return;
    saved = now;
    if (!saved)
      last.replaceChildren(
        h(
          "p",
          { class: "waiting", role: "status", data: { testid: "still-saving" } },
          h("span", { class: "spinner", "aria-hidden": "true" }),
          "Your last answers are on their way. Please keep this page open until this line is gone.",
        ),
      );
    else if (link) forward(link);
    else last.replaceChildren();
  }
  const stayHere = (/** @type {BeforeUnloadEvent} */ event) => saved || event.preventDefault();
  const deafen = [socket.on("ack", update), socket.on("refused", update)];
  addEventListener("beforeunload", stayHere);
  update();
  const element = card({ title, sign, lines: page.content.text, testid: `page-${page.state}`, body: last });
  const close = () => {
    clearInterval(timer);
    for (const stop of deafen) stop();
    removeEventListener("beforeunload", stayHere);
  };
  return { element, close };
}

/**
 * The pause, as a page of its own or over the stopped scene.
 *
 * @param {Context} context
 * @param {PageOf<{ can_resume: boolean, text: string }>} page
 * @returns {View}
 */
export function pausedView({ socket }, page) {
  const { can_resume, text } = page.content;
  const element = card({
    title: "Paused",
    sign: "pause",
    lines: [text],
    testid: "page-paused",
    actions: can_resume
      ? [
          stepButton({
            socket,
            step: "resume",
            label: "Go on",
            busy: "Going on",
            kind: "primary large",
            testid: "resume-button",
          }),
        ]
      : [
          h(
            "p",
            { class: "waiting" },
            h("span", { class: "spinner", "aria-hidden": "true" }),
            "Waiting for the experimenter",
          ),
        ],
  });
  return { element };
}
