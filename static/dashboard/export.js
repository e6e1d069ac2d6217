// The archive of all data: made on request by a process of its own, with its progress, then downloaded.

import { h, setText } from "../common/dom.js";
import { problemText } from "../common/problem.js";

/** @import { ExportReply } from "../../tests/javascript/api.d.ts" */
/** @import { Toasts } from "../common/shell.js" */
/** @import { Api } from "./api.js" */

const EVERY_MS = 500;

export class Export {
  /** @param {{ api: Api, toasts: Toasts }} wiring */
  constructor({ api, toasts }) {
    this.api = api;
    this.toasts = toasts;
    this.waits = false;
    this.button = h(
      "button",
      { type: "button", class: "secondary", data: { testid: "download-export" } },
      "Download the data (zip)",
    );
    this.button.addEventListener("click", () => this._download());
    this.cancel = h(
      "button",
      { type: "button", class: "secondary small", data: { testid: "cancel-export" } },
      "Cancel the export",
    );
    this.cancel.addEventListener("click", () => this._cancel());
    this.bar = h("progress", { class: "report-bar", max: 1, value: 0, "aria-label": "How far the export is" });
    this.status = h("span", { class: "hint", role: "status", data: { testid: "export-status" } });
    this.progress = h("div", { class: "actions", hidden: true }, this.bar, this.status, this.cancel);
  }

  async _download() {
    if (this.waits) return;
    this.waits = true;
    this.button.disabled = true;
    try {
      await this.api.send("/api/export", {});
      const made = await this._made();
      if (made === null) return; // cancelled: whoever did it knows
      await this.api.download("/api/export/file");
    } catch (error) {
      this.toasts.show(`The data could not be downloaded: ${problemText(error)}`, { problem: true });
    } finally {
      this.waits = false;
      this.button.disabled = false;
      this.progress.hidden = true;
      setText(this.status, "");
    }
  }

  /** @returns {Promise<ExportReply | null>} */
  async _made() {
    for (;;) {
      /** @type {ExportReply} */
      const reply = await this.api.get("/api/export/progress");
      if (reply.state === "made") return reply;
      if (reply.state === "none") return null;
      if (reply.state === "cannot") throw new Error(reply.text);
      this.progress.hidden = false;
      this.bar.max = reply.of || 1;
      this.bar.value = Math.max(0, reply.step - 1);
      setText(this.status, reply.of ? `${reply.text} (step ${reply.step} of ${reply.of})` : reply.text);
      await new Promise((resolve) => setTimeout(resolve, EVERY_MS));
    }
  }

  async _cancel() {
    this.cancel.disabled = true;
    try {
      await this.api.remove("/api/export");
    } catch (error) {
      this.toasts.show(problemText(error), { problem: true });
    } finally {
      this.cancel.disabled = false;
    }
  }
}
