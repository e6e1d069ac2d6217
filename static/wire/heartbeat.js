// The timer behind the heartbeat. It runs in a worker, whose timers a hidden page does not slow; where none can be had
// (a blocker, a policy, a file that is missing, a browser without workers) the page's own timer beats instead.

import { Emitter } from "../common/emitter.js";

/** @typedef {"threw" | "error" | "silent"} Why what became of the worker */

const SILENT_BEATS = 10;
const SILENT_LEAST_MS = 2000;

/**
 * Emits "beat", and "fallback" once when the page's own timer takes over.
 *
 * @extends {Emitter<{ beat: null, fallback: Why }>}
 */
export class HeartbeatTimer extends Emitter {
  constructor() {
    super();
    this._everyMs = 0;
    /** @type {Worker | null} */
    this._worker = null;
    this._timer = 0; // the page's own
    this._watch = 0;
    /** @type {Why | null} */
    this.fellBack = null;
  }

  /**
   * @param {number} everyMs 0 for never
   * @returns {void}
   */
  start(everyMs) {
    this._everyMs = everyMs;
    this._own(); // until the worker's first beat
    if (this.fellBack || (everyMs === 0 && this._worker === null)) return;
    try {
      this._worker ??= this._made();
      this._worker.postMessage(everyMs);
    } catch {
      return this._fallBack("threw");
    }
    this._listen();
  }

  /** A blocker may answer with an empty file, or a browser end a worker: then there is one, and it does not beat. */
  _listen() {
    clearTimeout(this._watch);
    const longest = Math.max(SILENT_LEAST_MS, SILENT_BEATS * this._everyMs);
    this._watch = this._everyMs > 0 ? setTimeout(() => this._fallBack("silent"), longest) : 0;
  }

  /** @returns {Worker} */
  _made() {
    const worker = new Worker(new URL("heartbeat_worker.js", import.meta.url));
    worker.addEventListener("message", () => {
      clearInterval(this._timer);
      this._listen();
      this.emit("beat");
    });
    worker.addEventListener("error", () => this._fallBack("error"));
    return worker;
  }

  /** @param {Why} why */
  _fallBack(why) {
    if (this.fellBack) return;
    this.fellBack = why;
    clearTimeout(this._watch);
    this._worker?.terminate();
    this._worker = null;
    this._own();
    this.emit("fallback", why);
  }

  _own() {
    clearInterval(this._timer);
    if (this._everyMs > 0) this._timer = setInterval(() => this.emit("beat"), this._everyMs);
  }
}
