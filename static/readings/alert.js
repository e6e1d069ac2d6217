// A stimulus of the second task, such as a sensor reading to be logged: big, loud, counted down. Used by the panel of
// the second device, and as the cover over the view of a single screen. It is answered by typing, or by one of a few
// choices. Times are trial time, which stands still during a pause.

import { freshId, h, icon, setText } from "../common/dom.js";
import { Emitter } from "../common/emitter.js";
import { numeral, t } from "../common/language.js";
import { problemText } from "../common/problem.js";
import { numerals } from "../common/typed_number.js";
import { wordsFor } from "./words.js";

/** @import { Alert, AlertChoice, AlertClosed } from "../../tests/javascript/wire.d.ts" */
/** @import { LabSocket } from "../wire/socket.js" */
/** @import { Sound } from "./sound.js" */
/** @typedef {AlertClosed["status"] | null} Ending how the last one ended; null when the study went on without it */

const REDRAW_MS = 100;
const LONG_TEXT = 7; // characters: more than that is drawn smaller, unless it is a reading

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
    /** @type {Pick<AlertChoice, "id" | "key">[]} */
    this.choices = []; // none: it is typed
    /** @type {Alert["entry"]} */
    this.entry = "text";
    /** @type {"idle" | "open" | "sending" | "waiting"} */
    this.phase = "idle"; // idle → open → sending → waiting → idle
    this.words = wordsFor(socket.welcome);
    this.paused = false;
    this.concealed = false;
    this.elapsedS = 0;
    this.releaseS = 0;
    /** @type {Ending} */
    this.lastStatus = null;
    this._reported = false;
    const inputId = freshId("reading");
    const errorId = freshId("reading-error");
    const promptId = freshId("reading-prompt");
    this.reading = h("output", { class: "reading", data: { testid: "alert-reading" } });
    this.input = h("input", {
      id: inputId,
      type: "text",
      autocomplete: "off",
      autocapitalize: "off",
      spellcheck: "false",
      class: "reading-input",
      "aria-describedby": errorId,
      data: { testid: "alert-input" },
    });
    this.error = h("p", { id: errorId, class: "field-error", role: "alert", hidden: true });
    this.button = h("button", { type: "submit", class: "primary large", data: { testid: "alert-submit" } });
    this.label = h("label", { for: inputId });
    this.field = h("div", { class: "field" }, this.label, this.input, this.error);
    this.prompt = h("p", { id: promptId, class: "alert-prompt", data: { testid: "alert-prompt" } });
    this.buttons = h("div", { class: "alert-choices" });
    this.chooser = h(
      "div",
      { class: "alert-chooser", role: "group", "aria-labelledby": promptId, tabindex: "-1", hidden: true },
      this.prompt,
      this.buttons,
    );
    this.title = h("h1", { class: "visually-hidden" }); // what it covers has one that nobody reaches
    this.fresh = h("span", {});
    this.clock = h("p", { class: "countdown", data: { testid: "alert-countdown" } });
    this.bar = h("div", { class: "bar-fill" });
    this.rest = h("p", { class: "alert-rest", data: { testid: "alert-rest" } });
    this.result = h("p", { class: "alert-result", role: "status", data: { testid: "alert-result" } });
    this.form = h("form", { class: "alert-form", novalidate: true }, this.field, this.button, this.chooser);
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.choices.length === 0) this._answer(this.input.value);
    });
    this.element = h(
      "section",
      {
        class: "alert",
        role: this.away ? "alertdialog" : "region",
        hidden: true,
        data: { testid: "alert" },
      },
      h(
        "div",
        { class: "alert-card" },
        this.title,
        h("p", { class: "alert-kicker" }, icon("sound"), this.fresh),
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
    this._typed = (event) => this._onKey(event);
    document.addEventListener("keydown", this._typed);
    socket.addEventListener("alert", (event) => this.open(event.detail));
    socket.addEventListener("alert_closed", (event) => this.closed(event.detail));
    this._name();
  }

  /** @returns {boolean} */
  get covering() {
    return this.phase !== "idle";
  }

  /**
   * A new one, or the same one again after a reload.
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
    this._name();
    setText(this.reading, numeral(alert.reading));
    this.reading.classList.toggle("long", alert.reading.length > LONG_TEXT && numerals(alert.reading).length === 0);
    this._ask(alert);
    setText(this.result, "");
    this._redraw();
    this._reported = false;
    this._show();
    this.emit("open");
  }

  /** The words of the study's kind of second task; what is typed or chosen is `_ask`. */
  _name() {
    const words = wordsFor(this.socket.welcome);
    this.words = words;
    this.element.setAttribute("aria-label", words.title);
    setText(this.title, words.title);
    setText(this.fresh, words.fresh);
    setText(this.button, words.submit);
    setText(this.label, words.prompt);
  }

  /**
   * How it is answered: a field, or a button for each choice.
   *
   * @param {Alert} alert
   */
  _ask({ prompt = null, choices = [], entry }) {
    const typed = choices.length === 0;
    this.entry = entry ?? "text";
    this.input.inputMode = this.entry === "number" ? "decimal" : "text";
    this.choices = choices;
    this.field.hidden = this.button.hidden = !typed;
    this.chooser.hidden = typed;
    this.form.classList.toggle("choosing", !typed);
    (typed ? this.field : this.chooser).append(this.error);
    if (prompt) setText(typed ? this.label : this.prompt, prompt);
    else setText(this.prompt, this.words.title);
    this.buttons.replaceChildren(
      ...choices.map(({ id, label, key }) =>
        h(
          "button",
          {
            type: "button",
            class: "secondary large",
            "aria-keyshortcuts": key,
            on: { click: () => this._answer(id) },
            data: { testid: `alert-choice-${id}` },
          },
          h("kbd", { "aria-hidden": "true" }, key.toUpperCase()),
          label,
        ),
      ),
    );
  }

  /** Neither a field to type in nor a button: Enter and the space bar, held to drive, must not choose. */
  _focus() {
    (this.choices.length === 0 ? this.input : this.chooser).focus();
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
    this._focus();
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
    const endings = { answered: t("Saved."), expired: this.words.late, trial_ended: t("The round has ended.") };
    setText(this.result, endings[status]);
    this._redraw();
  }

  /**
   * After a reload: it is dealt with, but the controls are not back yet.
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
    this._name();
    setText(this.reading, "");
    setText(this.result, this.words.handled);
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

  /** @param {string} value what was typed, or the id of the choice */
  async _answer(value) {
    if (this.phase !== "open" || !this.alert) return;
    const { alert } = this.alert;
    const wrong =
      value.trim() === ""
        ? this.words.missing
        : this.entry === "number" && numerals(value).length === 0
          ? this.words.noNumber(value.trim())
          : "";
    if (wrong) {
      this.error.hidden = false;
      setText(this.error, wrong);
      this.input.focus();
      return;
    }
    this.error.hidden = true;
    this.phase = "sending";
    setText(this.result, t("Saving"));
    this._redraw();
    this.sound.silence();
    try {
      await this.socket.submit("alert_answer", { alert, value });
      this.sound.confirm();
      if (this.phase === "sending") setText(this.result, t("Saved."));
    } catch (error) {
      if (this.phase !== "sending") return;
      this.phase = "open";
      setText(this.result, "");
      this.error.hidden = false;
      setText(this.error, t("Not saved: {problem}", { problem: problemText(error) }));
      this._focus();
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
    setText(
      this.clock,
      this.paused ? t("Paused") : this.phase === "waiting" ? "" : t("{n} s left", { n: Math.ceil(left) }),
    );
    setText(this.rest, this.away ? this._restText() : "");
  }

  _restText() {
    if (this.phase === "waiting")
      return t("The controls come back in {n} s.", { n: Math.max(1, Math.ceil(this.releaseS)) });
    return this.words.handsOff;
  }

  _release() {
    this.phase = "idle";
    this.element.hidden = true;
    this.alert = null;
    this.emit("released", this.lastStatus);
  }

  /**
   * The mouse is never needed: a key chooses, or what is typed anywhere goes into the field.
   *
   * @param {KeyboardEvent} event
   */
  _onKey(event) {
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
    if (event.repeat) return event.preventDefault(); // held since before it appeared
    if (this.choices.length === 0) return this.input.focus();
    // A digit counts wherever the keyboard has it, with or without Shift.
    const chosen = this.choices.find(
      ({ key }) => event.key.toLowerCase() === key.toLowerCase() || event.code === `Digit${key}`,
    );
    if (chosen) this._answer(chosen.id);
  }
}
