// That the lab cannot save, above everything else, for as long as it is so.

import { h, icon, setText } from "../common/dom.js";

/** @import { TroubleReply } from "../../tests/javascript/api.d.ts" */

export class TroubleNotice {
  constructor() {
    this.text = h("span", {});
    this.line = h(
      "p",
      { class: "unsaved", hidden: true, data: { testid: "lab-trouble" } },
      icon("warning"),
      h("strong", {}, "The lab cannot save."),
      this.text,
    );
    this.element = h("div", { role: "alert" }, this.line);
  }

  /**
   * @param {TroubleReply | null} trouble null: it can
   * @returns {void}
   */
  show(trouble) {
    this.line.hidden = trouble === null;
    if (trouble === null) return;
    const since = new Date(trouble.since_utc).toLocaleTimeString([], { hour12: false });
    const rescue = trouble.rescue
      ? ` Everything recorded so far was copied to ${trouble.rescue}; a lab can be started on it.`
      : "";
    const meanwhile = `Robots stand still and nothing is lost; it tries again by itself (since ${since}).`;
    setText(this.text, `${trouble.text} ${meanwhile}${rescue}`);
  }
}
