// Single questions of a form: radio groups, text and number fields, with their own error line.

import { freshId, h, icon, setText } from "../common/dom.js";
import { t } from "../common/language.js";
import { refusalText } from "../common/problem.js";
import { numberProblem } from "../common/typed_number.js";
import { wordsProblem } from "../common/words_limit.js";

/** @import { Child } from "../common/dom.js" */
/** @import { LabSocket } from "../wire/socket.js" */
/** @typedef {string | null} Answer as it was typed, or the id of the option; null for none */
/**
 * @typedef {object} Asked a question as the study file has it
 * @property {string} id
 * @property {string} prompt
 * @property {"choice" | "text" | "number" | "long"} [kind]
 * @property {{ id: string, label: string }[]} [options]
 * @property {boolean} [required]
 * @property {boolean} [whole] of a number: whether only a whole one is taken
 * @property {number | null} [least] of a number
 * @property {number | null} [most] of a number
 */
/**
 * @typedef {object} Question a question as it stands on the page
 * @property {string} id
 * @property {boolean} required
 * @property {HTMLElement} element
 * @property {() => Answer} value
 * @property {() => string} problem why the answer cannot be taken, "" when it can
 * @property {() => void} clear takes its error away
 * @property {(text: string) => void} fail shows an error
 * @property {() => boolean} failed whether it shows one
 * @property {() => void} focus
 */
/** @typedef {{ element: HTMLElement, controls: (HTMLInputElement | HTMLTextAreaElement)[], value: () => Answer }} Controls */
/** @typedef {Required<Pick<Asked, "id" | "prompt">> & { kept: Answer, errorId: string, note: Child }} Framed */

/**
 * Puts a question on the page. `kept` is what was answered before a reload.
 *
 * @param {Asked} asked
 * @param {{ kept: Answer, onChange: (id: string, value: Answer) => void }} answering
 * @returns {Question}
 */
export function question(asked, { kept, onChange }) {
  const { id, prompt, kind = "choice", options = [], required = true } = asked;
  const errorId = freshId("error");
  const errorText = h("span", {});
  const error = h("p", { id: errorId, class: "field-error", role: "alert", hidden: true }, icon("warning"), errorText);
  const note = !required ? h("span", { class: "optional" }, " ", t("(optional)")) : null;
  const made =
    kind === "choice"
      ? choice({ id, prompt, options, kept, errorId, note })
      : typed({ id, prompt, kind, kept, errorId, note });
  made.element.append(error);
  made.element.addEventListener("input", () => {
    clear();
    onChange(id, made.value());
  });
  function clear() {
    error.hidden = true;
    made.element.classList.remove("missing");
    for (const control of made.controls) control.removeAttribute("aria-invalid");
  }
  return {
    id,
    required,
    element: made.element,
    value: made.value,
    problem() {
      const value = made.value();
      if (value === null) return required ? t("Please answer this question.") : "";
      if (kind === "choice") return "";
      if (value.trim() === "") return t("This holds blanks alone. Please write something, or leave it empty.");
      return (kind === "number" ? numberProblem(value, asked) : wordsProblem(value)) ?? "";
    },
    clear,
    failed: () => !error.hidden,
    fail(text) {
      setText(errorText, text);
      error.hidden = false;
      made.element.classList.add("missing");
      for (const control of made.controls) control.setAttribute("aria-invalid", "true");
    },
    focus() {
      made.element.scrollIntoView({ block: "center" });
      const chosen = made.controls.find((control) => control instanceof HTMLInputElement && control.checked);
      (chosen ?? made.controls[0])?.focus({ preventScroll: true });
    },
  };
}

/**
 * @param {Framed & { options: { id: string, label: string }[] }} framed
 * @returns {Controls}
 */
function choice({ id, prompt, options, kept, errorId, note }) {
  const name = freshId("choice");
  const choices = options.map((option) => {
    const radio = h("input", { type: "radio", name, value: option.id, "aria-describedby": errorId });
    radio.checked = kept === option.id;
    return { radio, label: h("label", { class: "option" }, radio, h("span", {}, option.label)) };
  });
  const controls = choices.map((one) => one.radio);
  const element = h(
    "fieldset",
    { class: "question", data: { testid: `question-${id}` } },
    h("legend", {}, prompt, note),
    h(
      "div",
      { class: "options" },
      choices.map((one) => one.label),
    ),
  );
  return { element, controls, value: () => controls.find((radio) => radio.checked)?.value ?? null };
}

/**
 * @param {Framed & { kind: "text" | "number" | "long" }} framed
 * @returns {Controls}
 */
function typed({ id, prompt, kind, kept, errorId, note }) {
  const fieldId = freshId("field");
  const control =
    kind === "number"
      ? h("input", {
          id: fieldId,
          type: "text", // a field of the type number changes what it does not understand, and tells nobody
          inputmode: "decimal",
          autocomplete: "off",
          autocapitalize: "off",
          spellcheck: "false",
          "aria-describedby": errorId,
        })
      : kind === "long"
        ? h("textarea", { id: fieldId, rows: 4, "aria-describedby": errorId })
        : h("input", { id: fieldId, type: "text", autocomplete: "off", "aria-describedby": errorId });
  if (kept !== null) control.value = kept;
  const element = h(
    "div",
    { class: "question field", data: { testid: `question-${id}` } },
    h("label", { for: fieldId }, prompt, note),
    control,
  );
  return { element, controls: [control], value: () => (control.value === "" ? null : control.value) };
}

/**
 * Says beside each question why its answer cannot be taken; returns whether all can, and moves focus to the first gap.
 *
 * @param {Question[]} questions
 * @returns {boolean}
 */
export function checkAll(questions) {
  const wrong = questions.filter((one) => one.problem() !== "");
  for (const one of wrong) one.fail(one.problem());
  wrong[0]?.focus();
  return wrong.length === 0;
}

/**
 * {question: value} without the empty ones.
 *
 * @param {Question[]} questions
 * @returns {Record<string, Answer>}
 */
export function valuesOf(questions) {
  return Object.fromEntries(questions.map((one) => [one.id, one.value()]).filter(([, value]) => value !== null));
}

/**
 * Shows the lab's refusals of `answers.<id>` beside their questions. Returns a function that stops listening.
 *
 * @param {LabSocket} socket
 * @param {Question[]} questions
 * @returns {() => void}
 */
export function showRefusals(socket, questions) {
  return socket.on("refused", (event) => {
    const ids = [...(event.detail.field ?? "").matchAll(/answers\.([^,\s]+)/g)].map((match) => match[1]);
    const wrong = questions.filter((one) => ids.includes(one.id));
    if (wrong.length === 0) return;
    event.preventDefault(); // shown here, so no toast
    for (const one of wrong) one.fail(refusalText(null, event.detail.message));
    questions.find((one) => one.failed())?.focus();
  });
}
