// Whether the robot is to be seen: what the scene's frame says of itself (app/web/scene_proxy.py), and what it fails to say
// in time. A picture that is gone is loaded again by itself.

import { Emitter } from "../common/emitter.js";

/** @typedef {"no_webgl" | "context_lost" | "not_loaded" | "connection"} Missing why there is no picture */

const LOAD_MS = 15_000; // a slow line may take so long for the first picture
const LOST_MS = 1500; // a connection that comes back sooner is not missed
const AGAIN_MS = 3000;
const LATER_MS = 15_000;

/**
 * Emits "change" when the picture comes or goes, and "connection" whenever its frame tells whether it has one.
 *
 * @extends {Emitter<{ change: null, connection: boolean }>}
 */
export class PictureWatch extends Emitter {
  /** @param {HTMLIFrameElement} frame */
  constructor(frame) {
    super();
    this.frame = frame;
    this.there = false;
    /** @type {Missing | null} */
    this.why = null; // null while it is there, or on its way
    this._connected = false;
    this._draws = true; // until the frame says otherwise
    this._timer = 0;
    this._again = 0;
    /** @type {(event: MessageEvent) => void} */
    this._message = (event) => {
      if (event.source !== this.frame.contentWindow) return;
      const { type, connected, drawn, why } = event.data ?? {};
      if (type === "scene") {
        this._on(Boolean(connected), this._draws, "connection");
        this.emit("connection", Boolean(connected));
      } else if (type === "picture") this._on(this._connected, Boolean(drawn), why ?? "context_lost");
    };
    addEventListener("message", this._message);
  }

  /**
   * The frame has been given a page to load.
   *
   * @returns {void}
   */
  loading() {
    clearTimeout(this._again);
    this._connected = false;
    this._draws = true;
    const why = this.there ? null : this.why; // one that is missed stays missed until it is seen
    this._say(false, why);
    this._after(LOAD_MS, "not_loaded");
  }

  /**
   * There is no scene here, and nothing to be missed.
   *
   * @returns {void}
   */
  none() {
    this._clear();
    this._say(true, null);
  }

  /**
   * Loads it again.
   *
   * @returns {void}
   */
  reload() {
    if (!this.frame.src) return;
    this.frame.src = this.frame.getAttribute("src") ?? "";
    this.loading();
  }

  /** @returns {void} */
  close() {
    removeEventListener("message", this._message);
    this._clear();
  }

  /**
   * @param {boolean} connected
   * @param {boolean} draws
   * @param {Missing} why
   */
  _on(connected, draws, why) {
    const was = this._connected;
    this._connected = connected;
    this._draws = draws;
    if (connected && draws) {
      this._clear();
      this._say(true, null);
    } else if (!draws) {
      this._clear();
      this._say(false, why);
      this._reloadAfter(why === "no_webgl" ? LATER_MS : AGAIN_MS);
    } else if (was && !connected) this._after(LOST_MS, "connection");
  }

  /**
   * @param {number} ms
   * @param {Missing} why
   */
  _after(ms, why) {
    clearTimeout(this._timer);
    this._timer = setTimeout(() => {
      this._say(false, this.why ?? why);
      this._reloadAfter(LATER_MS);
    }, ms);
  }

  /** @param {number} ms */
  _reloadAfter(ms) {
    clearTimeout(this._again);
    this._again = setTimeout(() => this.reload(), ms);
  }

  _clear() {
    clearTimeout(this._timer);
    clearTimeout(this._again);
  }

  /**
   * @param {boolean} there
   * @param {Missing | null} why
   */
  _say(there, why) {
    if (this.there === there && this.why === why) return;
    this.there = there;
    this.why = why;
    this.emit("change");
  }
}
