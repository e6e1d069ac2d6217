// That nearly as many people take part as the lab takes at once, or more, for as long as it is so.

import { h, icon, setText } from "../common/dom.js";

/** @import { CrowdingReply } from "../../tests/javascript/api.d.ts" */

export class CrowdingNotice {
  constructor() {
    this.text = h("span", {});
    this.line = h(
      "p",
      { class: "crowding", hidden: true, data: { testid: "lab-crowding" } },
      icon("warning"),
      this.text,
    );
    this.element = h("div", { role: "status" }, this.line);
  }

  /**
   * @param {CrowdingReply | null} crowding null: there is room for many
   * @returns {void}
   */
  show(crowding) {
    this.line.hidden = crowding === null;
    this.line.dataset.level = crowding?.level ?? "";
    if (crowding !== null) setText(this.text, crowding.text);
  }
}
