// How far the round is: in words, and a dot for each task.

import { h, setText } from "../common/dom.js";
import { t } from "../common/language.js";

export class Progress {
  constructor() {
    this.words = h("p", { class: "progress-text", data: { testid: "progress" } });
    this.dots = h("div", { class: "dots", "aria-hidden": "true" });
    this.element = h("section", { class: "progress", "aria-label": t("Progress") }, this.words, this.dots);
  }

  /**
   * @param {string} where
   * @param {{ done: number, tasks: number } | null} count null where tasks are not counted
   * @returns {void}
   */
  show(where, count) {
    setText(this.words, where);
    const { done, tasks } = count ?? { done: 0, tasks: 0 };
    if (this.dots.children.length !== tasks)
      this.dots.replaceChildren(...Array.from({ length: tasks }, () => h("span", { class: "dot" })));
    [...this.dots.children].forEach((dot, index) => {
      dot.className = index < done ? "dot past" : index === done ? "dot present" : "dot";
    });
    this.dots.hidden = tasks < 2;
  }
}
