// The sign that says what the robot is doing, or why it does nothing.

import { h, icon, setText } from "../common/dom.js";

/** @import { Tick } from "../../tests/javascript/wire.d.ts" */
/** @import { IconName } from "../common/dom.js" */
/** @typedef {"lost" | "paused" | "held" | "starting" | "recovering" | "ready" | Tick["status"]} Sign */

/** @type {Record<Sign, [sign: IconName, text: string, hint: string]>} */
const SIGNS = {
  lost: ["lost", "Connection lost", "The robot stands still until the connection is back."],
  paused: ["pause", "Paused", "Nothing moves and no time passes."],
  held: ["hand", "On hold", "The lab has not heard from this page for a moment. The robot stands still."],
  starting: ["hourglass", "Getting ready", "The robot is being put in place. A few seconds."],
  recovering: ["hourglass", "Recovering", "The robot is being brought back to where it was. A few seconds."],
  ready: ["play", "Ready", "Press Start when you are."],
  resetting: ["reset", "Resetting", "The arm goes back to its starting position by itself."],
  gripper: ["grip", "Gripper moving", "The arm stands still for a second."],
  running: ["play", "Running", "You can drive."],
  finished: ["check", "Finished", "The next page follows."],
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
