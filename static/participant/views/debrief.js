// What it was about, and room for a word about it.

import { h } from "../../common/dom.js";
import { t } from "../../common/language.js";
import { card } from "../../common/shell.js";
import { keptQuestions, paragraphs, questionForm } from "../forms.js";

/** @import { Asked } from "../questions.js" */
/** @import { Context, PageOf, View } from "../view.js" */

/**
 * @param {Context} context
 * @param {PageOf<{ text: string[], questions: Asked[] }>} page
 * @returns {View}
 */
export function view({ socket, session }, page) {
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
    submitText: t("Finish"),
    step: "debrief",
    key,
    testid: "debrief-submit",
  });
  const element = card({
    title: t("What this was about"),
    testid: "page-debrief",
    body: [h("div", { class: "prose" }, paragraphs(page.content.text)), form],
  });
  return { element, close };
}
