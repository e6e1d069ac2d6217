// The table of sessions. Rows stay the same elements while they are updated, so that focus and pressed buttons survive.

import { COMMANDS, reasoned, say } from "./acts.js";
import { h, icon, setText } from "./dom.js";

export const STATES = {
  created: "Not opened yet", consent: "Consent", demographics: "Demographics", setup: "Set-up", instructions: "Instructions",
  practice_ready: "Before practice", practice: "Practice", trial_ready: "Before the trial", trial: "In a trial", survey: "Survey",
  break: "Break", debrief: "Debrief", done: "Complete", paused: "Paused", withdrawn: "Withdrawn", aborted: "Aborted",
  eligibility: "Device check", screened_out: "Screened out",
};
const LEVELS = { trial: ["play", "good"], practice: ["play", "good"], paused: ["pause", "warn"], done: ["check", "good"], withdrawn: ["hand", "warn"], aborted: ["warning", "bad"], screened_out: ["hand", "warn"] };
const CAUSES = { connection: "connection lost", experimenter: "by the experimenter" };
const OVER = new Set(["done", "withdrawn", "aborted", "screened_out"]);
const WITHOUT_TRIAL = new Set(["eligibility", "consent", "demographics", "setup", "instructions", "debrief", ...OVER]);
const SHOWN = COMMANDS.filter(({ name }) => ["pause", "resume", "abort"].includes(name)); // the others are on the page of the session
const COLUMNS = ["Participant", "State", "Trial", "Task", "Connection", "Remarks", "Actions"];

function connectionOf(session) {
  if (OVER.has(session.state)) return ["check", "–", ""];
  if (session.connected && session.held) return ["warning", "No heartbeat: robot holds", "bad"];
  const trip = Number.isFinite(session.round_trip_ms) ? ` · ${Math.round(session.round_trip_ms)} ms` : "";
  if (session.connected) return ["check", `Connected${trip}`, "good"];
  return ["lost", "Not connected", session.state === "consent" || session.state === "eligibility" ? "" : "bad"];
}

function ratio(now, all) {
  if (now === null || now === undefined) return "–";
  return all ? `${now} of ${all}` : String(now);
}

function remarks(session) {
  const list = [];
  if (session.causes?.length) list.push(`Paused: ${session.causes.map((cause) => CAUSES[cause] ?? cause).join(" and ")}`);
  if (session.overruns > 0) list.push(`${session.overruns} late ${session.overruns === 1 ? "tick" : "ticks"}`);
  if (session.connected && session.visible === false) list.push("page hidden");
  else if (session.connected && session.focused === false) list.push("page without focus");
  if (session.sound === false) list.push("sound not heard");
  if (session.signals_per_s > 0) list.push(`${session.signals_per_s.toFixed(1)} signals/s`);
  if (session.device) list.push(session.device);
  if (session.pace === "lockstep") list.push("lockstep");
  return list.join("; ") || "–";
}

export class Rows {
  /** `onAct(participant, command)` is called when a button that can act is pressed. */
  constructor({ toasts, onAct }) {
    Object.assign(this, { toasts, onAct });
    this.rows = new Map();
    this.body = h("tbody", {});
    this.empty = h("p", { class: "empty", data: { testid: "no-sessions" } }, "No sessions yet. Create a link above and open it.");
    const head = COLUMNS.map((name) => h("th", { scope: "col" }, name));
    this.table = h("table", { class: "sessions", data: { testid: "sessions" } }, h("caption", { class: "visually-hidden" }, "Sessions, newest first"), h("thead", {}, h("tr", {}, head)), this.body);
    this.element = h("div", { class: "table-scroll" }, this.table, this.empty);
  }

  update(sessions) {
    this.empty.hidden = sessions.length > 0;
    this.table.hidden = sessions.length === 0;
    const seen = new Set();
    this.fresh = [];
    for (const session of [...sessions].reverse()) {
      seen.add(session.participant);
      if (!this.rows.has(session.participant)) {
        const row = this._make(session.participant);
        this.rows.set(session.participant, row);
        this.fresh.push(row.element);
      }
      const row = this.rows.get(session.participant);
      if (row.shown !== session) this._fill(row, session); // the feed keeps the object of a session that did not change
      row.shown = session;
    }
    this.body.prepend(...this.fresh);
    for (const [participant, row] of this.rows) {
      if (seen.has(participant)) continue;
      row.element.remove();
      this.rows.delete(participant);
    }
  }

  _make(participant) {
    const name = h("a", { href: `#session=${encodeURIComponent(participant)}`, data: { testid: "open" } });
    const cells = Object.fromEntries(["state", "trial", "task", "connection", "remarks"].map((column) => [column, h("td", { data: { column } })]));
    const row = { why: {} };
    const buttons = Object.fromEntries(SHOWN.map((command) => {
      const button = h("button", { type: "button", class: "secondary small", "aria-label": `${command.label}: ${participant}`, data: { testid: command.name } }, command.label);
      reasoned(button, () => row.why[command.name] ?? "", this.toasts, () => this.onAct(participant, command));
      return [command.name, button];
    }));
    const element = h("tr", { data: { participant, testid: "session-row" } }, h("th", { scope: "row" }, name), Object.values(cells), h("td", {}, h("div", { class: "buttons" }, Object.values(buttons))));
    return Object.assign(row, { element, name, cells, buttons });
  }

  _fill(row, session) {
    const { element, name, cells, buttons } = row;
    element.dataset.state = session.state;
    setText(name, [session.participant, session.demo ? "(demo)" : "", session.label ? `· ${session.label}` : ""].filter(Boolean).join(" "));
    const [sign, level] = LEVELS[session.state] ?? ["clock", ""];
    const place = session.state === "paused" && session.place ? ` (${(STATES[session.place] ?? session.place).toLowerCase()})` : "";
    mark(cells.state, sign, (STATES[session.state] ?? session.state) + place, level);
    setText(cells.trial, WITHOUT_TRIAL.has(session.state) ? "–" : ratio(session.trial, session.trials));
    const time = session.trial_s > 0 ? `, ${session.trial_s.toFixed(1)} s` : "";
    setText(cells.task, session.tasks ? ratio(Math.min(session.done_tasks + 1, session.tasks), session.tasks) + time : "–");
    mark(cells.connection, ...connectionOf(session));
    const asks = session.help_wanted;
    mark(cells.remarks, asks ? "help" : null, asks ? `Asks for help. ${remarks(session).replace(/^–$/, "")}` : remarks(session), asks ? "warn" : "");
    row.why = session.why_not ?? {};
    for (const [action, button] of Object.entries(buttons)) say(button, row.why[action] ?? "");
  }
}

function mark(cell, sign, text, level) {
  if (cell.dataset.text === text && cell.dataset.level === level) return;
  cell.dataset.text = text;
  cell.dataset.level = level;
  cell.replaceChildren(h("span", { class: "mark-line", data: { level } }, sign && icon(sign), text));
}
