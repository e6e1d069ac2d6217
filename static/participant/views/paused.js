// The pause, as a page of its own or over the stopped scene.

import { h } from "../../common/dom.js";
import { card, stepButton } from "../../common/shell.js";

/** @import { Context, PageOf, View } from "../view.js" */

/**
 * @param {Context} context
 * @param {PageOf<{ can_resume: boolean, text: string }>} page
 * @returns {View}
 */
export function view({ socket }, page) {
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
