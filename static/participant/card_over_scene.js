// The card over the scene, before a round and in a pause, with the button on it that leads on.

import { h } from "../common/dom.js";
import { t } from "../common/language.js";

/** @import { Sign } from "./state_sign.js" */
/** @typedef {{ start?: HTMLButtonElement, goOn?: HTMLButtonElement | null }} Buttons */

/** @type {Partial<Record<Sign, string>>} why a round cannot start yet */
const WHY_NOT = { unseen: t("Its picture is not there yet."), alone: t("The second device is not there yet.") };

export class CardOverScene {
  constructor() {
    this.element = h("div", { class: "overlay", hidden: true });
    /** @type {Buttons} */
    this.buttons = {};
  }

  /**
   * @param {HTMLElement | null} content null for none
   * @param {Buttons} [buttons] of the content
   * @returns {void}
   */
  show(content, buttons = {}) {
    this.buttons = buttons;
    this.element.hidden = content === null;
    this.element.className = buttons.start ? "overlay low" : "overlay";
    this.element.replaceChildren(...(content ? [content] : []));
    if (content) (content.querySelector("button") ?? content.querySelector("h1"))?.focus({ preventScroll: true });
  }

  /**
   * Which button can be pressed now, and if not why.
   *
   * @param {Sign} state
   * @param {boolean} isSeen whether the robot is
   * @returns {void}
   */
  refresh(state, isSeen) {
    const { start, goOn } = this.buttons;
    if (start) {
      const ready = state === "ready";
      waitFor(start, ready ? "" : (WHY_NOT[state] ?? t("The robot is not in place yet.")));
      if (ready && document.activeElement === document.body) start.focus({ preventScroll: true });
    }
    if (goOn && goOn.getAttribute("aria-busy") !== "true")
      waitFor(goOn, isSeen ? "" : t("The picture of the robot is not there yet."));
  }
}

/**
 * @param {HTMLButtonElement} button
 * @param {string} why it has to wait, "" when it need not
 * @returns {void}
 */
function waitFor(button, why) {
  button.disabled = why !== "";
  button.title = why;
}
