// The rest between two trials.

import { t } from "../../common/language.js";
import { card, stepButton } from "../../common/shell.js";

/** @import { Context, PageOf, View } from "../view.js" */

/**
 * @param {Context} context
 * @param {PageOf<{ text: string[], next_trial: number }>} page
 * @returns {View}
 */
export function view({ socket }, page) {
  const { text, next_trial } = page.content;
  const element = card({
    title: t("Time for a break"),
    lines: text,
    sign: "hourglass",
    testid: "page-break",
    actions: [
      stepButton({
        socket,
        step: "continue",
        label: t("Continue with round {trial} of {trials}", { trial: next_trial, trials: page.trials }),
        kind: "primary large",
        testid: "continue-button",
      }),
    ],
  });
  return { element };
}
