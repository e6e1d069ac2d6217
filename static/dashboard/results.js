// What came of it: how many, questionnaire scores by condition, and the verdict over every trial, which can be overridden.

import { freshId, h, icon, setText } from "../common/dom.js";
import { problemText } from "../common/problem.js";
import { ask } from "../common/shell.js";
import { isRefused } from "./api.js";
import { Report } from "./report.js";

/** @import { QualityReply, SummaryReply, VerdictLine } from "../../tests/javascript/api.d.ts" */
/** @import { Toasts } from "../common/shell.js" */
/** @import { Api, Session } from "./api.js" */

const PAGE = 25;
const EVERY_MS = 10_000;
const SOON_MS = 2000; // after a trial or its questionnaires have begun or ended, at most this often
const SHOW = [
  ["all", "Every trial"],
  ["suspect", "Suspect ones"],
  ["good", "Good ones"],
];
const COLUMNS = [
  "Trial",
  "Condition",
  "Verdict",
  "Why",
  "Round trip",
  "Hidden",
  "Late ticks",
  "Focus lost",
  "Pad lost",
  "Unanswered",
  "Actions",
];

export class Results {
  /** @param {{ api: Api, toasts: Toasts }} wiring */
  constructor({ api, toasts }) {
    this.api = api;
    this.toasts = toasts;
    this.offset = 0;
    this.drawn = "";
    this.asked = 0;
    this.stand = "";
    this.timer = 0;
    this.soon = 0;
    const showId = freshId("show-trials");
    this.show = h(
      "select",
      { id: showId, data: { testid: "quality-show" } },
      SHOW.map(([value, label]) => h("option", { value }, label)),
    );
    this.show.addEventListener("input", () => this._turn(0));
    this.report = new Report({ api, toasts });
    this.counts = h("p", { class: "hint", data: { testid: "summary" } });
    this.scores = h("tbody", {});
    this.noScores = h("p", { class: "hint" }, "No complete questionnaire yet.");
    this.scoreTable = h(
      "table",
      { class: "sessions", data: { testid: "scores" } },
      h("caption", { class: "visually-hidden" }, "Mean questionnaire scores by condition"),
      head(["Questionnaire", "Condition", "Mean score", "n (trials)"]),
      this.scores,
    );
    this.problem = h("p", { class: "field-error", role: "alert", hidden: true });
    this.verdicts = h("p", { class: "hint", data: { testid: "verdicts" } });
    this.body = h("tbody", {});
    this.range = h("span", { role: "status" });
    this.newer = h("button", { type: "button", class: "secondary small" }, "Newer");
    this.older = h("button", { type: "button", class: "secondary small" }, "Older");
    this.newer.addEventListener("click", () => this._turn(this.offset - PAGE));
    this.older.addEventListener("click", () => this._turn(this.offset + PAGE));
    this.element = h(
      "section",
      { class: "board-card", "aria-labelledby": "results-title", data: { testid: "results" } },
      h("h2", { id: "results-title" }, "Data and quality"),
      this.problem,
      this.counts,
      this.noScores,
      h("div", { class: "table-scroll" }, this.scoreTable),
      this.report.element,
      h("h3", {}, "Verdict over each trial"),
      h(
        "p",
        { class: "hint" },
        "By the rules under [quality] in the study file. A suspect trial stays in the data, marked.",
      ),
      this.verdicts,
      h("div", { class: "create" }, h("div", { class: "field" }, h("label", { for: showId }, "Show"), this.show)),
      h(
        "div",
        { class: "table-scroll", tabindex: "0", role: "region", "aria-label": "Verdicts" },
        h(
          "table",
          { class: "sessions", data: { testid: "quality-table" } },
          h("caption", { class: "visually-hidden" }, "Trials that have ended, newest participant first"),
          head(COLUMNS),
          this.body,
        ),
      ),
      h("div", { class: "actions" }, this.newer, this.older, this.range),
    );
  }

  /** @returns {void} */
  start() {
    this.stop();
    this.report.start();
    this.refresh();
    this.timer = setInterval(() => document.hidden || this.refresh(), EVERY_MS);
  }

  /** @returns {void} */
  stop() {
    this.report.stop();
    clearInterval(this.timer);
    clearTimeout(this.soon);
    this.soon = 0;
  }

  /**
   * Looks again soon when somebody has come to or left a trial or its questionnaires.
   *
   * @param {Session[]} sessions
   * @returns {void}
   */
  follow(sessions) {
    const counted = (/** @type {string} */ place) => (place === "trial" || place === "survey" ? place : "");
    const stand = sessions.map(({ participant, trial, place }) => `${participant} ${trial} ${counted(place)}`).join();
    if (stand === this.stand) return;
    this.stand = stand;
    this.soon ||= setTimeout(() => {
      this.soon = 0;
      if (!document.hidden) this.refresh();
    }, SOON_MS);
  }

  /** @returns {Promise<void>} */
  async refresh() {
    this.asked += 1;
    const asked = this.asked;
    const query = new URLSearchParams({ offset: `${this.offset}`, limit: `${PAGE}`, show: this.show.value });
    try {
      const [summary, quality] = await Promise.all([
        /** @type {Promise<SummaryReply>} */ (this.api.get("/api/summary")),
        /** @type {Promise<QualityReply>} */ (this.api.get(`/api/quality?${query}`)),
      ]);
      if (asked !== this.asked) return;
      this.problem.hidden = true;
      this._draw(summary, quality);
    } catch (error) {
      if (isRefused(error)) return; // the page asks for the token
      this.problem.hidden = false;
      setText(this.problem, `Not up to date: ${problemText(error)}`);
    }
  }

  /** @param {number} offset */
  _turn(offset) {
    this.offset = Math.max(0, offset);
    this.refresh();
  }

  /**
   * @param {SummaryReply} summary
   * @param {QualityReply} quality
   */
  _draw(summary, quality) {
    const text = JSON.stringify([summary, quality]);
    if (text === this.drawn) return; // the same elements stay, and with them focus
    this.drawn = text;
    const focused = this.body.contains(document.activeElement)
      ? document.activeElement?.closest("tr")?.dataset.trial
      : undefined;
    const { trials, alerts } = summary;
    setText(
      this.counts,
      `Trials: ${trials.completed} completed, ${trials.aborted} aborted, ${trials.running} running · Second task: ${alerts.answered} answered, ${alerts.expired} unanswered (without pilots and demos)`,
    );
    this.noScores.hidden = summary.scores.length > 0;
    this.scoreTable.hidden = summary.scores.length === 0;
    this.scores.replaceChildren(
      ...summary.scores.map((line) =>
        h(
          "tr",
          {},
          h("th", { scope: "row" }, line.instrument),
          h("td", {}, line.condition),
          h("td", {}, line.mean.toFixed(2)),
          h("td", {}, String(line.n)),
        ),
      ),
    );
    setText(this.verdicts, `${quality.good} good, ${quality.suspect} suspect`);
    this.body.replaceChildren(...quality.lines.map((line) => this._line(line)));
    const last = quality.offset + quality.lines.length;
    setText(
      this.range,
      quality.total === 0 ? "No trial has ended yet" : `${quality.offset + 1}–${last} of ${quality.total}`,
    );
    this.newer.disabled = quality.offset === 0;
    this.older.disabled = last >= quality.total;
    if (focused !== undefined) {
      const selector = `tr[data-trial="${CSS.escape(focused)}"] button`;
      /** @type {HTMLButtonElement | null} */ (this.body.querySelector(selector))?.focus();
    }
  }

  /**
   * @param {VerdictLine} line
   * @returns {HTMLTableRowElement}
   */
  _line(line) {
    const counts = line.override ?? line.quality;
    const why = line.override
      ? `Overridden: ${line.reason} (automatic: ${line.quality})`
      : line.broken.join("; ") || "–";
    const button = h(
      "button",
      {
        type: "button",
        class: "secondary small",
        "aria-label": `Override the verdict over trial ${line.trial} of ${line.participant}`,
        data: { testid: "override" },
      },
      "Override",
    );
    button.addEventListener("click", () => this._override(line, counts === "good" ? "suspect" : "good"));
    return h(
      "tr",
      { data: { trial: `${line.participant} ${line.trial}`, testid: "quality-row" } },
      h(
        "th",
        { scope: "row" },
        `${line.participant}, trial ${line.trial}`,
        line.outcome === "aborted" ? h("span", { class: "badge" }, "aborted") : null,
      ),
      h("td", {}, line.condition),
      h(
        "td",
        {},
        h(
          "span",
          { class: "mark-line", data: { level: counts === "good" ? "good" : "bad" } },
          icon(counts === "good" ? "check" : "warning"),
          counts,
        ),
      ),
      h("td", {}, why),
      [
        unit(line.round_trip_ms, " ms"),
        unit(line.hidden_s, " s"),
        line.missed_ticks,
        line.focus_losses,
        line.pad_losses,
        line.unanswered_alerts,
      ].map((value) => h("td", {}, String(value ?? "–"))),
      h("td", {}, h("div", { class: "buttons" }, button)),
    );
  }

  /**
   * @param {VerdictLine} line
   * @param {"good" | "suspect"} verdict
   */
  async _override(line, verdict) {
    const reason = await ask({
      testid: "override-dialog",
      title: `Count trial ${line.trial} of ${line.participant} as ${verdict}?`,
      confirm: `Count it as ${verdict}`,
      text: [`The automatic verdict (${line.quality}) stays in the data beside yours.`],
      field: { label: "Reason (exported with the trial: write no names)", required: true, missing: "Give a reason." },
    });
    if (reason === null) return;
    try {
      await this.api.send(`/api/quality/${encodeURIComponent(line.participant)}/${line.trial}`, { verdict, reason });
      this.toasts.show(`Trial ${line.trial} of ${line.participant} counts as ${verdict}.`);
    } catch (error) {
      this.toasts.show(problemText(error), { problem: true });
    }
    await this.refresh();
  }
}

/** @type {(value: number | null, name: string) => string} */
const unit = (value, name) => (value === null ? "–" : `${Math.round(value * 10) / 10}${name}`);
/** @type {(names: string[]) => HTMLElement} */
const head = (names) =>
  h(
    "thead",
    {},
    h(
      "tr",
      {},
      names.map((name) => h("th", { scope: "col" }, name)),
    ),
  );
