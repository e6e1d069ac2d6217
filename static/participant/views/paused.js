// The pause, as a page of its own or over the stopped scene.

import { h } from "../../common/dom.js";
import { t } from "../../common/language.js";
import { card, stepButton } from "../../common/shell.js";
import { ADVICE } from "../picture_check.js";

/** @import { Context, PageOf, View } from "../view.js" */

/**
 * @param {Context} context
 * @param {PageOf<{ can_resume: boolean, text: string, causes?: string[] }>} page
 * @param {(() => void) | null} [load] loads the picture of the robot again, where there is one
 * @returns {View & { goOn: HTMLButtonElement | null }} `goOn` where they go on by themselves
 */
export function view({ socket }, page, load = null) {
  const { can_resume, text, causes = [] } = page.content;
  const unseen = causes.includes("picture");
  const waiting = (/** @type {string} */ words) =>
    h("p", { class: "waiting" }, h("span", { class: "spinner", "aria-hidden": "true" }), words);
  const again = h(
    "button",
    { type: "button", class: "secondary", data: { testid: "picture-load" } },
    t("Load the picture again"),
  );
  again.addEventListener("click", () => load?.());
  const reload = h(
    "button",
    { type: "button", class: "secondary", data: { testid: "page-reload" } },
    t("Reload the page"),
  );
  reload.addEventListener("click", () => location.reload());
  const goOn = can_resume
    ? stepButton({
        socket,
        step: "resume",
        label: t("Go on"),
        busy: t("Going on"),
        kind: "primary large",
        testid: "resume-button",
      })
    : null;
  const waitedFor =
    causes.includes("experimenter") || !unseen ? t("Waiting for the experimenter") : t("Waiting for the picture");
  const element = card({
    title: t("Paused"),
    sign: "pause",
    lines: [text],
    testid: "page-paused",
    body: unseen && [
      h("p", {}, t("If it does not come back:")),
      h(
        "ul",
        { class: "advice" },
        ADVICE.map((line) => h("li", {}, line)),
      ),
    ],
    actions: [goOn ?? waiting(waitedFor), ...(unseen && load ? [again] : []), ...(unseen ? [reload] : [])],
  });
  return { element, goOn };
}
