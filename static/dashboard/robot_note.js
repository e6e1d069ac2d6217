// That another robot moves than usual, for as long as this lab runs.

import { h, setText } from "../common/dom.js";

/** @import { Api } from "./api.js" */

export class RobotNote {
  constructor() {
    this.element = h("p", { class: "hint", hidden: true, data: { testid: "robot-note" } });
  }

  /**
   * Say what the lab says of its robot, if anything.
   *
   * @param {Api} api
   * @returns {Promise<void>}
   */
  async ask(api) {
    const health = await api.health().catch(() => null); // it answers 503 while something is wrong, which is told elsewhere
    setText(this.element, health?.robot_note ?? "");
    this.element.hidden = !health?.robot_note;
  }
}
