// What came of it: how many, questionnaire scores by condition, and the verdict over every trial, which can be overridden.

import { freshId, h, icon, setText } from "../common/dom.js";
import { ask } from "../common/shell.js";
import { Report } from "./report.js";

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
  constructor({ api, toasts }) {
    Object.assign(this, { api, toasts, offset: 0, drawn: "" });
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

  start() {
    this.stop();
    this.report.start();
    this.refresh();
    this.timer = setInterval(() => document.hidden || this.refresh(), EVERY_MS);
  }

  stop() {
    this.report.stop();
    clearInterval(this.timer);
    clearTimeout(this.soon);
    this.soon = 0;
  }

  /** Looks again soon when somebody has come to or left a trial or its questionnaires. */
  follow(sessions) {
    const counted = (place) => (place === "trial" || place === "survey" ? place : "");
    const stand = sessions.map(({ participant, trial, place }) => `${participant} ${trial} ${counted(place)}`).join();
    if (stand === this.stand) return;
    this.stand = stand;
    this.soon ||= setTimeout(() => {
      this.soon = 0;
      if (!document.hidden) this.refresh();
    }, SOON_MS);
  }

  async refresh() {
    const asked = (this.asked = (this.asked ?? 0) + 1);
    const query = new URLSearchParams({ offset: this.offset, limit: PAGE, show: this.show.value });
    try {
      const [summary, quality] = await Promise.all([
        this.api.get("/api/summary"),
        this.api.get(`/api/quality?${query}`),
      ]);
      if (asked !== this.asked) return;
      this.problem.hidden = true;
      this._draw(summary, quality);
    } catch (error) {
      if (error.status === 401 || error.status === 403) return; // the page asks for the token
      this.problem.hidden = false;
      setText(this.problem, `Not up to date: ${error.message}`);
    }
  }

  _turn(offset) {
    this.offset = Math.max(0, offset);
    this.refresh();
  }

  _draw(summary, quality) {
    const text = JSON.stringify([summary, quality]);
    if (text === this.drawn) return; // the same elements stay, and with them focus
    this.drawn = text;
    const focused = this.body.contains(document.activeElement)
      ? document.activeElement.closest("tr").dataset.trial
      : null;
    const { trials, alerts } = summary;
    setText(
      this.counts,
      `Trials: ${trials.completed} completed, ${trials.aborted} aborted, ${trials.running} running · Readings: ${alerts.answered} answered, ${alerts.expired} unanswered (without pilots and demos)`,
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
    if (focused) this.body.querySelector(`tr[data-trial="${CSS.escape(focused)}"] button`)?.focus();
  }

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
      this.toasts.show(error.message, { problem: true });
    }
    await this.refresh();
  }
}

const unit = (value, name) => (value === null ? "–" : `${Math.round(value * 10) / 10}${name}`);
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
