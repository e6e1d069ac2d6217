// Questions about the person.

import { t } from "../../common/language.js";
import { card } from "../../common/shell.js";
import { keptQuestions, questionForm } from "../forms.js";

/** @import { Asked } from "../questions.js" */
/** @import { Context, PageOf, View } from "../view.js" */

/**
 * @param {Context} context
 * @param {PageOf<{ items: Asked[] }>} page
 * @returns {View}
 */
export function view({ socket, session }, page) {
  const key = `${session}:demographics`;
  const questions = keptQuestions(page.content.items, key);
  const { form, close } = questionForm({
    socket,
    questions,
    submitText: t("Continue"),
    step: "demographics",
    key,
    testid: "demographics-submit",
  });
  const element = card({
    title: t("About you"),
    lines: [t("A few short questions before we begin.")],
    body: form,
    testid: "page-demographics",
  });
  return { element, close };
}
