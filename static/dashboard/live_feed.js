// The experimenter's socket: every session as it changes, and everything about the one that is open on the page.
//
// Events: "sessions" (all of them, in order of enrolment), "watched" (news of the open one), "state" (true = fed).

import { socketUrl } from "../common/root.js";

const FIRST_RETRY_MS = 500;
const LAST_RETRY_MS = 8000;
const REFUSED = 1008;
const SILENT_MS = 30_000; // the lab gives a sign of life every ten seconds

export class LiveFeed extends EventTarget {
  constructor() {
    super();
    this.sessions = new Map();
    this.watched = null;
    this.fed = false; // whether the lab has told everything at least once on this connection
    this._token = "";
    this._socket = null;
    this._tries = 0;
    this._retry = 0;
    this._heardMs = 0;
    setInterval(() => this._listen(), 2000);
  }

  start(token) {
    this.stop();
    this._token = token;
    this._connect();
  }

  stop() {
    clearTimeout(this._retry);
    this._token = "";
    const socket = this._socket;
    this._socket = null;
    socket?.close();
    this._setFed(false);
  }

  /** Which session to hear everything of; null for none. */
  watch(participant) {
    this.watched = participant;
    if (this.fed) this._sayWatch();
  }

  _connect() {
    const socket = new WebSocket(socketUrl("/dashboard/socket"));
    this._socket = socket;
    socket.addEventListener("open", () => socket.send(JSON.stringify({ type: "hello", token: this._token })));
    socket.addEventListener("message", (event) => socket === this._socket && this._receive(JSON.parse(event.data)));
    socket.addEventListener("close", (event) => socket === this._socket && this._closed(event));
  }

  /** A laptop that slept or a pulled cable says nothing: do not wait for TCP to notice. */
  _listen() {
    if (!this.fed || performance.now() - this._heardMs < SILENT_MS) return;
    const dead = this._socket;
    this._socket = null;
    dead?.close();
    this._closed({ code: 1006 });
  }

  _closed(event) {
    this._socket = null;
    this._setFed(false);
    if (event.code === REFUSED || !this._token) return;
    this._tries += 1;
    this._retry = setTimeout(() => this._connect(), Math.min(LAST_RETRY_MS, FIRST_RETRY_MS * 1.7 ** (this._tries - 1)));
  }

  _receive(message) {
    this._heardMs = performance.now();
    if (message.type === "overview") {
      if (!this.fed) this.sessions.clear();
      for (const session of message.sessions) this.sessions.set(session.participant, session);
      for (const participant of message.gone) this.sessions.delete(participant);
      this._tries = 0;
      const first = !this.fed;
      this._setFed(true);
      if (first && this.watched) this._sayWatch();
      this._emit("sessions", [...this.sessions.values()]);
    } else if (message.type === "watched" && message.participant === this.watched) this._emit("watched", message);
  }

  _sayWatch() {
    this._socket?.send(JSON.stringify({ type: "watch", participant: this.watched }));
  }

  _setFed(fed) {
    if (this.fed === fed) return;
    this.fed = fed;
    this._emit("state", fed);
  }

  _emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
