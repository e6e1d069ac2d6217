// What is to be done, and whether that was understood.

import { h } from "../../common/dom.js";
import { card } from "../../common/shell.js";
import { keptQuestions, questionForm } from "../forms.js";

/** @import { Asked } from "../questions.js" */
/** @import { Context, PageOf, View } from "../view.js" */

/**
 * @param {Context} context
 * @param {PageOf<{ text: string[], questions: Asked[] }>} page
 * @returns {View}
 */
export function view({ socket, session }, page) {
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
