// What this tab was told is on disk: of each practice and trial the last tick, and how many submits and notes. Reported
// once the study is over and nothing waits any more: the lab compares it with what it has.

import { tab } from "../common/store.js";

/** @import { Page, Tick } from "../../tests/javascript/wire.d.ts" */
/** @import { LabSocket } from "./socket.js" */
/** @typedef {{ acknowledged: number, ticks: Record<string, number> }} Count */

const NOTE = "received";
const OVER = new Set(["done", "withdrawn", "aborted", "screened_out"]);
const DRIVEN = new Set(["practice", "trial"]);

export class Received {
  /** @param {{ socket: LabSocket, name: string }} wiring `name` separates sessions and roles, as the outbox's does */
  constructor({ socket, name }) {
    this.socket = socket;
    this.name = `${name}:received`;
    /** @type {Count} */
    this.count = tab.get(this.name, { acknowledged: 0, ticks: {} });
    this.phase = "";
    this.over = false;
    this.reported = false;
    socket.addEventListener("page", (event) => this._onPage(event.detail));
    socket.addEventListener("tick", (event) => this._onTick(event.detail));
  }

  /**
   * The lab has acknowledged this message of the tab's.
   *
   * @param {import("./outbox.js").Kept | undefined} message
   * @returns {void}
   */
  acknowledged(message) {
    if (!message || (message.type === "note" && message.name === NOTE)) return;
    this.count.acknowledged += 1;
    tab.set(this.name, this.count);
    this._report();
  }

  /** @param {Page} page */
  _onPage(page) {
    this.phase = DRIVEN.has(page.state) ? `${page.state} ${page.trial}` : this.phase;
    this.over = OVER.has(page.state);
    this._report();
  }

  /** @param {Tick} tick */
  _onTick(tick) {
    if (!this.phase) return;
    this.count.ticks[this.phase] = Math.max(this.count.ticks[this.phase] ?? 0, tick.tick + 1);
    tab.set(this.name, this.count);
  }

  _report() {
    if (!this.over || this.reported || this.socket.outbox.waiting().length > 0) return;
    this.reported = true;
    this.socket.note(NOTE, { ...this.count });
  }
}
