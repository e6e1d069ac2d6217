// Submits and notes that the lab has not acknowledged yet: kept over reloads and lost connections, resent until they are.

import { lasting, randomHex, tab } from "../common/store.js";

/** @import { Note, Submit } from "../../tests/javascript/wire.d.ts" */
/** @typedef {Submit | Note} Kept what the lab acknowledges by its id */

const MAX_KEPT = 500;

export class Outbox {
  /**
   * `name` separates sessions and roles, e.g. "4f2a" or "4f2a:panel".
   *
   * @param {string} name
   */
  constructor(name) {
    this.name = `${name}:outbox`;
    this.client = tab.get(`${name}:client`, randomHex(8));
    tab.set(`${name}:client`, this.client);
    this.load = randomHex(4); // of this page: no clock, which may be set back
    this.counter = 0;
    /** @type {Kept[]} */
    this.memory = []; // what storage refused to keep
  }

  /**
   * Unacknowledged messages, oldest first.
   *
   * @returns {Kept[]}
   */
  waiting() {
    return [...this._stored(), ...this.memory];
  }

  /**
   * Gives the message its id and keeps it; returns it. The same id is never used for two messages.
   *
   * @param {Omit<Submit, "id"> | Omit<Note, "id">} message
   * @returns {Kept}
   */
  keep(message) {
    this.counter += 1;
    const kept = /** @type {Kept} */ ({ ...message, id: `${this.client}.${this.load}.${this.counter}` });
    const stored = this._stored();
    if (stored.length >= MAX_KEPT || !lasting.set(this.name, [...stored, kept])) this.memory.push(kept);
    return kept;
  }

  /**
   * The lab has it, or refused it for good.
   *
   * @param {string} id
   * @returns {void}
   */
  drop(id) {
    this.memory = this.memory.filter((message) => message.id !== id);
    const stored = this._stored();
    const left = stored.filter((message) => message.id !== id);
    if (left.length === 0) lasting.remove(this.name);
    else if (left.length !== stored.length) lasting.set(this.name, left);
  }

  /** @returns {Kept[]} */
  _stored() {
    return lasting.get(this.name, []);
  }
}
