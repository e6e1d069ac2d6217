// The experimenter's socket: every session as it changes, and everything about the one that is open on the page.
//
// Events: "sessions" (all of them, in order of enrolment), "watched" (news of the open one), "trouble" (the lab cannot
// save, or null), and "crowding" (the lab is nearly full, or null).

import { Emitter } from "../common/emitter.js";
import { socketUrl } from "../common/root.js";

/** @import { CrowdingReply, LiveReply, TickExplanation, TroubleReply } from "../../tests/javascript/api.d.ts" */
/** @import { SessionEvent } from "./api.js" */
/**
 * News of the watched session; `since_start`: they take the place of what was told before.
 *
 * @typedef {object} Watched
 * @property {"watched"} type
 * @property {string} participant
 * @property {boolean} since_start
 * @property {TickExplanation[]} ticks
 * @property {SessionEvent[]} events
 * @property {string} [problem] why there are none: they cannot be shown
 */
/** @typedef {{ type: "overview", sessions: LiveReply[], gone: string[], trouble: TroubleReply | null, crowding: CrowdingReply | null }} Overview */

const FIRST_RETRY_MS = 500;
const LAST_RETRY_MS = 8000;
const REFUSED = 1008;
const GONE = 1006;
const SILENT_MS = 30_000; // the lab gives a sign of life every two seconds

/** @extends {Emitter<{ sessions: LiveReply[], watched: Watched, trouble: TroubleReply | null, crowding: CrowdingReply | null }>} */
export class LiveFeed extends Emitter {
  constructor() {
    super();
    /** @type {Map<string, LiveReply>} */
    this.sessions = new Map();
    /** @type {string | null} */
    this.watched = null;
    this.fed = false; // whether the lab has told everything at least once on this connection
    this._token = "";
    /** @type {WebSocket | null} */
    this._socket = null;
    this._tries = 0;
    this._retry = 0;
    this._heardMs = 0;
    setInterval(() => this._listen(), 2000);
  }

  /**
   * @param {string} token
   * @returns {void}
   */
  start(token) {
    this.stop();
    this._token = token;
    this._connect();
  }

  /** @returns {void} */
  stop() {
    clearTimeout(this._retry);
    this._token = "";
    const socket = this._socket;
    this._socket = null;
    socket?.close();
    this.fed = false;
  }

  /**
   * Which session to hear everything of; null for none.
   *
   * @param {string | null} participant
   * @returns {void}
   */
  watch(participant) {
    this.watched = participant;
    if (this.fed) this._sayWatch();
  }

  _connect() {
    const socket = new WebSocket(socketUrl("/dashboard/socket"));
    this._socket = socket;
    socket.addEventListener("open", () => socket.send(JSON.stringify({ type: "hello", token: this._token })));
    socket.addEventListener("message", (event) => socket === this._socket && this._receive(JSON.parse(event.data)));
    socket.addEventListener("close", (event) => socket === this._socket && this._closed(event.code));
  }

  /** A laptop that slept or a pulled cable says nothing: do not wait for TCP to notice. */
  _listen() {
    if (!this.fed || performance.now() - this._heardMs < SILENT_MS) return;
    const dead = this._socket;
    this._socket = null;
    dead?.close();
    this._closed(GONE);
  }

  /** @param {number} code why, as WebSockets number it */
  _closed(code) {
    this._socket = null;
    this.fed = false;
    if (code === REFUSED || !this._token) return;
    this._tries += 1;
    this._retry = setTimeout(() => this._connect(), Math.min(LAST_RETRY_MS, FIRST_RETRY_MS * 1.7 ** (this._tries - 1)));
  }

  /** @param {Overview | Watched} message */
  _receive(message) {
    this._heardMs = performance.now();
    if (message.type === "overview") {
      if (!this.fed) this.sessions.clear();
      for (const session of message.sessions) this.sessions.set(session.participant, session);
      for (const participant of message.gone) this.sessions.delete(participant);
      this._tries = 0;
      const first = !this.fed;
      this.fed = true;
      if (first && this.watched) this._sayWatch();
      this.emit("trouble", message.trouble);
      this.emit("crowding", message.crowding);
      this.emit("sessions", [...this.sessions.values()]);
    } else if (message.type === "watched" && message.participant === this.watched) this.emit("watched", message);
  }

  _sayWatch() {
    this._socket?.send(JSON.stringify({ type: "watch", participant: this.watched }));
  }
}
