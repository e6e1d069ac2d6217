// What pages made of text and questions have in common.

import { h, whileBusy } from "../common/dom.js";
import { t } from "../common/language.js";
import { tab } from "../common/store.js";
import { checkAll, question, showRefusals, valuesOf } from "./questions.js";

/** @import { Submit } from "../../tests/javascript/wire.d.ts" */
/** @import { LabSocket } from "../wire/socket.js" */
/** @import { Answer, Asked, Question } from "./questions.js" */

/** @type {(lines: string[]) => HTMLElement[]} */
export const paragraphs = (lines) => lines.map((line) => h("p", {}, line));

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
export function questionForm({ socket, questions, submitText, step, key, testid }) {
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
    whileBusy(button, t("Saving"), async () => {
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
export function keptQuestions(items, key) {
  const kept = tab.get(key, /** @type {Record<string, Answer>} */ ({}));
  const onChange = (/** @type {string} */ id, /** @type {Answer} */ value) => {
    kept[id] = value;
    tab.set(key, kept);
  };
  return items.map((item) => question(item, { kept: kept[item.id] ?? null, onChange }));
}
