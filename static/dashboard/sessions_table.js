// The table of sessions. Rows stay the same elements while they are updated, so that focus and pressed buttons survive.

import { h, icon, setText } from "../common/dom.js";
import { COMMANDS, reasoned, say } from "./commands.js";

/** @import { IconName } from "../common/dom.js" */
/** @import { Toasts } from "../common/shell.js" */
/** @import { Session } from "./api.js" */
/** @import { Command } from "./commands.js" */
/** @typedef {"" | "good" | "warn" | "bad"} Level */

/** @type {Record<string, string>} */
const STATES = {
  created: "Not opened yet",
  consent: "Consent",
  demographics: "Demographics",
  setup: "Set-up",
  instructions: "Instructions",
  practice_ready: "Before practice",
  practice: "Practice",
  trial_ready: "Before the trial",
  trial: "In a trial",
  survey: "Survey",
  break: "Break",
  debrief: "Debrief",
  done: "Complete",
  paused: "Paused",
  withdrawn: "Withdrawn",
  aborted: "Aborted",
  eligibility: "Device check",
  screened_out: "Screened out",
  lapsed: "Place lapsed",
  unreadable: "Cannot be shown",
};
/** @type {Record<string, [sign: IconName, level: Level]>} */
const LEVELS = {
  trial: ["play", "good"],
  practice: ["play", "good"],
  paused: ["pause", "warn"],
  done: ["check", "good"],
  withdrawn: ["hand", "warn"],
  aborted: ["warning", "bad"],
  screened_out: ["hand", "warn"],
  lapsed: ["hourglass", ""],
  unreadable: ["warning", "bad"],
};
/** @type {Record<string, string>} */
const CAUSES = {
  connection: "connection lost",
  experimenter: "by the experimenter",
  fault: "something of the lab failed",
  picture: "no picture of the robot on their screen",
};
const OVER = new Set(["done", "withdrawn", "aborted", "screened_out", "lapsed"]);
const WITHOUT_TRIAL = new Set(["eligibility", "consent", "demographics", "setup", "instructions", "debrief", ...OVER]);
WITHOUT_TRIAL.add("unreadable");
const BUTTONS = COMMANDS.filter(({ name }) => ["pause", "resume", "abort"].includes(name)); // the others are on the page of the session
/** @type {Record<string, string>} */
const SHORT = { abort: "Abort" };
const MANY = 30; // above so many, only those under way are shown unless everybody is asked for
const COLUMNS = ["Participant", "State", "Trial", "Task", "Connection", "Remarks", "Actions"];

/**
 * A state of the study in words.
 *
 * @param {string} state
 * @returns {string}
 */
export function stateWords(state) {
  return STATES[state] ?? state.charAt(0).toUpperCase() + state.slice(1).replaceAll("_", " ");
}

/**
 * @param {Session} session
 * @returns {[sign: IconName, text: string, level: Level]}
 */
function connectionOf(session) {
  if (session.problem) return ["warning", "–", ""];
  if (OVER.has(session.state)) return ["check", "–", ""];
  if (session.connected && session.not_saving) return ["warning", "Cannot be saved: robot holds", "bad"];
  if (session.connected && session.held) return ["warning", "No heartbeat: robot holds", "bad"];
  if (session.connected && session.picture === false) return ["warning", "Their browser shows no robot", "bad"];
  if (session.connected && session.panel_missing) return ["warning", "Their second device is not connected", "bad"];
  const trip = session.round_trip_ms !== null ? ` · ${Math.round(session.round_trip_ms)} ms` : "";
  if (session.connected) return ["check", `Connected${trip}`, "good"];
  return ["lost", "Not connected", session.state === "consent" || session.state === "eligibility" ? "" : "bad"];
}

/**
 * @param {Session} session
 * @returns {string}
 */
function remarks(session) {
  if (session.problem) return session.problem;
  const list = [];
  if (session.causes.length)
    list.push(
      `Paused: ${session.causes.map((cause) => CAUSES[cause] ?? cause).join(" and ")}${
        session.causes.includes("fault") && session.pause_reason ? ` (${session.pause_reason})` : ""
      }`,
    );
  if (session.not_saving) list.push(session.not_saving.replace(/\.$/, ""));
  if (session.robot_problem) list.push(`robot: ${session.robot_problem}`);
  if (session.overruns > 0) list.push(`${session.overruns} late ${session.overruns === 1 ? "tick" : "ticks"}`);
  if (session.frees > 0) list.push(`arm freed ${session.frees === 1 ? "once" : `${session.frees} times`}`);
  if (session.connected && session.visible === false) list.push("page hidden");
  else if (session.connected && session.focused === false) list.push("page without focus");
  if (session.sound === false) list.push("sound not heard");
  const { signals_per_s = 0 } = session;
  if (signals_per_s > 0) list.push(`${signals_per_s.toFixed(1)} signals/s`);
  if (session.device && session.device !== "none") list.push(session.device);
  if (session.pace === "lockstep") list.push("lockstep");
  return list.join("; ") || "–";
}

export class Rows {
  /** @param {{ toasts: Toasts, onAct: (participant: string, command: Command) => void }} wiring */
  constructor({ toasts, onAct }) {
    this.toasts = toasts;
    this.onAct = onAct; // a button that can act was pressed
    /** @type {Map<string, Row>} */
    this.rows = new Map();
    this.body = h("tbody", {});
    this.empty = h(
      "p",
      { class: "empty", data: { testid: "no-sessions" } },
      "No sessions yet. Create a link above and open it.",
    );
    const head = COLUMNS.map((name) => h("th", { scope: "col" }, name));
    this.table = h(
      "table",
      { class: "sessions", data: { testid: "sessions" } },
      h("caption", { class: "visually-hidden" }, "Sessions, newest first"),
      h("thead", {}, h("tr", {}, head)),
      this.body,
    );
    this.choice = h(
      "select",
      { data: { testid: "sessions-show" } },
      h("option", { value: "" }, "Automatic"),
      h("option", { value: "under_way" }, "Under way"),
      h("option", { value: "all" }, "Everybody"),
    );
    this.choice.addEventListener("input", () => this.update(this.sessions));
    this.filter = h("label", { class: "signed" }, "Show", this.choice);
    this.left = h("p", { class: "hint", role: "status", data: { testid: "sessions-left" } });
    this.element = h("div", { class: "table-scroll" }, this.table, this.empty, this.left);
    /** @type {Session[]} */
    this.sessions = [];
  }

  /**
   * @param {Session[]} sessions
   * @returns {void}
   */
  update(sessions) {
    this.sessions = sessions;
    const chosen = this._chosen(sessions);
    // Who asks for help stands first, that is last here: the newest row is on top.
    const shown = [...chosen.filter((one) => !one.help_wanted), ...chosen.filter((one) => one.help_wanted)];
    this.empty.hidden = sessions.length > 0;
    this.table.hidden = shown.length === 0;
    const left = sessions.length - shown.length;
    setText(
      this.left,
      left
        ? `${left} more ${left === 1 ? "has" : "have"} not begun or ${left === 1 ? "is" : "are"} over. The roster lists everybody.`
        : "",
    );
    const wanted = new Set(shown.map((session) => session.participant));
    for (const [participant, row] of this.rows) {
      if (wanted.has(participant)) continue;
      row.element.remove();
      this.rows.delete(participant);
    }
    // Rows that are there stay where they are, and with them focus; new ones are put in between.
    let next = this.body.firstElementChild;
    for (const session of [...shown].reverse()) {
      let row = this.rows.get(session.participant);
      if (!row) {
        row = new Row(session.participant, this);
        this.rows.set(session.participant, row);
      }
      if (row.element === next) next = row.element.nextElementSibling;
      else this.body.insertBefore(row.element, next);
      if (row.shown !== session) row.fill(session); // the feed keeps the object of a session that did not change
    }
  }

  /**
   * Everybody, or those somebody may have to act on: under way, connected, or asking for help.
   *
   * @param {Session[]} sessions
   * @returns {Session[]}
   */
  _chosen(sessions) {
    const kind = this.choice.value || (sessions.length > MANY ? "under_way" : "all");
    if (kind === "all") return sessions;
    return sessions.filter(
      (session) =>
        session.connected ||
        session.help_wanted ||
        !(OVER.has(session.state) || session.place === "consent" || session.place === "eligibility"),
    );
  }
}

/** One session in the table. */
class Row {
  /**
   * @param {string} participant
   * @param {Pick<Rows, "toasts" | "onAct">} table
   */
  constructor(participant, { toasts, onAct }) {
    /** @type {Session | null} */
    this.shown = null;
    this.name = h("a", { href: `#session=${encodeURIComponent(participant)}`, data: { testid: "open" } });
    const cell = (/** @type {string} */ column) => h("td", { data: { column } });
    this.state = cell("state");
    this.trial = cell("trial");
    this.task = cell("task");
    this.connection = cell("connection");
    this.remarks = cell("remarks");
    this.buttons = BUTTONS.map((command) => {
      const attributes = { type: "button", class: "secondary small", "aria-label": `${command.label}: ${participant}` };
      const words = SHORT[command.name] ?? command.label;
      const button = h("button", { ...attributes, data: { testid: command.name } }, words);
      reasoned(
        button,
        () => this.why(command.name),
        toasts,
        () => onAct(participant, command),
      );
      return { name: command.name, button };
    });
    this.element = h(
      "tr",
      { data: { participant, testid: "session-row" } },
      h("th", { scope: "row" }, this.name),
      [this.state, this.trial, this.task, this.connection, this.remarks],
      h(
        "td",
        {},
        h(
          "div",
          { class: "buttons" },
          this.buttons.map(({ button }) => button),
        ),
      ),
    );
  }

  /**
   * Why a command is not possible now, "" when it is.
   *
   * @param {string} command
   * @returns {string}
   */
  why(command) {
    return this.shown?.why_not[command] ?? "";
  }

  /**
   * @param {Session} session
   * @returns {void}
   */
  fill(session) {
    this.shown = session;
    this.element.dataset.state = session.state;
    setText(this.name, nameOf(session));
    const [sign, level] = LEVELS[session.state] ?? ["clock", ""];
    const place = session.state === "paused" ? ` (${stateWords(session.place).toLowerCase()})` : "";
    mark(this.state, sign, stateWords(session.state) + place, level);
    const trial = `${session.trial} of ${session.trials}, ${session.condition.replaceAll("_", " ")}`;
    setText(this.trial, WITHOUT_TRIAL.has(session.place) ? "–" : trial);
    const time = session.trial_s ? `, ${session.trial_s.toFixed(1)} s` : "";
    setText(this.task, session.tasks ? taskWords(session.done_tasks, session.tasks) + time : "–");
    mark(this.connection, ...connectionOf(session));
    const asks = session.help_wanted;
    const text = remarks(session);
    this.element.classList.toggle("asks", asks);
    if (asks) mark(this.remarks, "help", `Asks for help. ${text.replace(/^–$/, "")}`, "bad");
    else mark(this.remarks, null, text, "");
    // One of the two makes sense; the other is there as soon as it does.
    const resumes = session.state === "paused" && (this.why("resume") === "" || this.why("pause") !== "");
    for (const { name, button } of this.buttons) {
      if (name === "resume") button.hidden = !resumes;
      if (name === "pause") button.hidden = resumes;
      say(button, this.why(name));
    }
  }
}

/**
 * Who it is, for a heading or a row.
 *
 * @param {Session} session
 * @returns {string}
 */
export function nameOf({ participant, demo, label }) {
  return [participant, demo ? "(demo)" : "", label ? `· ${label}` : ""].filter(Boolean).join(" ");
}

/**
 * @param {number | null} done
 * @param {number} tasks
 * @returns {string}
 */
export function taskWords(done, tasks) {
  return `${Math.min((done ?? 0) + 1, tasks)} of ${tasks}`;
}

/**
 * @param {HTMLElement} cell
 * @param {IconName | null} sign
 * @param {string} text
 * @param {Level} level
 * @returns {void}
 */
function mark(cell, sign, text, level) {
  if (cell.dataset.text === text && cell.dataset.level === level) return;
  cell.dataset.text = text;
  cell.dataset.level = level;
  cell.replaceChildren(h("span", { class: "mark-line", data: { level } }, sign && icon(sign), text));
}
