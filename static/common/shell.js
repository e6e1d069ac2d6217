// What surrounds every participant page: header, connection sign, toasts, dialogs.

import { freshId, h, icon, setText, whileBusy } from "./dom.js";
import { t, tn } from "./language.js";
import { unsavedNotice } from "./unsaved.js";
import { wordsProblem } from "./words_limit.js";

/** @import { Child, IconName } from "./dom.js" */
/** @import { Emitter } from "./emitter.js" */
/** @typedef {"connecting" | "open" | "lost" | "superseded" | "denied" | "outdated" | "unusable" | "too_many" | "closed"} ConnectionState */

/** @type {Record<ConnectionState, [sign: IconName, text: string]>} */
const CONNECTION = {
  connecting: ["hourglass", t("Connecting")],
  open: ["check", t("Connected")],
  lost: ["lost", t("Connection lost – trying again")],
  superseded: ["warning", t("Open in another tab")],
  denied: ["warning", t("Link not valid")],
  unusable: ["warning", t("Cannot go on")],
  too_many: ["warning", t("Open too often")],
  outdated: ["warning", t("Page out of date")],
  closed: ["hourglass", t("Connecting")],
};

const SHOWN = 2; // at once; the others wait for their turn
const SHORT_MS = 6000;

/**
 * Messages in a place of their own, below the header: they cover nothing. Those that report a problem stay until they are
 * dismissed; the others go by themselves, counted from when they are seen.
 */
export class Toasts {
  constructor() {
    this.list = h("div", { class: "toast-list", role: "status", "aria-live": "polite" });
    this.more = h("p", { class: "toasts-more", hidden: true, data: { testid: "toasts-more" } });
    this.element = h("div", { class: "toasts", data: { testid: "toasts" } }, this.list, this.more);
    /** @type {{ toast: HTMLElement, text: string, begin: () => void }[]} */
    this.waiting = [];
  }

  /**
   * @param {string} text
   * @param {{ problem?: boolean, stays?: boolean, onDismiss?: () => void }} [how]
   * @returns {void}
   */
  show(text, { problem = false, stays = false, onDismiss = () => {} } = {}) {
    const shown = /** @type {HTMLElement[]} */ ([...this.list.children]);
    shown.find((toast) => toast.dataset.text === text)?.remove();
    this.waiting = this.waiting.filter((one) => one.text !== text);
    const close = h(
      "button",
      { class: "quiet small", type: "button", "aria-label": t("Dismiss this message") },
      t("Dismiss"),
    );
    const toast = h(
      "div",
      { class: problem ? "toast problem" : "toast", data: { text, testid: problem ? "toast-problem" : "toast" } },
      icon(problem ? "warning" : "check"),
      h("p", {}, problem ? h("strong", {}, t("Problem:"), " ") : null, text),
      close,
    );
    const leave = () => {
      toast.remove();
      this._next();
    };
    close.addEventListener("click", () => {
      leave();
      onDismiss();
    });
    const begin = () => {
      if (!problem && !stays) setTimeout(() => toast.isConnected && leave(), SHORT_MS);
    };
    this.waiting.push({ toast, text, begin });
    this._next();
  }

  _next() {
    while (this.list.children.length < SHOWN) {
      const next = this.waiting.shift();
      if (!next) break;
      this.list.append(next.toast);
      next.begin();
    }
    const { length } = this.waiting;
    this.more.hidden = length === 0;
    setText(this.more, tn("1 more message", "{n} more messages", length));
  }
}

/**
 * @typedef {object} Field a text to be typed
 * @property {string} label
 * @property {boolean} required
 * @property {string} [missing] said when it is required and empty
 * @property {(text: string) => string} [check] what is wrong with the text, "" when nothing is
 */
/**
 * @typedef {object} Question
 * @property {string} title
 * @property {string[]} [text]
 * @property {string | null} confirm null when there is nothing to confirm
 * @property {string} [back]
 * @property {Field | null} [field]
 * @property {boolean} [danger] Enter then gives the harmless answer
 * @property {string} testid
 * @property {Child} [extra]
 * @property {AbortSignal | null} [signal] takes the question away, as if the person went back
 */

/**
 * A modal question. Resolves to the text typed ("" without a text field), or null when the person went back.
 *
 * @param {Question} question
 * @returns {Promise<string | null>}
 */
export function ask({
  title,
  text = [],
  confirm,
  back = t("Go back"),
  field = null,
  danger = false,
  testid,
  extra = null,
  signal = null,
}) {
  return new Promise((resolve) => {
    const titleId = freshId("dialog-title");
    const fieldId = freshId("dialog-field");
    const input = field && h("textarea", { id: fieldId, rows: 3, required: field.required });
    const error = h("p", { class: "field-error", role: "alert", hidden: true });
    const yes = h(
      "button",
      { type: "submit", class: danger ? "danger" : "primary", data: { testid: "dialog-confirm" } },
      confirm,
    );
    const no = h("button", { type: "button", class: "secondary", data: { testid: "dialog-back" } }, back);
    const form = h(
      "form",
      { novalidate: true },
      h("h2", { id: titleId }, title),
      text.map((line) => h("p", {}, line)),
      extra,
      field && h("div", { class: "field" }, h("label", { for: fieldId }, field.label), input, error),
      h("div", { class: "actions" }, confirm ? yes : null, no),
    );
    const dialog = h("dialog", { "aria-labelledby": titleId, data: { testid } }, form);
    /** @type {string | null} */
    let answer = null;
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const typed = input?.value ?? "";
      const blank = typed.trim() === "";
      const missing = field?.required && blank ? (field.missing ?? t("Please fill this in.")) : "";
      const wrong = missing || wordsProblem(typed) || field?.check?.(typed);
      if (wrong) {
        error.hidden = false;
        error.textContent = wrong;
        input?.focus();
        return;
      }
      answer = blank ? "" : typed;
      dialog.close();
    });
    no.addEventListener("click", () => dialog.close());
    signal?.addEventListener("abort", () => dialog.close());
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(answer);
    });
    document.body.append(dialog);
    dialog.showModal();
    if (danger) no.focus(); // the harmless answer is the one Enter gives
  });
}

/**
 * The lab as the surroundings of a page see it: whether it is there, and what it is called.
 *
 * @typedef {Emitter<{ state: ConnectionState, welcome: { study_title: string, demo: boolean }, saves: { works: boolean, text?: string | null } }> & { state: ConnectionState }} Lab
 */

/** Header with title, connection, Help and Stop. */
export class Shell {
  /** @param {{ socket: Lab, onHelp: () => void, onStop: () => void }} wiring */
  constructor({ socket, onHelp, onStop }) {
    this.socket = socket;
    this.toasts = new Toasts();
    this.main = h("main", { id: "main", tabindex: "-1" });
    this.title = h("span", { class: "brand-title" }, "Shared Autonomy Lab");
    this.demo = h(
      "span",
      { class: "badge", hidden: true, data: { testid: "demo-badge" } },
      t("Demo – not part of the data"),
    );
    this.connection = h("span", { class: "connection", role: "status", data: { testid: "connection" } });
    this.help = h(
      "button",
      { type: "button", class: "secondary small", data: { testid: "help-button" } },
      icon("help"),
      t("Help"),
    );
    this.stop = h(
      "button",
      { type: "button", class: "secondary small stop", data: { testid: "stop-button" } },
      icon("hand"),
      t("Stop"),
    );
    this.help.addEventListener("click", onHelp);
    this.stop.addEventListener("click", onStop);
    this.header = h(
      "header",
      { class: "top" },
      h("span", { class: "brand" }, h("span", { class: "brand-mark", "aria-hidden": "true" }), this.title, this.demo),
      h("span", { class: "top-actions" }, this.connection, this.help, this.stop),
    );
    const notices = h("div", { class: "messages" }, unsavedNotice(socket), this.toasts.element);
    this.element = h("div", { class: "app" }, this.header, notices, this.main);
    socket.addEventListener("state", () => this._connection());
    socket.addEventListener("welcome", (event) => {
      setText(this.title, event.detail.study_title);
      document.title = event.detail.study_title;
      this.demo.hidden = !event.detail.demo;
    });
    this._connection();
  }

  /**
   * Which of the two buttons make sense now.
   *
   * @param {{ help: boolean, stop: boolean }} buttons
   * @returns {void}
   */
  offer({ help, stop }) {
    this.help.hidden = !help;
    this.stop.hidden = !stop;
  }

  /**
   * The study is over for this person: whether the lab still runs is no longer their concern.
   *
   * @param {boolean} resting
   * @returns {void}
   */
  rest(resting) {
    this.connection.hidden = resting;
  }

  _connection() {
    const [sign, text] = CONNECTION[this.socket.state];
    this.connection.dataset.state = this.socket.state;
    if (this.connection.dataset.text === text) return;
    this.connection.dataset.text = text;
    this.connection.replaceChildren(icon(sign), h("span", {}, text));
  }
}

/**
 * A calm page of text in the middle, with one heading and, perhaps, buttons.
 *
 * @param {object} words
 * @param {string} words.title
 * @param {ReadonlyArray<string>} [words.lines]
 * @param {HTMLElement[]} [words.actions]
 * @param {string} [words.testid]
 * @param {boolean} [words.wide]
 * @param {Child} [words.body]
 * @param {IconName | null} [words.sign]
 * @returns {HTMLElement}
 */
export function card({ title, lines = [], actions = [], testid, wide = false, body = null, sign = null }) {
  const heading = h("h1", { tabindex: "-1" }, title);
  return h(
    "section",
    { class: wide ? "card wide" : "card", data: { testid } },
    sign && h("div", { class: "card-sign" }, icon(sign)),
    heading,
    lines.map((line) => h("p", {}, line)),
    body,
    actions.length > 0 && h("div", { class: "actions" }, actions),
  );
}

/**
 * A button that submits a step once and says while it waits. Errors reach the person as toasts.
 *
 * @template Step
 * @param {object} button
 * @param {{ submit: (step: Step) => Promise<unknown> }} button.socket
 * @param {Step} button.step
 * @param {string} button.label
 * @param {string} [button.busy]
 * @param {string} [button.kind] its classes
 * @param {string} button.testid
 * @returns {HTMLButtonElement}
 */
export function stepButton({ socket, step, label, busy = t("Saving"), kind = "primary", testid }) {
  const button = h("button", { type: "button", class: kind, data: { testid } }, label);
  button.addEventListener("click", () => {
    whileBusy(button, busy, async () => {
      try {
        await socket.submit(step);
      } catch {
        // said in a message
      }
    });
  });
  return button;
}
