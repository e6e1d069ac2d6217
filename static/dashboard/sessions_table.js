// The table of sessions. Rows stay the same elements while they are updated, so that focus and pressed buttons survive.

import { h, icon, setText } from "../common/dom.js";
import { COMMANDS, reasoned, say } from "./commands.js";

export const STATES = {
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
};
const LEVELS = {
  trial: ["play", "good"],
  practice: ["play", "good"],
  paused: ["pause", "warn"],
  done: ["check", "good"],
  withdrawn: ["hand", "warn"],
  aborted: ["warning", "bad"],
  screened_out: ["hand", "warn"],
};
const CAUSES = { connection: "connection lost", experimenter: "by the experimenter" };
const OVER = new Set(["done", "withdrawn", "aborted", "screened_out"]);
const WITHOUT_TRIAL = new Set(["eligibility", "consent", "demographics", "setup", "instructions", "debrief", ...OVER]);
const BUTTONS = COMMANDS.filter(({ name }) => ["pause", "resume", "abort"].includes(name)); // the others are on the page of the session
const SHORT = { abort: "Abort" };
const MANY = 30; // above so many, only those under way are shown unless everybody is asked for
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
  if (session.causes?.length)
    list.push(`Paused: ${session.causes.map((cause) => CAUSES[cause] ?? cause).join(" and ")}`);
  if (session.overruns > 0) list.push(`${session.overruns} late ${session.overruns === 1 ? "tick" : "ticks"}`);
  if (session.connected && session.visible === false) list.push("page hidden");
  else if (session.connected && session.focused === false) list.push("page without focus");
  if (session.sound === false) list.push("sound not heard");
  if (session.signals_per_s > 0) list.push(`${session.signals_per_s.toFixed(1)} signals/s`);
  if (session.device && session.device !== "none") list.push(session.device);
  if (session.pace === "lockstep") list.push("lockstep");
  return list.join("; ") || "–";
}

export class Rows {
  /** `onAct(participant, command)` is called when a button that can act is pressed. */
  constructor({ toasts, onAct }) {
    Object.assign(this, { toasts, onAct });
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
    this.sessions = [];
  }

  update(sessions) {
    this.sessions = sessions;
    const shown = this._chosen(sessions);
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
      if (row) next = row.element.nextElementSibling;
      else {
        row = this._make(session.participant);
        this.rows.set(session.participant, row);
        this.body.insertBefore(row.element, next);
      }
      if (row.shown !== session) this._fill(row, session); // the feed keeps the object of a session that did not change
      row.shown = session;
    }
  }

  /** Everybody, or those somebody may have to act on: under way, connected, or asking for help. */
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

  _make(participant) {
    const name = h("a", { href: `#session=${encodeURIComponent(participant)}`, data: { testid: "open" } });
    const cells = Object.fromEntries(
      ["state", "trial", "task", "connection", "remarks"].map((column) => [column, h("td", { data: { column } })]),
    );
    const row = { why: {} };
    const buttons = Object.fromEntries(
      BUTTONS.map((command) => {
        const button = h(
          "button",
          {
            type: "button",
            class: "secondary small",
            "aria-label": `${command.label}: ${participant}`,
            data: { testid: command.name },
          },
          SHORT[command.name] ?? command.label,
        );
        reasoned(
          button,
          () => row.why[command.name] ?? "",
          this.toasts,
          () => this.onAct(participant, command),
        );
        return [command.name, button];
      }),
    );
    const element = h(
      "tr",
      { data: { participant, testid: "session-row" } },
      h("th", { scope: "row" }, name),
      Object.values(cells),
      h("td", {}, h("div", { class: "buttons" }, Object.values(buttons))),
    );
    return Object.assign(row, { element, name, cells, buttons });
  }

  _fill(row, session) {
    const { element, name, cells, buttons } = row;
    element.dataset.state = session.state;
    setText(
      name,
      [session.participant, session.demo ? "(demo)" : "", session.label ? `· ${session.label}` : ""]
        .filter(Boolean)
        .join(" "),
    );
    const [sign, level] = LEVELS[session.state] ?? ["clock", ""];
    const place =
      session.state === "paused" && session.place ? ` (${(STATES[session.place] ?? session.place).toLowerCase()})` : "";
    mark(cells.state, sign, (STATES[session.state] ?? session.state) + place, level);
    setText(
      cells.trial,
      WITHOUT_TRIAL.has(session.place ?? session.state)
        ? "–"
        : `${ratio(session.trial, session.trials)}, ${session.condition.replaceAll("_", " ")}`,
    );
    const time = session.trial_s > 0 ? `, ${session.trial_s.toFixed(1)} s` : "";
    setText(
      cells.task,
      session.tasks ? ratio(Math.min(session.done_tasks + 1, session.tasks), session.tasks) + time : "–",
    );
    mark(cells.connection, ...connectionOf(session));
    const asks = session.help_wanted;
    mark(
      cells.remarks,
      asks ? "help" : null,
      asks ? `Asks for help. ${remarks(session).replace(/^–$/, "")}` : remarks(session),
      asks ? "warn" : "",
    );
    row.why = session.why_not ?? {};
    // One of the two makes sense; the other is there as soon as it does.
    buttons.resume.hidden = session.state !== "paused" || (Boolean(row.why.resume) && !row.why.pause);
    buttons.pause.hidden = !buttons.resume.hidden;
    for (const [action, button] of Object.entries(buttons)) say(button, row.why[action] ?? "");
  }
}

function mark(cell, sign, text, level) {
  if (cell.dataset.text === text && cell.dataset.level === level) return;
  cell.dataset.text = text;
  cell.dataset.level = level;
  cell.replaceChildren(h("span", { class: "mark-line", data: { level } }, sign && icon(sign), text));
}
