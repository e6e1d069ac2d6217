// Which part of the dashboard is on the screen: all sessions, or the one named in the address (#session=P001).

import { h } from "../common/dom.js";
import { LiveFeed } from "./live_feed.js";
import { SessionPage } from "./live_session.js";
import { STATES } from "./sessions_table.js";

export class Live {
  /** `onAct(participant, command)` does something; `onSessions` gets every session whenever one changed. */
  constructor({ api, toasts, main, onAct, onSessions }) {
    Object.assign(this, { api, toasts, main, onAct });
    this.feed = new LiveFeed();
    this.page = null;
    this.board = null;
    this.running = false;
    this.feed.addEventListener("sessions", (event) => {
      onSessions(event.detail);
      this._showSession();
    });
    this.feed.addEventListener("watched", (event) => this.page?.hear(event.detail));
    addEventListener("hashchange", () => this.running && this._route());
  }

  /** Whether the lab pushes: then nothing has to be asked for. */
  get fed() {
    return this.feed.fed;
  }

  get sessions() {
    return [...this.feed.sessions.values()];
  }

  /** The board is on the screen and the token is right. */
  start() {
    this.running = true;
    this.page?.close();
    this.page = null;
    this.feed.start(this.api.token);
    this._route();
  }

  stop() {
    this.running = false;
    this.page?.close();
    this.page = null;
    this.feed.watch(null);
    this.feed.stop();
  }

  _route() {
    const participant = decodeURIComponent(/^#session=(.+)$/.exec(location.hash)?.[1] ?? "");
    if (participant === (this.page?.participant ?? "")) return;
    // The board is kept as it is: a new link is shown only once.
    if (!this.page) this.board = [...this.main.childNodes];
    this.page?.close();
    this.feed.watch(participant || null);
    if (!participant) {
      const left = this.page.participant;
      this.page = null;
      this.main.replaceChildren(...this.board);
      this.main.querySelector(`a[href="#session=${CSS.escape(encodeURIComponent(left))}"]`)?.focus();
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
      this.page.showSession(
        session,
        session.state === "paused"
          ? `Paused (${(STATES[session.place] ?? session.place).toLowerCase()})`
          : (STATES[session.state] ?? session.state),
      );
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
