// The report of the data so far: made on request by a process of its own, its figures here, the whole page in a tab.

import { freshId, h, setText, whileBusy } from "../common/dom.js";
import { labUrl } from "../common/root.js";

const EVERY_MS = 1000;

export class Report {
  constructor({ api, toasts }) {
    Object.assign(this, { api, toasts, drawn: "", timer: 0, running: false });
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

  start() {
    this.running = true;
    this.drawn = ""; // the browser may have given back what opens the report
    this._look();
  }

  stop() {
    this.running = false;
    clearTimeout(this.timer);
  }

  async _make() {
    await whileBusy(this.make, "Starting", async () => {
      try {
        await this.api.send("/api/report", {});
      } catch (error) {
        this.toasts.show(error.message, { problem: true });
      }
      await this._look();
    });
  }

  async _look() {
    clearTimeout(this.timer);
    try {
      await this._draw(await this.api.get("/api/report"));
    } catch (error) {
      if (error.status === 401 || error.status === 403) return; // the page asks for the token
      setText(this.status, `Not up to date: ${error.message}`);
    }
    // Another experimenter may make one too.
    if (this.running) this.timer = setTimeout(() => this._look(), this.busy ? EVERY_MS : 10 * EVERY_MS);
  }

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
    setText(
      this.status,
      {
        none: "Not made yet.",
        making: report.of ? `${report.text} (step ${report.step} of ${report.of})` : report.text,
        made: `Made ${new Date(report.made_utc).toLocaleString([], { dateStyle: "medium", timeStyle: "short" })} of ${report.trials} completed trials of ${report.participants} participants.`,
        cannot: `Nothing to report yet. ${report.text}`,
      }[report.state],
    );
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
              src: labUrl(`/dashboard/report/figures/${name}.png?made=${encodeURIComponent(report.made_utc)}`),
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
