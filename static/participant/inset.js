// The second picture: the same scene from the side, at the gripper, for depth. It is a help and no more: nothing waits
// for it, and whatever happens to it, the study goes on.

import { h, setText } from "../common/dom.js";
import { t } from "../common/language.js";
import { labUrl } from "../common/root.js";
import { PictureWatch } from "./picture_watch.js";

const LOST = t("This picture is not there now. You can drive without it.");

export class Inset {
  constructor() {
    this.frame = h("iframe", {
      class: "inset-frame",
      title: t("The gripper from the side"),
      tabindex: "-1",
      inert: true,
      data: { testid: "inset-frame" },
    });
    this.sign = h("p", { class: "inset-sign", hidden: true, data: { testid: "inset-sign" } });
    this.element = h(
      "figure",
      { class: "side-card inset", hidden: true, data: { testid: "inset" } },
      h("figcaption", {}, t("From the side, at the gripper")),
      h("div", { class: "inset-picture" }, this.frame, this.sign),
    );
    this._key = "";
    this.watch = new PictureWatch(this.frame); // it loads the picture again by itself
    this._deafen = this.watch.on("change", () => {
      const gone = this.watch.why !== null;
      this.sign.hidden = !gone;
      setText(this.sign, gone ? LOST : "");
    });
  }

  /**
   * `key` changes when another worker draws, as of the main picture; `there` is what the study says.
   *
   * @param {{ src: string, key: string, there: boolean }} scene
   * @returns {void}
   */
  show({ src, key, there }) {
    this.element.hidden = !there || !src;
    if (this.element.hidden || this._key === `${key} ${src}`) return;
    this._key = `${key} ${src}`;
    this.frame.src = `${labUrl(src)}?inset`;
    this.watch.loading();
  }

  /** @returns {void} */
  close() {
    this._deafen();
    this.watch.close();
  }
}
