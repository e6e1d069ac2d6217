// A line over the scene that goes by itself, such as how a task ended.

import { h, icon } from "../common/dom.js";

const SHOWN_MS = 7000;

export class PassingNotice {
  constructor() {
    this.element = h("div", { class: "notice", role: "status", hidden: true, data: { testid: "notice" } });
    this._timer = 0;
  }

  /**
   * @param {string} text
   * @returns {void}
   */
  say(text) {
    clearTimeout(this._timer);
    this.element.hidden = false;
    this.element.replaceChildren(icon("info"), h("p", {}, text));
    this._timer = setTimeout(() => this.hide(), SHOWN_MS);
  }

  /** @returns {void} */
  hide() {
    clearTimeout(this._timer);
    this.element.hidden = true;
  }
}
