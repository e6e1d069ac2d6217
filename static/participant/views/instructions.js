// What is to be done, and whether that was understood.

import { h } from "../../common/dom.js";
import { t, tn } from "../../common/language.js";
import { card } from "../../common/shell.js";
import { keptQuestions, questionForm } from "../forms.js";
import { beforehand } from "../freeing.js";

/** @import { Asked } from "../questions.js" */
/** @import { Limits } from "../freeing.js" */
/** @import { Context, PageOf, View } from "../view.js" */

/**
 * How many questions there are, in words; a study may ask any number, or none.
 *
 * @param {number} count at least 1
 * @returns {string}
 */
const howMany = (count) =>
  tn(
    "One short question. You can try as often as you need.",
    "{n} short questions. You can try as often as you need.",
    count,
  );

/**
 * @param {Context} context
 * @param {PageOf<{ text: string[], limits?: Limits, questions: Asked[] }>} page
 * @returns {View}
 */
export function view({ socket, session }, page) {
  const key = `${session}:instructions`;
  const { text, limits = {}, questions: items } = page.content;
  const questions = keptQuestions(items, key);
  const { form, close } = questionForm({
    socket,
    questions,
    submitText: items.length > 0 ? t("Check my answers and continue") : t("Continue"),
    step: "instructions",
    key,
    testid: "instructions-submit",
  });
  const lines = h(
    "ol",
    { class: "prose steps" },
    [...text, ...beforehand(limits)].map((line) => h("li", {}, line)),
  );
  const asked = h(
    "div",
    { class: "panel", data: { testid: "instructions-questions" } },
    h("h2", {}, t("Did we explain it well?")),
    h("p", {}, howMany(items.length)),
    form,
  );
  const element = card({
    title: t("What you will do"),
    testid: "page-instructions",
    wide: items.length > 0,
    body: items.length > 0 ? h("div", { class: "two-columns" }, lines, asked) : [lines, form],
  });
  return { element, close };
}
