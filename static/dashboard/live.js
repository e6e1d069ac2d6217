// Which part of the dashboard is on the screen: all sessions, or the one named in the address (#session=P001).

import { h } from "../common/dom.js";
import { LiveFeed } from "./live_feed.js";
import { SessionPage } from "./live_session.js";
import { stateWords } from "./sessions_table.js";

/** @import { LiveReply } from "../../tests/javascript/api.d.ts" */
/** @import { Toasts } from "../common/shell.js" */
/** @import { Api } from "./api.js" */
/** @import { Command } from "./commands.js" */

export class Live {
  /**
   * @param {object} wiring
   * @param {Api} wiring.api
   * @param {Toasts} wiring.toasts
   * @param {HTMLElement} wiring.main
   * @param {(participant: string, command: Command) => void} wiring.onAct asks and does it
   * @param {(sessions: LiveReply[]) => void} wiring.onSessions gets every session whenever one changed
   */
  constructor({ api, toasts, main, onAct, onSessions }) {
    this.api = api;
    this.toasts = toasts;
    this.main = main;
    this.onAct = onAct;
    this.feed = new LiveFeed();
    /** @type {SessionPage | null} */
    this.page = null;
    /** @type {ChildNode[]} */
    this.board = [];
    this.running = false;
    this.feed.addEventListener("sessions", (event) => {
      onSessions(event.detail);
      this._showSession();
    });
    this.feed.addEventListener("watched", (event) => this.page?.hear(event.detail));
    addEventListener("hashchange", () => this.running && this._route());
  }

  /**
   * Whether the lab pushes: then nothing has to be asked for.
   *
   * @returns {boolean}
   */
  get fed() {
    return this.feed.fed;
  }

  /** @returns {LiveReply[]} */
  get sessions() {
    return [...this.feed.sessions.values()];
  }

  /**
   * The board is on the screen and the token is right.
   *
   * @returns {void}
   */
  start() {
    this.running = true;
    this.page?.close();
    this.page = null;
    this.feed.start(this.api.token);
    this._route();
  }

  /** @returns {void} */
  stop() {
    this.running = false;
    this.page?.close();
    this.page = null;
    this.feed.watch(null);
    this.feed.stop();
  }

  _route() {
    const participant = decodeURIComponent(/^#session=(.+)$/.exec(location.hash)?.[1] ?? "");
    const left = this.page?.participant ?? "";
    if (participant === left) return;
    // The board is kept as it is: a new link is shown only once.
    if (!this.page) this.board = [...this.main.childNodes];
    this.page?.close();
    this.feed.watch(participant || null);
    if (!participant) {
      this.page = null;
      this.main.replaceChildren(...this.board);
      const link = `a[href="#session=${CSS.escape(encodeURIComponent(left))}"]`;
      /** @type {HTMLAnchorElement | null} */ (this.main.querySelector(link))?.focus();
      return;
    }
    this.page = new SessionPage({ participant, api: this.api, toasts: this.toasts, onAct: this.onAct });
    this.main.replaceChildren(this.page.element);
    this.page.title.focus();
    this._showSession();
  }

  _showSession() {
    if (!this.page || !this.feed.fed) return;
    const session = this.feed.sessions.get(this.page.participant);
    if (session) {
      const paused = session.state === "paused" ? ` (${stateWords(session.place).toLowerCase()})` : "";
      this.page.showSession(session, stateWords(session.state) + paused);
      return;
    }
    const gone = h(
      "section",
      { class: "card" },
      h("h1", { tabindex: "-1" }, "There is no such session"),
      h("p", {}, `The lab knows no participant ${this.page.participant}.`),
      h("p", {}, h("a", { href: "#" }, "All sessions")),
    );
    if (!this.main.querySelector(".card")) this.main.replaceChildren(gone);
  }
}
