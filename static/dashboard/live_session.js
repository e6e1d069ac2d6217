// One session, opened: what the robot believes and why it moves, what happened, and what the experimenter can do.

import { freshId, h, setText } from "../common/dom.js";
import { problemText } from "../common/problem.js";
import { ask } from "../common/shell.js";
import { COMMANDS, reasoned, say } from "./commands.js";
import { eventLine } from "./event_line.js";
import { BeliefBars, LineChart } from "./live_charts.js";
import { PlaneView } from "./live_plane.js";
import { Spectator } from "./live_spectator.js";
import { REMARKS } from "./remarks.js";
import { nameOf, taskWords } from "./sessions_table.js";

/** @import { LiveReply, TickExplanation } from "../../tests/javascript/api.d.ts" */
/** @import { Child } from "../common/dom.js" */
/** @import { Toasts } from "../common/shell.js" */
/** @import { Api, SessionEvent } from "./api.js" */
/** @import { Command } from "./commands.js" */
/** @import { Watched } from "./live_feed.js" */
/** @import { Remark } from "./remarks.js" */
/** @typedef {{ element: HTMLButtonElement, label: string, name: string }} Act */

const KEPT_TICKS = 120;
/** What the chart beside the belief shows already. */
const CHARTED = new Set(["information", "reward_m", "weighted_information", "weighted_reward", "score"]);
const KEPT_EVENTS = 50;
/** @type {Record<string, string>} */
const SOURCES = {
  user: "the participant",
  blend: "the participant and the robot",
  robot: "the robot",
  idle: "nobody: the robot waits",
  gripper: "nobody: the fingers move",
  reset: "nobody: the arm goes back",
  free: "nobody: the arm was freed and goes back",
};
/**
 * Who moves the arm, and how far from what the participant asks where that is not the same.
 *
 * @param {{ source: string, departure: number | null }} tick
 * @returns {string}
 */
const mover = ({ source, departure }) =>
  (SOURCES[source] ?? source) + (departure ? `: ${departure.toFixed(2)} of 2 away from what is asked` : "");
/** @type {[positive: string, negative: string][]} */
const AXES = [
  ["forward", "back"],
  ["left", "right"],
  ["up", "down"],
];
export class SessionPage {
  /**
   * @param {object} wiring
   * @param {string} wiring.participant
   * @param {Api} wiring.api
   * @param {Toasts} wiring.toasts
   * @param {(participant: string, command: Command) => void} wiring.onAct asks and does one of COMMANDS
   */
  constructor({ participant, api, toasts, onAct }) {
    this.participant = participant;
    this.api = api;
    this.toasts = toasts;
    /** @type {TickExplanation[]} */
    this.ticks = [];
    /** @type {SessionEvent[]} */
    this.events = [];
    /** @type {LiveReply | null} */
    this.session = null;
    this.title = h("h1", { tabindex: "-1" }, participant);
    this.state = h("p", { class: "live-state", role: "status", data: { testid: "live-state" } }, "Waiting for the lab");
    this.instruction = h("p", { class: "live-instruction", data: { testid: "live-instruction" } });
    this.commands = COMMANDS.map((command) =>
      this._button(command.label, command.name, () => onAct(participant, command), command.danger),
    );
    this.remarks = REMARKS.map((remark) => this._button(remark.label, remark.kind, () => this._remark(remark)));
    this.why = h("ul", { class: "why hint" });
    this.whyTitle = h("summary", {}, "");
    this.whyBox = h("details", { class: "hint", hidden: true, data: { testid: "why-not" } }, this.whyTitle, this.why);
    this.bars = new BeliefBars();
    this.entropy = new LineChart({
      title: "Entropy of the belief, last 60 s",
      series: [{ key: "entropy", label: "Entropy" }],
      low: 0,
      high: 1,
      marks: [0.7, 0.3],
      testid: "chart-entropy",
    });
    this.scores = new LineChart({
      title: "Score of the chosen action, last 60 s",
      digits: 3,
      testid: "chart-scores",
      series: [
        { key: "score", label: "Score" },
        { key: "information", label: "Information part", dash: "7 4" },
        { key: "goal", label: "Goal part", dash: "2 3" },
      ],
    });
    this.plane = new PlaneView({ load: (kind) => api.heatmap(participant, kind) });
    this.spectator = new Spectator({ api, participant, toasts });
    this.facts = h("dl", { class: "facts", data: { testid: "facts" } });
    this.list = h("ol", {
      class: "event-list",
      tabindex: "0",
      "aria-label": "Last events, newest first",
      data: { testid: "events" },
    });
    this.element = h(
      "div",
      { class: "board live", data: { testid: "page-session" } },
      h(
        "section",
        { class: "board-card" },
        h("p", {}, h("a", { href: "#", data: { testid: "back" } }, "← All sessions")),
        this.title,
        this.state,
        this.instruction,
        h(
          "div",
          { class: "act-groups" },
          group("Session", this.commands),
          group("Participant and record", this.remarks),
        ),
        this.whyBox,
      ),
      h(
        "div",
        { class: "live-columns" },
        h(
          "div",
          { class: "live-side" },
          this.spectator.element,
          card("What the robot believes", this.bars.element, this.entropy.element, this.scores.element),
        ),
        h("div", { class: "live-side" }, card("Now", this.facts), card("Last events", this.list)),
      ),
      this.plane.element,
    );
  }

  /**
   * Another page takes the place of this one.
   *
   * @returns {void}
   */
  close() {
    this.spectator.end();
  }

  /**
   * The session's line from the overview.
   *
   * @param {LiveReply} session
   * @param {string} stateText
   * @returns {void}
   */
  showSession(session, stateText) {
    this.session = session;
    setText(this.title, nameOf(session));
    const condition = session.condition.replaceAll("_", " ");
    const task = session.tasks ? ` · task ${taskWords(session.done_tasks, session.tasks)}` : "";
    const help = session.help_wanted ? ` · asks for help${session.help?.words ? `: “${session.help.words}”` : ""}` : "";
    const where = `${stateText} · trial ${session.trial} of ${session.trials}, condition ${condition}${task}${help}`;
    setText(this.state, session.problem ? `${stateText}: ${session.problem}` : where);
    setText(this.instruction, session.instruction ? `Instruction: ${session.instruction}` : "");
    const reasons = [];
    for (const { element, label, name } of [...this.commands, ...this.remarks]) {
      const why = session.why_not[name] ?? "";
      say(element, why);
      if (why) reasons.push(`${label}: ${why}`);
    }
    if (this.why.dataset.text !== reasons.join()) {
      this.why.dataset.text = reasons.join();
      this.whyBox.hidden = reasons.length === 0;
      setText(this.whyTitle, `Why ${reasons.length === 1 ? "one button" : `${reasons.length} buttons`} cannot act now`);
      this.why.replaceChildren(...reasons.map((reason) => h("li", {}, reason)));
    }
    this.spectator.show(session.scene);
    this._facts();
  }

  /**
   * News from the feed.
   *
   * @param {Watched} news
   * @returns {void}
   */
  hear({ since_start, ticks, events, problem }) {
    if (problem) setText(this.state, `Cannot be shown: ${problem}`);
    if (since_start) {
      this.ticks = [];
      this.events = [];
    }
    for (const tick of ticks) {
      const last = this.ticks.at(-1);
      if (last && (last.phase !== tick.phase || last.trial !== tick.trial || last.tick >= tick.tick)) this.ticks = [];
      this.ticks.push(tick);
    }
    this.ticks.splice(0, this.ticks.length - KEPT_TICKS);
    this.events.push(...events);
    this.events.splice(0, this.events.length - KEPT_EVENTS);
    if (ticks.length || since_start) this._thoughts();
    if (events.length || since_start) this.list.replaceChildren(...[...this.events].reverse().map(eventLine));
  }

  _thoughts() {
    const tick = this.ticks.at(-1);
    this.bars.show(tick?.goals ?? []);
    this.entropy.show(this.ticks.map((one) => ({ s: one.trial_s, entropy: one.entropy })));
    this.scores.show(
      this.ticks.map((one) => ({
        s: one.trial_s,
        score: numeric(one.explanation.score),
        information: numeric(one.explanation.weighted_information),
        goal: numeric(one.explanation.weighted_reward),
      })),
    );
    this._facts();
    if (tick) this.plane.refresh();
  }

  _facts() {
    const tick = this.ticks.at(-1);
    const session = this.session;
    const focus = session?.focused ? "has the focus" : "does not have the focus";
    const rows = [
      ["Moves now", tick ? mover(tick) : "–"],
      ["Action", words(tick?.action)],
      ...toldByArbiter(tick),
      ["Blocked", tick?.blocked ? (tick.blocked_reason ?? "yes") : tick ? "no" : "–"],
      [
        "Gripper",
        tick
          ? `${tick.gripper}${tick.held ? `, holds ${tick.held.replaceAll("_", " ")}` : ""} at ${tick.position_m.map((value) => value.toFixed(2)).join(", ")} m`
          : "–",
      ],
      ["Trial time", told(session?.trial_s, (seconds) => `${seconds.toFixed(1)} s`)],
      ["Driven in the last 10 s", told(session?.driving_share, (share) => `${Math.round(100 * share)} % of ticks`)],
      ["Signals from the page", session ? `${session.signals_per_s.toFixed(1)} a second` : "–"],
      ["Round trip", told(session?.round_trip_ms, (ms) => `${Math.round(ms)} ms`)],
      ["Late ticks", session ? String(session.overruns) : "–"],
      ["Arm freed", session ? `${session.frees} times` : "–"],
      ["Device", session?.device ?? "–"],
      ["Page", told(session?.visible, (visible) => `${visible ? "visible" : "hidden"}, ${focus}`)],
      ["Sound", told(session?.sound, (sound) => (sound ? "heard" : "not heard"), "not tested yet")],
    ];
    const text = JSON.stringify(rows);
    if (this.facts.dataset.text === text) return;
    this.facts.dataset.text = text;
    this.facts.replaceChildren(...rows.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
  }

  /**
   * @param {string} label
   * @param {string} name
   * @param {() => void} run
   * @param {boolean} [danger]
   * @returns {Act}
   */
  _button(label, name, run, danger = false) {
    const element = h(
      "button",
      { type: "button", class: danger ? "secondary small stop" : "secondary small", data: { testid: name } },
      label,
    );
    reasoned(element, () => this.session?.why_not[name] ?? "The lab has not told anything yet.", this.toasts, run);
    return { element, label, name };
  }

  /** @param {Remark} remark */
  async _remark({ kind, path, done, saying }) {
    let body = {};
    if (saying) {
      const text = await ask({
        title: saying.title,
        text: [saying.text],
        field: { label: saying.field, required: true, missing: "Please write something." },
        confirm: saying.confirm,
        testid: `${kind}-dialog`,
      });
      if (text === null) return;
      body = { text };
    }
    try {
      await this.api.say(this.participant, path, body);
      this.toasts.show(`${this.participant}: ${done}`);
    } catch (error) {
      this.toasts.show(`${this.participant}: ${problemText(error)}`, { problem: true });
    }
  }
}

/**
 * @param {number | string | undefined} value
 * @returns {number | undefined}
 */
function numeric(value) {
  return typeof value === "number" ? value : undefined;
}

/**
 * What an arbiter says of its last action beside what is charted, in its own names.
 *
 * @param {TickExplanation | undefined} tick
 * @returns {[name: string, value: string][]}
 */
function toldByArbiter(tick) {
  return Object.entries(tick?.explanation ?? {})
    .filter(([name]) => !CHARTED.has(name))
    .map(([name, value]) => [
      `Arbiter: ${name.replaceAll("_", " ")}`,
      typeof value === "number" ? String(Math.round(value * 1000) / 1000) : value,
    ]);
}

/**
 * @param {string} title
 * @param {...Child} children
 * @returns {HTMLElement}
 */
function card(title, ...children) {
  const id = freshId("card");
  return h("section", { class: "board-card", "aria-labelledby": id }, h("h2", { id }, title), children);
}

/**
 * @param {string} name
 * @param {Act[]} acts
 * @returns {HTMLElement}
 */
function group(name, acts) {
  return h(
    "div",
    { class: "act-group buttons", role: "group", "aria-label": name },
    acts.map((one) => one.element),
  );
}

/**
 * @param {TickExplanation["action"] | undefined} action
 * @returns {string}
 */
function words(action) {
  if (!action) return "–";
  const parts = AXES.flatMap(([positive, negative], axis) => {
    const value = action[axis] ?? 0;
    return value === 0 ? [] : [value > 0 ? positive : negative];
  });
  return parts.length ? parts.join(" and ") : "stay";
}

/**
 * What the lab told, in words; something else when it told nothing.
 *
 * @template Value
 * @param {Value | null | undefined} value
 * @param {(value: Value) => string} inWords
 * @param {string} [nothing]
 * @returns {string}
 */
function told(value, inWords, nothing = "–") {
  return value === null || value === undefined ? nothing : inWords(value);
}
