// The 3-D view of a session with the experimenter's own camera: there only after it was asked for, from a server of its
// own, which shows what the participant's never does (app/worker/spectator_view.py).

import { freshId, h, setText, whileBusy } from "../common/dom.js";
import { problemText } from "../common/problem.js";
import { labUrl } from "../common/root.js";

/** @import { Toasts } from "../common/shell.js" */
/** @import { Api } from "./api.js" */

const OPEN = "Open the 3-D view";
const CLOSE = "Close the 3-D view";

export class Spectator {
  /** @param {{ api: Api, participant: string, toasts: Toasts }} wiring */
  constructor({ api, participant, toasts }) {
    this.api = api;
    this.participant = participant;
    this.toasts = toasts;
    /** @type {HTMLIFrameElement | null} */
    this.frame = null;
    this.connected = false;
    this.why = "";
    const titleId = freshId("spectator");
    const helpId = freshId("spectator-help");
    this.toggle = h(
      "button",
      { type: "button", class: "secondary small", "aria-expanded": "false", data: { testid: "spectator-toggle" } },
      OPEN,
    );
    this.toggle.addEventListener("click", () => (this.frame ? this.close() : this._open()));
    this.steer = h(
      "button",
      {
        type: "button",
        class: "secondary small",
        hidden: true,
        "aria-describedby": helpId,
        data: { testid: "spectator-steer" },
      },
      "Steer by keys",
    );
    this.steer.addEventListener("click", () => this.frame?.contentWindow?.focus());
    this.sign = h("p", { class: "spectator-sign", role: "status", hidden: true, data: { testid: "spectator-sign" } });
    this.view = h("div", { class: "spectator", hidden: true, data: { testid: "spectator" } }, this.sign);
    this.help = h(
      "p",
      { class: "hint", id: helpId, hidden: true },
      "Columns show the belief, the ring the instructed goal; the participant sees nothing of this. Drag to orbit, scroll to come closer. By keys: arrows orbit, W A S D move, Q and E go down and up, Escape leaves.",
    );
    this.element = h(
      "section",
      { class: "board-card", "aria-labelledby": titleId },
      h(
        "div",
        { class: "board-head" },
        h("h2", { id: titleId }, "The robot in 3-D"),
        h("span", { class: "buttons" }, this.steer, this.toggle),
      ),
      this.view,
      this.help,
    );
    /** @type {(event: MessageEvent) => void} */
    this._message = (event) => {
      if (!this.frame || event.source !== this.frame.contentWindow) return;
      if (event.data?.type === "scene") {
        this.connected = event.data.connected;
        this._say();
      } else if (event.data?.type === "scene_leave") this.steer.focus();
    };
    addEventListener("message", this._message);
  }

  /**
   * `why`: why there is no view now, "" when there is.
   *
   * @param {string} why
   * @returns {void}
   */
  show(why) {
    this.why = why;
    this._say();
  }

  /** @returns {void} */
  close() {
    this.frame?.remove();
    this.frame = null;
    for (const part of [this.view, this.help, this.steer]) part.hidden = true;
    this._toggled(false);
  }

  /**
   * The page of the session is gone.
   *
   * @returns {void}
   */
  end() {
    removeEventListener("message", this._message);
    this.close();
  }

  async _open() {
    if (this.why) return this.toasts.show(this.why);
    await whileBusy(this.toggle, "Opening", async () => {
      try {
        await this.api.desk();
      } catch (error) {
        this.toasts.show(`The 3-D view could not be opened: ${problemText(error)}`, { problem: true });
        return;
      }
      this.connected = false;
      this.frame = h("iframe", {
        class: "spectator-frame",
        title: `The robot of ${this.participant} in 3-D`,
        src: labUrl(`/dashboard/scene/${encodeURIComponent(this.participant)}/`),
        data: { testid: "spectator-frame" },
      });
      this.view.prepend(this.frame);
      for (const part of [this.view, this.help, this.steer]) part.hidden = false;
      this._say();
    });
    if (this.frame) this._toggled(true);
  }

  /** @param {boolean} open */
  _toggled(open) {
    setText(this.toggle, open ? CLOSE : OPEN);
    this.toggle.setAttribute("aria-expanded", String(open));
    this._say();
  }

  _say() {
    const refused = !this.frame && Boolean(this.why);
    this.toggle.setAttribute("aria-disabled", String(refused));
    this.toggle.title = refused ? this.why : "";
    this.toggle.setAttribute("aria-description", refused ? this.why : "");
    this.sign.hidden = !this.frame || this.connected;
    setText(this.sign, this.why || "Loading the picture of the robot");
  }
}
