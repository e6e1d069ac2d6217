// What to do when the arm does not move: the words for the lab's codes.

import { h, icon, setText } from "../common/dom.js";
import { t } from "../common/language.js";

/** @import { Tick } from "../../tests/javascript/wire.d.ts" */
/** @typedef {NonNullable<Tick["hint"]>} Hint */

/** @type {Record<Hint["cause"], string>} */
export const CAUSES = {
  touches: t("The gripper touches something."),
  touches_closed: t("The closed gripper touches something."),
  touches_holding: t("The gripper, or what it holds, touches something."),
  low: t("The gripper is as low as it goes."),
  high: t("The gripper is as high as it goes."),
  near: t("The arm is as near to the robot as it goes."),
  limit: t("The arm reaches no further that way."),
};
/** @type {Record<Hint["ways"][number], string>} */
export const WAYS = {
  up: t("Go up."),
  back: t("Go back."),
  left: t("Go left."),
  right: t("Go right."),
  forward: t("Go forward."),
  down: t("Go down."),
  open: t("Open the gripper."),
};
/** A lab that gives no reason. */
export const ANY_WAY = t("Cannot move further that way. Go another way.");

/**
 * The hint in words.
 *
 * @param {Hint | null | undefined} hint
 * @returns {string}
 */
export function hintText(hint) {
  if (!hint) return ANY_WAY;
  return [CAUSES[hint.cause], ...hint.ways.map((way) => WAYS[way])].join(" ");
}

/** The line over the scene. It keeps its place while it says nothing. */
export class HintLine {
  constructor() {
    this.text = h("span", {});
    this.element = h(
      "p",
      { class: "drive-hint", role: "status", data: { testid: "drive-hint" } },
      icon("warning"),
      this.text,
    );
  }

  /**
   * @param {Tick | null} tick that the arm was blocked in; null for none
   * @returns {void}
   */
  show(tick) {
    setText(this.text, tick ? hintText(tick.hint) : "");
    this.element.classList.toggle("shown", tick !== null);
  }
}
