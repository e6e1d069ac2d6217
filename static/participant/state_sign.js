// The sign that says what the robot is doing, or why it does nothing.

import { h, icon, setText } from "../common/dom.js";
import { t } from "../common/language.js";

/** @import { Tick } from "../../tests/javascript/wire.d.ts" */
/** @import { IconName } from "../common/dom.js" */
/** @typedef {"lost" | "paused" | "unsaved" | "held" | "starting" | "recovering" | "unseen" | "alone" | "ready" | Tick["status"]} Sign */

/** @type {Record<Sign, [sign: IconName, text: string, hint: string]>} */
const SIGNS = {
  lost: ["lost", t("Connection lost"), t("The robot stands still until the connection is back.")],
  paused: ["pause", t("Paused"), t("Nothing moves and no time passes.")],
  unsaved: ["hourglass", t("On hold"), t("The lab cannot save at the moment. The robot stands still.")],
  held: ["hand", t("On hold"), t("The lab has not heard from this page for a moment. The robot stands still.")],
  starting: ["hourglass", t("Getting ready"), t("The robot is being put in place. A few seconds.")],
  recovering: ["hourglass", t("Recovering"), t("The robot is being brought back to where it was. A few seconds.")],
  unseen: ["hourglass", t("Getting ready"), t("Loading the picture of the robot")],
  alone: ["hourglass", t("Getting ready"), t("Waiting for the second device")],
  ready: ["play", t("Ready"), t("Press Start when you are.")],
  resetting: ["reset", t("Resetting"), t("The arm goes back to its starting position by itself.")],
  gripper: ["grip", t("Gripper moving"), t("The arm stands still for a second.")],
  running: ["play", t("Running"), t("You can drive.")],
  finished: ["check", t("Finished"), t("The next page follows.")],
};

export class StateSign {
  constructor() {
    this.icon = h("span", { class: "sign-icon" });
    this.text = h("strong", {});
    this.hint = h("span", { class: "sign-hint" });
    this.element = h(
      "div",
      { class: "sign", role: "status", data: { testid: "state-sign" } },
      this.icon,
      h("span", { class: "sign-words" }, this.text, this.hint),
    );
  }

  /**
   * @param {Sign} state
   * @returns {void}
   */
  show(state) {
    if (this.element.dataset.state === state) return;
    this.element.dataset.state = state;
    const [sign, text, hint] = SIGNS[state];
    this.icon.replaceChildren(icon(sign));
    setText(this.text, text);
    setText(this.hint, hint);
  }
}
