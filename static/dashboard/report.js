// The report of the data so far: made on request by a process of its own, its figures here, the whole page in a tab.

import { freshId, h, setText, whileBusy } from "../common/dom.js";
import { problemText } from "../common/problem.js";
import { labUrl } from "../common/root.js";
import { isRefused } from "./api.js";

/** @import { ReportReply } from "../../tests/javascript/api.d.ts" */
/** @import { Toasts } from "../common/shell.js" */
/** @import { Api } from "./api.js" */

const EVERY_MS = 1000;

export class Report {
  /** @param {{ api: Api, toasts: Toasts }} wiring */
  constructor({ api, toasts }) {
    this.api = api;
    this.toasts = toasts;
    this.drawn = "";
    this.timer = 0;
    this.running = false;
    this.busy = false;
    const titleId = freshId("report");
    this.make = h("button", { type: "button", class: "secondary", data: { testid: "make-report" } }, "Make the report");
    this.make.addEventListener("click", () => this._make());
    this.link = h(
      "a",
      {
        class: "button secondary",
        href: labUrl("/dashboard/report/"),
        target: "_blank",
        rel: "noopener",
        hidden: true,
        data: { testid: "open-report" },
      },
      "Open the report (new tab)",
    );
    this.status = h("p", { class: "hint", role: "status", data: { testid: "report-status" } });
    this.bar = h("progress", {
      class: "report-bar",
      max: 1,
      value: 0,
      hidden: true,
      "aria-label": "How far the report is",
    });
    this.figures = h("div", { class: "report-figures", data: { testid: "report-figures" } });
    this.element = h(
      "section",
      { "aria-labelledby": titleId },
      h("h3", { id: titleId }, "Report of the data so far"),
      h(
        "p",
        { class: "hint" },
        "The paper's measures, comparisons and figures, without pilots, demos and trials that were not completed. It takes some seconds and holds up no session; it is not kept when the lab ends.",
      ),
      h("div", { class: "actions" }, this.make, this.link),
      this.bar,
      this.status,
      this.figures,
    );
  }

  /** @returns {void} */
  start() {
    this.running = true;
    this.drawn = ""; // the browser may have given back what opens the report
    this._look();
  }

  /** @returns {void} */
  stop() {
    this.running = false;
    clearTimeout(this.timer);
  }

  async _make() {
    await whileBusy(this.make, "Starting", async () => {
      try {
        await this.api.send("/api/report", {});
      } catch (error) {
        this.toasts.show(problemText(error), { problem: true });
      }
      await this._look();
    });
  }

  async _look() {
    clearTimeout(this.timer);
    try {
      await this._draw(await this.api.get("/api/report"));
    } catch (error) {
      if (isRefused(error)) return; // the page asks for the token
      setText(this.status, `Not up to date: ${problemText(error)}`);
    }
    // Another experimenter may make one too.
    if (this.running) this.timer = setTimeout(() => this._look(), this.busy ? EVERY_MS : 10 * EVERY_MS);
  }

  /** @param {ReportReply} report */
  async _draw(report) {
    const text = JSON.stringify(report);
    if (text === this.drawn) return;
    this.busy = report.state === "making";
    const made = report.state === "made";
    if (made) await this.api.desk(); // before the pictures are asked for
    this.drawn = text;
    this.bar.hidden = !this.busy;
    this.bar.max = report.of || 1;
    this.bar.value = Math.max(0, report.step - 1);
    this.link.hidden = !made;
    setText(this.status, statusWords(report));
    const version = encodeURIComponent(report.made_utc ?? "");
    this.figures.replaceChildren(
      ...report.figures.map(({ name, title }) =>
        h(
          "figure",
          {},
          h(
            "a",
            {
              href: labUrl(`/dashboard/report/figures/${name}.svg`),
              target: "_blank",
              rel: "noopener",
              title: `${title}: open the drawing (new tab)`,
            },
            h("img", {
              src: labUrl(`/dashboard/report/figures/${name}.png?made=${version}`),
              alt: title,
              loading: "lazy",
            }),
          ),
          h("figcaption", {}, title),
        ),
      ),
    );
  }
}

/**
 * @param {ReportReply} report
 * @returns {string}
 */
function statusWords({ state, text, step, of, made_utc, trials, participants }) {
  if (state === "none") return "Not made yet.";
  if (state === "making") return of ? `${text} (step ${step} of ${of})` : text;
  if (state !== "made") return `Nothing to report yet. ${text}`;
  const at = new Date(made_utc ?? "").toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
  return `Made ${at} of ${trials} completed trials of ${participants} participants.`;
}
