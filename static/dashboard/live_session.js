// One session, opened: what the robot believes and why it moves, what happened, and what the experimenter can do.

import { freshId, h, icon, setText } from "../common/dom.js";
import { ask } from "../common/shell.js";
import { COMMANDS, reasoned, say } from "./commands.js";
import { BeliefBars, LineChart } from "./live_charts.js";
import { PlaneView } from "./live_plane.js";
import { Spectator } from "./live_spectator.js";

const KEPT_TICKS = 120;
const KEPT_EVENTS = 50;
const SOURCES = {
  user: "the participant",
  robot: "the robot",
  idle: "nobody: the robot waits",
  gripper: "nobody: the fingers move",
  reset: "nobody: the arm goes back",
};
const AXES = [
  ["forward", "back"],
  ["left", "right"],
  ["up", "down"],
];
const REMARKS = [
  {
    kind: "message",
    path: "message",
    label: "Send message",
    title: "Message to the participant",
    text: "It is shown on the participant's page until they put it away.",
    field: "Message",
    confirm: "Send",
    done: "The message is on the participant's page.",
  },
  {
    kind: "task_marked",
    path: "mark",
    label: "Mark this task",
    title: "Mark the task under way",
    text: "The mark is kept in the record with the task and the tick.",
    field: "What is special about it (kept in the lab, never exported)",
    confirm: "Mark",
    done: "The task is marked.",
  },
  {
    kind: "note",
    path: "note",
    label: "Write note",
    title: "Note for the record",
    text: "Notes are kept in the lab beside the session's events. An export says that there is one, not what it says.",
    field: "Note",
    confirm: "Keep note",
    done: "The note is kept.",
  },
  { kind: "help_seen", path: "help_seen", label: "Help is given", done: "The call for help is answered." },
];

export class SessionPage {
  /** `onAct(participant, command)` asks and does one of COMMANDS. */
  constructor({ participant, api, toasts, onAct }) {
    this.participant = participant;
    this.api = api;
    this.toasts = toasts;
    this.ticks = [];
    this.events = [];
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

  /** Another page takes the place of this one. */
  close() {
    this.spectator.end();
  }

  /** The session's line from the overview. */
  showSession(session, stateWords) {
    this.session = session;
    setText(
      this.title,
      [session.participant, session.demo ? "(demo)" : "", session.label ? `· ${session.label}` : ""]
        .filter(Boolean)
        .join(" "),
    );
    const task = session.tasks ? ` · task ${Math.min(session.done_tasks + 1, session.tasks)} of ${session.tasks}` : "";
    setText(
      this.state,
      `${stateWords} · trial ${session.trial} of ${session.trials}, condition ${session.condition.replaceAll("_", " ")}${task}${session.help_wanted ? " · asks for help" : ""}`,
    );
    setText(this.instruction, session.instruction ? `Instruction: ${session.instruction}` : "");
    const reasons = [];
    for (const { element, label, name } of [...this.commands, ...this.remarks]) {
      const why = session.why_not?.[name] ?? "";
      say(element, why);
      if (why) reasons.push(`${label}: ${why}`);
    }
    if (this.why.dataset.text !== reasons.join()) {
      this.why.dataset.text = reasons.join();
      this.whyBox.hidden = reasons.length === 0;
      setText(this.whyTitle, `Why ${reasons.length === 1 ? "one button" : `${reasons.length} buttons`} cannot act now`);
      this.why.replaceChildren(...reasons.map((reason) => h("li", {}, reason)));
    }
    this.spectator.show(session.scene ?? "");
    this._facts();
  }

  /** News from the feed. */
  hear({ since_start, ticks, events }) {
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
        score: one.scores?.score,
        information: one.scores?.weighted_information,
        goal: one.scores?.weighted_reward,
      })),
    );
    this._facts();
    if (tick) this.plane.refresh();
  }

  _facts() {
    const tick = this.ticks.at(-1);
    const session = this.session;
    const rows = [
      ["Moves now", tick ? (SOURCES[tick.source] ?? tick.source) : "–"],
      ["Action", words(tick?.action)],
      ["Blocked", tick?.blocked ? (tick.blocked_reason ?? "yes") : tick ? "no" : "–"],
      [
        "Gripper",
        tick
          ? `${tick.gripper}${tick.held ? `, holds ${tick.held.replaceAll("_", " ")}` : ""} at ${tick.position_m.map((value) => value.toFixed(2)).join(", ")} m`
          : "–",
      ],
      ["Trial time", Number.isFinite(session?.trial_s) ? `${session.trial_s.toFixed(1)} s` : "–"],
      [
        "Driven in the last 10 s",
        Number.isFinite(session?.driving_share) ? `${Math.round(100 * session.driving_share)} % of ticks` : "–",
      ],
      ["Signals from the page", session ? `${session.signals_per_s.toFixed(1)} a second` : "–"],
      ["Round trip", Number.isFinite(session?.round_trip_ms) ? `${Math.round(session.round_trip_ms)} ms` : "–"],
      ["Late ticks", session ? String(session.overruns) : "–"],
      ["Device", session?.device ?? "–"],
      [
        "Page",
        session?.visible === null || session?.visible === undefined
          ? "–"
          : `${session.visible ? "visible" : "hidden"}, ${session.focused ? "has the focus" : "does not have the focus"}`,
      ],
      [
        "Sound",
        session?.sound === null || session?.sound === undefined
          ? "not tested yet"
          : session.sound
            ? "heard"
            : "not heard",
      ],
    ];
    const text = JSON.stringify(rows);
    if (this.facts.dataset.text === text) return;
    this.facts.dataset.text = text;
    this.facts.replaceChildren(...rows.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
  }

  _button(label, name, run, danger = false) {
    const element = h(
      "button",
      { type: "button", class: danger ? "secondary small stop" : "secondary small", data: { testid: name } },
      label,
    );
    reasoned(element, () => this.session?.why_not?.[name] ?? "The lab has not told anything yet.", this.toasts, run);
    return { element, label, name };
  }

  async _remark(action) {
    let body = {};
    if (action.field) {
      const text = await ask({
        title: action.title,
        text: [action.text],
        field: { label: action.field, required: true, missing: "Please write something." },
        confirm: action.confirm,
        testid: `${action.kind}-dialog`,
      });
      if (text === null) return;
      body = { text };
    }
    try {
      await this.api.say(this.participant, action.path, body);
      this.toasts.show(`${this.participant}: ${action.done}`);
    } catch (error) {
      this.toasts.show(`${this.participant}: ${error.message}`, { problem: true });
    }
  }
}

function card(title, ...children) {
  const id = freshId("card");
  return h("section", { class: "board-card", "aria-labelledby": id }, h("h2", { id }, title), children);
}

function group(name, acts) {
  return h(
    "div",
    { class: "act-group buttons", role: "group", "aria-label": name },
    acts.map((one) => one.element),
  );
}

function words(action) {
  if (!action) return "–";
  const parts = action.map((value, axis) => (value === 0 ? null : AXES[axis][value > 0 ? 0 : 1])).filter(Boolean);
  return parts.length ? parts.join(" and ") : "stay";
}

function shown(value) {
  if (typeof value === "number") return String(Math.round(value * 100) / 100);
  return typeof value === "object" ? JSON.stringify(value) : value;
}

function eventLine({ utc, kind, source, data, tick }) {
  const { by, text, ...rest } = data;
  const details = Object.entries(rest)
    .filter(([, value]) => value !== null && value !== "")
    .map(([name, value]) => `${name}: ${shown(value)}`)
    .join(", ");
  const at = new Date(utc).toLocaleTimeString([], { hour12: false });
  const who = by && by !== source ? `${source} ${by}` : source;
  return h(
    "li",
    {},
    h("span", { class: "event-at" }, at),
    h(
      "span",
      {},
      h("strong", {}, kind.replaceAll("_", " ")),
      ` by ${who}${tick === null ? "" : `, tick ${tick}`}`,
      text ? h("span", { class: "event-words" }, `“${text}”`) : null,
      details ? h("span", { class: "event-details" }, details) : null,
    ),
    text ? icon("info") : null,
  );
}
