// The rest between two trials.

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
    title: "Time for a break",
    lines: text,
    sign: "hourglass",
    testid: "page-break",
    actions: [
      stepButton({
        socket,
        step: "continue",
        label: `Continue with round ${next_trial} of ${page.trials}`,
        kind: "primary large",
        testid: "continue-button",
      }),
    ],
  });
  return { element };
}
