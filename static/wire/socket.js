// The page's side of the wire (protocol 1, see app/wire.py): hello, reconnect, resend, take-over, ping.
//
// States: connecting → open (the lab said welcome) → lost → connecting …; superseded, denied, outdated, unusable and too_many are final
// until the person acts. Events: "state", one per message type ("page", "tick", …), and a cancelable "refused"
// for the lab's typed errors.

import { Emitter } from "../common/emitter.js";
import { Outbox } from "./outbox.js";
import { Received } from "./received.js";

/** @import { ConnectionState } from "../common/shell.js" */
/** @import * as wire from "../../tests/javascript/wire.d.ts" */
/** @import { Kept } from "./outbox.js" */
/** @typedef {wire.Error & { stale: boolean }} Refusal `stale`: it answers what an earlier life of this page sent */
/**
 * @typedef {{ [Message in Exclude<wire.ServerMessage, wire.Error> as Message["type"]]: Message }
 *   & { state: ConnectionState, refused: Refusal }} LabEvents
 */

export const PROTOCOL = 1;
const FIRST_RETRY_MS = 400;
const LAST_RETRY_MS = 8000;
const RESEND_MS = 4000;
const FINAL = new Set(["superseded", "denied", "outdated", "unusable", "too_many", "closed"]);

/** @extends {Emitter<LabEvents>} */
export class LabSocket extends Emitter {
  /** @param {{ url: string, name: string }} where `name` is what the outbox is kept under */
  constructor({ url, name }) {
    super();
    this.url = url;
    this.outbox = new Outbox(name);
    this.received = new Received({ socket: this, name });
    /** @type {ConnectionState} */
    this.state = "closed";
    /** @type {wire.Welcome | null} */
    this.welcome = null;
    /** @type {wire.Panel | null} */
    this.panel = null; // the second device, as last told
    this.saves = true; // whether the lab can, as last told
    /** @type {WebSocket | null} */
    this._socket = null;
    /** @type {Map<string, { resolve: (ack: wire.Ack) => void, reject: (refused: Error) => void }>} */
    this._pending = new Map(); // by id, for what this page life submitted
    /** @type {Map<string, number>} */
    this._sentMs = new Map(); // by id, when it was last sent
    this._tries = 0;
    this._lastHeardMs = 0;
    this._pingGapMs = 0;
    this._lastPingMs = 0;
    this._retry = 0;
    setInterval(() => this._watch(), 1000);
    addEventListener("online", () => this._retryNow());
    document.addEventListener("visibilitychange", () => document.hidden || this._retryNow());
  }

  /** @returns {boolean} */
  get open() {
    return this.state === "open";
  }

  /** @returns {void} */
  connect() {
    clearTimeout(this._retry);
    this._setState("connecting");
    const socket = new WebSocket(this.url);
    this._socket = socket;
    socket.addEventListener("open", () => {
      this._lastHeardMs = performance.now();
      socket.send(JSON.stringify({ type: "hello", protocol: PROTOCOL, client: this.outbox.client }));
    });
    socket.addEventListener("message", (event) => socket === this._socket && this._receive(event.data));
    socket.addEventListener("close", () => socket === this._socket && this._closed());
  }

  /**
   * A step of the study. Resolves when it is on disk, rejects with the lab's error when it is refused.
   *
   * @param {wire.Submit["step"]} step
   * @param {Record<string, unknown>} [data]
   * @returns {Promise<wire.Ack>}
   */
  submit(step, data = {}) {
    return this._deliver({ type: "submit", step, data });
  }

  /**
   * Something the page noticed. Nobody waits for it, but it is resent like a submit.
   *
   * @param {wire.Note["name"]} name one of the notes the lab knows; a page of your own has `own.NAME`
   * @param {NonNullable<wire.Note["data"]>} [data]
   * @returns {void}
   */
  note(name, data = {}) {
    this._deliver({ type: "note", name, data }).catch(() => {});
  }

  /**
   * For what is worthless late (inputs, heartbeats, views): dropped while there is no connection.
   *
   * @param {wire.ClientMessage} message
   * @returns {boolean} whether it went out
   */
  send(message) {
    const socket = this._socket;
    if (!this.open || socket?.readyState !== WebSocket.OPEN) return false;
    socket.send(JSON.stringify(message));
    return true;
  }

  /**
   * After "superseded": take the session back to this tab.
   *
   * @returns {void}
   */
  takeOver() {
    if (this.state === "superseded") this.connect();
  }

  /** @returns {void} */
  close() {
    this._setState("closed");
    this._socket?.close();
  }

  /**
   * @param {Omit<wire.Submit, "id"> | Omit<wire.Note, "id">} message
   * @returns {Promise<wire.Ack>}
   */
  _deliver(message) {
    const kept = this.outbox.keep(message);
    /** @type {Promise<wire.Ack>} */
    const settled = new Promise((resolve, reject) => {
      this._pending.set(kept.id, { resolve, reject });
    });
    this._transmit(kept);
    return settled;
  }

  /** @param {Kept} message */
  _transmit(message) {
    if (this.send(message)) this._sentMs.set(message.id, performance.now());
  }

  /** @param {string} text */
  _receive(text) {
    this._lastHeardMs = performance.now();
    /** @type {wire.ServerMessage} */
    let message;
    try {
      message = JSON.parse(text);
    } catch {
      return;
    }
    switch (message.type) {
      case "welcome":
        if (message.protocol !== PROTOCOL) return this._end("outdated");
        this._tries = 0;
        this.welcome = message;
        this._setState("open");
        for (const kept of this.outbox.waiting()) this._transmit(kept);
        break;
      case "ack":
        this._acknowledged(message);
        break;
      case "panel":
        this.panel = message;
        break;
      case "saves":
        this.saves = message.works;
        break;
      case "error":
        return this._refused(message);
      case "superseded":
        this.emit("superseded", message);
        return this._end("superseded");
      case "ping": {
        const now = performance.now();
        if (this._lastPingMs) this._pingGapMs = Math.max(this._pingGapMs, now - this._lastPingMs);
        this._lastPingMs = now;
        this.send({ type: "pong", n: message.n });
        break;
      }
      default:
    }
    this.dispatchEvent(new CustomEvent(message.type, { detail: message }));
  }

  /** @param {wire.Ack} message */
  _acknowledged(message) {
    const kept = this.outbox.waiting().find((one) => one.id === message.id);
    this._settle(message.id)?.resolve(message);
    this.received.acknowledged(kept);
  }

  /** @param {string} id */
  _settle(id) {
    this.outbox.drop(id);
    const waiting = this._pending.get(id);
    this._pending.delete(id);
    this._sentMs.delete(id);
    return waiting;
  }

  /** @param {wire.Error} message */
  _refused(message) {
    if (message.code === "protocol" && message.field === "protocol") return this._end("outdated");
    // An internal error says nothing about the step itself: it stays in the outbox and is tried again.
    const waiting = message.id && message.code !== "internal" ? this._settle(message.id) : null;
    const stale = Boolean(message.id) && message.code !== "internal" && !waiting; // from before a reload
    const event = new CustomEvent("refused", { detail: { ...message, stale }, cancelable: true });
    this.dispatchEvent(event);
    waiting?.reject(Object.assign(new Error(message.message), { code: message.code, field: message.field }));
  }

  _closed() {
    this._socket = null;
    if (FINAL.has(this.state)) return;
    this._setState("lost");
    this._tries += 1;
    if (this._tries % 3 === 1) this._askWhy();
    const wait = Math.min(LAST_RETRY_MS, FIRST_RETRY_MS * 1.7 ** (this._tries - 1));
    this._retry = setTimeout(() => this.connect(), wait * (0.8 + 0.4 * Math.random()));
  }

  /** A browser does not say why a socket was refused; the page's own address does. */
  async _askWhy() {
    try {
      const answer = await fetch(location.pathname, { method: "GET", cache: "no-store" });
      if ((answer.status === 401 || answer.status === 403) && !this.open) return this._end("denied");
      const told = await fetch(new URL("why", location.href), { cache: "no-store" });
      const why = told.ok ? (await told.json()).why : "";
      if ((why === "unusable" || why === "too_many") && !this.open) this._end(why);
    } catch {
      // the lab is not reachable: keep trying
    }
  }

  /** @param {ConnectionState} state */
  _end(state) {
    clearTimeout(this._retry);
    this._setState(state);
    this._socket?.close();
  }

  _retryNow() {
    if (this.state === "lost") this.connect();
  }

  _watch() {
    const now = performance.now();
    if (this.open) {
      const silence = now - this._lastHeardMs;
      if (this._pingGapMs && silence > Math.max(10_000, 4 * this._pingGapMs)) {
        // The other side is gone without a word (a laptop that slept, a cable): do not wait for TCP to notice.
        const dead = this._socket;
        this._socket = null;
        dead?.close();
        this._closed();
        return;
      }
      for (const kept of this.outbox.waiting()) {
        if (now - (this._sentMs.get(kept.id) ?? 0) > RESEND_MS) this._transmit(kept);
      }
    }
  }

  /** @param {ConnectionState} state */
  _setState(state) {
    if (this.state === state) return;
    this.state = state;
    this.emit("state", state);
  }
}
