// What is printed on the keys that drive. Keys drive by their place, and what is printed there differs: Z, Q, S, D in
// France where others have W, A, S, D. The browser tells it, or each key that is pressed anywhere on the page does.

import { Emitter } from "../common/emitter.js";
import { lasting } from "../common/store.js";

/** @typedef {Record<string, string>} Labels by the place of the key */

const KEPT = "key_labels";
const PLACES = ["KeyW", "KeyA", "KeyS", "KeyD", "KeyR", "KeyF", "KeyE", "KeyQ", "KeyC", "KeyO", "KeyV"];
/**
 * What differs from the place's own name on layouts that many people have: known from a few keys, or from one.
 *
 * @type {Labels[]}
 */
const FAMILIES = [
  {},
  { KeyW: "Z", KeyA: "Q", KeyQ: "A" },
  { KeyW: ",", KeyS: "O", KeyD: "E", KeyR: "P", KeyF: "U", KeyE: ".", KeyQ: "'", KeyC: "J", KeyO: "R", KeyV: "K" },
  { KeyS: "R", KeyD: "S", KeyR: "P", KeyF: "T", KeyE: "F", KeyO: "Y" },
];

/**
 * What a place is called where nothing else is known.
 *
 * @param {string} code
 * @returns {string}
 */
const ownName = (code) => code.replace(/^Key/, "");

/**
 * All labels, from those that were seen.
 *
 * @param {Labels} seen
 * @returns {Labels}
 */
export function labelsFrom(seen) {
  const family = FAMILIES.find((labels) =>
    Object.entries(seen).every(([code, label]) => (labels[code] ?? ownName(code)) === label),
  );
  return Object.fromEntries(PLACES.map((code) => [code, seen[code] ?? family?.[code] ?? ownName(code)]));
}

/**
 * The labels of this person's keyboard. Emits "labels" when they are known better.
 *
 * @extends {Emitter<{ labels: null }>}
 */
export class KeyLabels extends Emitter {
  constructor() {
    super();
    /** @type {Labels} */
    this._seen = lasting.get(KEPT, /** @type {Labels} */ ({}));
    addEventListener("keydown", (event) => this._learn(event), true);
    this._ask();
  }

  /**
   * What is printed on the key at this place; keys without a letter keep the name they are given.
   *
   * @param {string} code
   * @returns {string}
   */
  of(code) {
    return labelsFrom(this._seen)[code] ?? code;
  }

  /**
   * The place of a key by what it types, for keyboards that do not tell the place.
   *
   * @param {string} key
   * @returns {string | null}
   */
  placeOf(key) {
    const labels = labelsFrom(this._seen);
    return PLACES.find((code) => labels[code] === key.toUpperCase()) ?? null;
  }

  /** Only some browsers can be asked. */
  async _ask() {
    try {
      const layout = await /** @type {any} */ (navigator).keyboard.getLayoutMap();
      /** @type {[string, string | undefined][]} */
      const told = PLACES.map((code) => [code, layout.get(code)?.toUpperCase()]);
      this._know(Object.fromEntries(told.filter(([, label]) => label)));
    } catch {
      // learned from the keys that are pressed
    }
  }

  /** @param {KeyboardEvent} event */
  _learn({ code, key, ctrlKey, altKey, metaKey, isComposing }) {
    if (ctrlKey || altKey || metaKey || isComposing || !PLACES.includes(code) || [...key].length !== 1) return;
    const label = key.toUpperCase();
    if (this._seen[code] === label) return;
    // One key that types something else than before: the keyboard was changed, and nothing of the old one holds.
    this._know(code in this._seen ? { [code]: label } : { ...this._seen, [code]: label });
  }

  /** @param {{ [code: string]: string | undefined }} seen */
  _know(seen) {
    if (Object.keys(seen).length === 0) return;
    this._seen = /** @type {Labels} */ (seen);
    lasting.set(KEPT, seen);
    this.emit("labels");
  }
}
