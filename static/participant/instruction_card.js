// What to do now: a sentence, and the pictures of what to move and where to.

import { h, setText } from "../common/dom.js";
import { t } from "../common/language.js";
import { instructionPicture } from "./picture.js";

/** @import { Instruction } from "../../tests/javascript/wire.d.ts" */
/** @import { Look } from "./picture.js" */

const LONG = 48; // characters

export class InstructionCard {
  constructor() {
    /** @type {Record<string, Look>} */
    this.looks = {};
    this._shown = "";
    this.words = h("p", { class: "instruction-text", data: { testid: "instruction" } });
    this.pictures = h("div", { class: "instruction-picture" });
    this.element = h(
      "section",
      { class: "side-card instruction", "aria-label": t("What to do now") },
      h("h2", { class: "visually-hidden" }, t("What to do now")),
      h("div", { "aria-live": "assertive" }, this.words),
      this.pictures,
    );
  }

  /**
   * @param {Instruction} instruction
   * @returns {void}
   */
  show(instruction) {
    const shown = JSON.stringify(instruction);
    if (shown === this._shown) return; // said once
    this._shown = shown;
    setText(this.words, instruction.text);
    this.words.classList.toggle("long", instruction.text.length > LONG);
    this.element.dataset.kind = instruction.kind;
    this.pictures.replaceChildren(...instructionPicture(instruction, this.looks));
  }
}
