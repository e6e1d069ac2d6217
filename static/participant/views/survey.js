// Questionnaires as the lab sends them: one row of radio buttons per item, nothing skipped silently, kept over a reload.

import { freshId, h, icon, setText, whileBusy } from "../../common/dom.js";
import { LANGUAGE, number, t, tn } from "../../common/language.js";
import { tab } from "../../common/store.js";

/** @import { Context, PageOf, View } from "../view.js" */
/** @typedef {{ id: string, text: string, low: string, high: string }} Item */
/** @typedef {{ id: string, title: string, intro: string, source: string, points: number, items: Item[],
 *   language?: string, dir?: "ltr" | "rtl" }} Instrument */
/** @typedef {Record<string, Record<string, number>>} Answers by instrument and item */

/**
 * @param {Context} context
 * @param {PageOf<{ instruments: Instrument[] }>} page
 * @returns {View}
 */
export function view({ socket, session }, page) {
  const { instruments } = page.content;
  const key = `${session}:survey:${page.trial ?? 0}`;
  const answers = tab.get(key, /** @type {Answers} */ ({}));
  /** @type {ReturnType<typeof itemRow>[]} */
  const rows = [];
  const heading = h("h1", { tabindex: "-1" }, t("How was it?"));
  const summary = h("div", {
    class: "error-summary",
    role: "alert",
    tabindex: "-1",
    hidden: true,
    data: { testid: "survey-missing" },
  });
  const progress = h("p", { class: "survey-progress", role: "status", data: { testid: "survey-progress" } });

  const count = () => {
    const given = rows.filter((row) => row.value() !== null).length;
    setText(progress, t("{n} of {all} answered", { n: given, all: rows.length }));
  };

  const sections = instruments.map((instrument) => {
    const given = answers[instrument.id] ?? {};
    answers[instrument.id] = given;
    return h(
      "section",
      {
        class: "instrument",
        // Words in another language than the page's are said and set as that language is.
        lang: instrument.language,
        dir: instrument.dir,
        data: { testid: `instrument-${instrument.id}` },
      },
      h("h2", {}, instrument.title),
      h("p", { class: "intro" }, instrument.intro),
      instrument.items.map((item) => {
        const row = itemRow(instrument, item, given[item.id] ?? null, (value) => {
          given[item.id] = value;
          tab.set(key, answers);
          count();
        });
        rows.push(row);
        return row.element;
      }),
      h("p", { class: "source" }, instrument.source),
    );
  });

  const button = h(
    "button",
    { type: "submit", class: "primary large", data: { testid: "survey-submit" } },
    t("Save answers and continue"),
  );
  const form = h(
    "form",
    { novalidate: true },
    summary,
    sections,
    h("div", { class: "actions sticky" }, progress, button),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const missing = rows.filter((row) => row.check() === false);
    summary.hidden = missing.length === 0;
    if (missing.length > 0) {
      const words = tn(
        "One question is not answered yet. It is marked below.",
        "{n} questions are not answered yet. They are marked below.",
        missing.length,
      );
      summary.replaceChildren(icon("warning"), h("p", {}, words));
      missing[0]?.focus();
      return;
    }
    whileBusy(button, t("Saving"), async () => {
      try {
        await socket.submit("survey", { answers });
        tab.remove(key);
      } catch {
        // shown as a message; the answers stay
      }
    });
  });
  count();
  const trialText =
    page.trial && page.trials
      ? t("Your answers are about round {trial} of {trials}, the one you have just finished.", {
          trial: page.trial,
          trials: page.trials,
        })
      : "";
  const element = h(
    "section",
    { class: "card wide survey", data: { testid: "page-survey" } },
    heading,
    h("p", {}, trialText),
    form,
  );
  return { element };
}

/**
 * @param {Instrument} instrument
 * @param {Item} item
 * @param {number | null} chosen
 * @param {(value: number) => void} onChange
 */
function itemRow(instrument, item, chosen, onChange) {
  const name = `${instrument.id}.${item.id}`;
  const errorId = freshId("missing");
  const error = h(
    "p",
    { id: errorId, class: "field-error", hidden: true, lang: LANGUAGE.tag, dir: LANGUAGE.dir }, // not the instrument's
    icon("warning"),
    h("span", {}, t("Please choose an answer.")),
  );
  const radios = Array.from({ length: instrument.points }, (_, index) => {
    const value = index + 1;
    const anchor = value === 1 ? item.low : value === instrument.points ? item.high : null;
    const radio = h("input", {
      type: "radio",
      name,
      value: String(value),
      "aria-describedby": errorId,
      "aria-label": anchor ? `${number(value)}, ${anchor}` : number(value),
    });
    if (chosen === value) radio.checked = true;
    radio.addEventListener("change", () => {
      error.hidden = true;
      fieldset.classList.remove("missing");
      onChange(value);
    });
    return radio;
  });
  const fieldset = h(
    "fieldset",
    { class: "item", data: { testid: `item-${name}` } },
    h("legend", {}, item.text),
    h(
      "div",
      { class: "scale" },
      h("span", { class: "anchor low", "aria-hidden": "true" }, item.low),
      h(
        "div",
        { class: "points" },
        radios.map((radio) =>
          h("label", { class: "point" }, radio, h("span", { "aria-hidden": "true" }, number(Number(radio.value)))),
        ),
      ),
      h("span", { class: "anchor high", "aria-hidden": "true" }, item.high),
    ),
    error,
  );
  const value = () => radios.find((radio) => radio.checked)?.value ?? null;
  return {
    element: fieldset,
    value,
    focus: () => {
      fieldset.scrollIntoView({ block: "center" });
      radios[0]?.focus({ preventScroll: true });
    },
    check: () => {
      const given = value() !== null;
      fieldset.classList.toggle("missing", !given);
      error.hidden = given;
      return given;
    },
  };
}
