// A sensor reading to be logged: big, loud, counted down. Used by the panel of the second device, and as the cover
// over the view of a single screen. Times are trial time, which stands still during a pause.

import { freshId, h, icon, setText } from "../common/dom.js";
import { Emitter } from "../common/emitter.js";
import { problemText } from "../common/problem.js";

/** @import { Alert, AlertClosed } from "../../tests/javascript/wire.d.ts" */
/** @import { LabSocket } from "../wire/socket.js" */
/** @import { Sound } from "./sound.js" */
/** @typedef {AlertClosed["status"] | null} Ending how the last reading ended; null when the study went on without it */

const REDRAW_MS = 100;
/** @type {Record<AlertClosed["status"], string>} */
const ENDINGS = { answered: "Saved.", expired: "Time is up for this reading.", trial_ended: "The round has ended." };

/**
 * Emits "open", and "released" when there is nothing to do any more.
 *
 * @extends {Emitter<{ open: null, released: Ending }>}
 */
export class AlertView extends Emitter {
  /**
   * `away`: hands must stay off the controls until `away_min_s` have passed.
   *
   * @param {{ socket: LabSocket, sound: Sound, away: boolean }} wiring
   */
  constructor({ socket, sound, away }) {
    super();
    this.socket = socket;
    this.sound = sound;
    this.away = away;
    /** @type {Pick<Alert, "alert" | "answer_within_s"> | null} */
    this.alert = null;
    /** @type {"idle" | "open" | "sending" | "waiting"} */
    this.phase = "idle"; // idle → open → sending → waiting → idle
    this.paused = false;
    this.concealed = false;
    this.elapsedS = 0;
    this.releaseS = 0;
    /** @type {Ending} */
    this.lastStatus = null;
    this._reported = false;
    const inputId = freshId("reading");
    const errorId = freshId("reading-error");
    this.reading = h("output", { class: "reading", data: { testid: "alert-reading" } });
    this.input = h("input", {
      id: inputId,
      type: "text",
      inputmode: "decimal",
      autocomplete: "off",
      autocapitalize: "off",
      spellcheck: "false",
      maxlength: 64,
      class: "reading-input",
      "aria-describedby": errorId,
      data: { testid: "alert-input" },
    });
    this.error = h("p", { id: errorId, class: "field-error", role: "alert", hidden: true });
    this.button = h(
      "button",
      { type: "submit", class: "primary large", data: { testid: "alert-submit" } },
      "Log reading",
    );
    this.clock = h("p", { class: "countdown", data: { testid: "alert-countdown" } });
    this.bar = h("div", { class: "bar-fill" });
    this.rest = h("p", { class: "alert-rest", data: { testid: "alert-rest" } });
    this.result = h("p", { class: "alert-result", role: "status", data: { testid: "alert-result" } });
    this.form = h(
      "form",
      { class: "alert-form", novalidate: true },
      h(
        "div",
        { class: "field" },
        h("label", { for: inputId }, "Type the reading, then press Enter"),
        this.input,
        this.error,
      ),
      this.button,
    );
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this._answer();
    });
    this.element = h(
      "section",
      {
        class: "alert",
        role: this.away ? "alertdialog" : "region",
        "aria-label": "Sensor reading",
        hidden: true,
        data: { testid: "alert" },
      },
      h(
        "div",
        { class: "alert-card" },
        h("p", { class: "alert-kicker" }, icon("sound"), "New sensor reading"),
        this.reading,
        this.form,
        this.result,
        h("div", { class: "bar", "aria-hidden": "true" }, this.bar),
        this.clock,
        this.rest,
      ),
    );
    this._timer = setInterval(() => this._redraw(), REDRAW_MS);
    this._lastMs = performance.now();
    /** @type {(event: KeyboardEvent) => void} */
    this._typed = (event) => this._refocus(event);
    document.addEventListener("keydown", this._typed);
    socket.addEventListener("alert", (event) => this.open(event.detail));
    socket.addEventListener("alert_closed", (event) => this.closed(event.detail));
  }

  /** @returns {boolean} */
  get covering() {
    return this.phase !== "idle";
  }

  /**
   * A new reading, or the same one again after a reload.
   *
   * @param {Alert} alert
   * @returns {void}
   */
  open(alert) {
    const again = this.alert?.alert === alert.alert && this.phase !== "idle";
    this.elapsedS = alert.elapsed_s;
    if (again) return;
    this.alert = alert;
    this.phase = "open";
    this.releaseS = 0;
    this.lastStatus = null; // what became of an earlier one says nothing about this one
    this.input.value = "";
    this.error.hidden = true;
    setText(this.reading, alert.reading);
    setText(this.result, "");
    this._redraw();
    this._reported = false;
    this._show();
    this.emit("open");
  }

  /**
   * During a pause the reading is out of sight: time stands still, and "Go on" must be in reach.
   *
   * @param {boolean} concealed
   * @returns {void}
   */
  conceal(concealed) {
    if (this.concealed === concealed) return;
    this.concealed = concealed;
    if (concealed) this.sound.silence();
    this._show();
  }

  _show() {
    this.element.hidden = this.phase === "idle" || this.concealed;
    if (this.element.hidden || this.phase !== "open" || !this.alert) return;
    this.input.focus();
    if (!this._reported) this._report(this.alert.alert);
    this._reported = true;
  }

  /**
   * The lab says it is over.
   *
   * @param {AlertClosed} end
   * @returns {void}
   */
  closed({ alert, status, release_in_s }) {
    if (this.phase === "idle" && this.away && release_in_s > 0) return this._coverAgain(alert, release_in_s);
    if (this.alert?.alert !== alert || this.phase === "idle") return;
    this.sound.silence();
    this.phase = "waiting";
    this.releaseS = this.away ? release_in_s : 0;
    this.lastStatus = status;
    setText(this.result, ENDINGS[status]);
    this._redraw();
  }

  /**
   * After a reload: the reading is dealt with, but the controls are not back yet.
   *
   * @param {number} alert
   * @param {number} releaseS
   */
  _coverAgain(alert, releaseS) {
    this.alert = { alert, answer_within_s: 0 };
    this.elapsedS = 0;
    this.phase = "waiting";
    this.releaseS = releaseS;
    this._reported = true;
    setText(this.reading, "");
    setText(this.result, "This reading is logged.");
    this._redraw();
    this._show();
    this.emit("open");
  }

  /**
   * Trial time stands still, or goes on.
   *
   * @param {boolean} paused
   * @returns {void}
   */
  pause(paused) {
    this.paused = paused;
    this._redraw();
  }

  /**
   * Another phase of the study: whatever was open belongs to the past.
   *
   * @returns {void}
   */
  clear() {
    if (this.phase === "idle") return;
    this.sound.silence();
    this._release();
  }

  /** @returns {void} */
  close() {
    clearInterval(this._timer);
    document.removeEventListener("keydown", this._typed);
    this.sound.silence();
  }

  /**
   * Tells the lab that it was really on the screen, and that the sound really came out.
   *
   * @param {number} alert
   */
  async _report(alert) {
    const heard = this.sound.alarm();
    if (document.hidden)
      await new Promise((resolve) => document.addEventListener("visibilitychange", resolve, { once: true }));
    await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
    this.socket.submit("alert_shown", { alert }).catch(() => {});
    if (await heard) this.socket.submit("alert_heard", { alert }).catch(() => {});
  }

  async _answer() {
    if (this.phase !== "open" || !this.alert) return;
    const { alert } = this.alert;
    const value = this.input.value.trim();
    if (value === "") {
      this.error.hidden = false;
      setText(this.error, "Type the number shown above first.");
      this.input.focus();
      return;
    }
    this.error.hidden = true;
    this.phase = "sending";
    setText(this.result, "Saving");
    this._redraw();
    this.sound.silence();
    try {
      await this.socket.submit("alert_answer", { alert, value });
      this.sound.confirm();
      if (this.phase === "sending") setText(this.result, "Saved.");
    } catch (error) {
      if (this.phase !== "sending") return;
      this.phase = "open";
      setText(this.result, "");
      this.error.hidden = false;
      setText(this.error, `Not saved: ${problemText(error)}`);
      this.input.focus();
    }
  }

  _redraw() {
    const now = performance.now();
    const passedS = this.paused || this.phase === "idle" ? 0 : (now - this._lastMs) / 1000;
    this._lastMs = now;
    if (this.phase === "idle" || !this.alert) return;
    this.elapsedS += passedS;
    const left = Math.max(0, this.alert.answer_within_s - this.elapsedS);
    const open = this.phase === "open";
    if (this.phase === "waiting") {
      this.releaseS -= passedS;
      if (this.releaseS <= 0) return this._release();
    }
    this.form.inert = !open;
    this.element.dataset.phase = this.phase;
    this.bar.style.transform = `scaleX(${this.alert.answer_within_s > 0 ? left / this.alert.answer_within_s : 0})`;
    setText(this.clock, this.paused ? "Paused" : this.phase === "waiting" ? "" : `${Math.ceil(left)} s left`);
    setText(this.rest, this.away ? this._restText() : "");
  }

  _restText() {
    if (this.phase === "waiting") return `The controls come back in ${Math.max(1, Math.ceil(this.releaseS))} s.`;
    return "Take your hands off the robot's controls. They come back after you have logged the reading.";
  }

  _release() {
    this.phase = "idle";
    this.element.hidden = true;
    this.alert = null;
    this.emit("released", this.lastStatus);
  }

  /**
   * A digit typed anywhere goes into the field, so that the mouse is never needed.
   *
   * @param {KeyboardEvent} event
   */
  _refocus(event) {
    if (
      this.phase !== "open" ||
      this.concealed ||
      event.target === this.input ||
      event.ctrlKey ||
      event.altKey ||
      event.metaKey
    )
      return;
    if (event.key.length !== 1 || event.key === " " || document.querySelector("dialog[open]")) return;
    this.input.focus();
  }
}
