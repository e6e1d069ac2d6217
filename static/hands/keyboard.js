// The keyboard as an equal way to drive. Keys by position (so that WASD stay where they are on any layout).

import { Emitter } from "../common/emitter.js";
import { t, tc } from "../common/language.js";
import { lasting } from "../common/store.js";
import { KeyLabels } from "./layout.js";

/** @import { Input } from "../../tests/javascript/wire.d.ts" */
/** @import { Direction } from "./mapping.js" */
/** @typedef {NonNullable<Input["gripper"]>} GripperPress */
/** @typedef {{ device: "gamepad" | "keyboard", pad_id: string | null }} ChosenDevice */
/** @typedef {{ hands: null, gripper: GripperPress, view: null }} HandsEvents what every device emits */

/** @type {Record<string, [axis: number, sign: number]>} */
const AXES = {
  KeyW: [0, 1],
  ArrowUp: [0, 1],
  KeyS: [0, -1],
  ArrowDown: [0, -1],
  KeyA: [1, 1],
  ArrowLeft: [1, 1],
  KeyD: [1, -1],
  ArrowRight: [1, -1],
  KeyR: [2, 1],
  KeyE: [2, 1],
  PageUp: [2, 1],
  KeyF: [2, -1],
  KeyQ: [2, -1],
  PageDown: [2, -1],
};
const SWITCH_VIEW = "KeyV";
/** @type {Record<string, GripperPress>} */
const GRIPPER = { Space: "close", KeyC: "close", Enter: "open", NumpadEnter: "open", KeyO: "open" };

/** Keys without a place of their own, as some keyboards send them. */
/** @type {Record<string, string>} */
const BY_KEY = { " ": "Space", arrowup: "ArrowUp", arrowdown: "ArrowDown", arrowleft: "ArrowLeft" };
for (const code of ["ArrowRight", "PageUp", "PageDown", "Enter"]) BY_KEY[code.toLowerCase()] = code;

/** While one of these keys is down, or a menu or another window is in front, a release may never be heard of. */
const TAKES_KEYS = new Set(["Meta", "OS", "Alt", "AltGraph", "ContextMenu"]);
const LETS_GO = [
  "blur",
  "pagehide",
  "freeze",
  "beforeprint",
  "contextmenu",
  "dragstart",
  "visibilitychange",
  "fullscreenchange",
  "pointerlockchange",
  "compositionstart",
];
const TYPING_MS = 1000; // after the last key in a field, the next may still be meant for it

/**
 * What the pages print: what it does, and the keys for it, by place or by name.
 *
 * @type {[what: string, first: string[], second: string[]][]}
 */
export const LEGEND = [
  [t("Forward, back"), ["KeyW", "KeyS"], ["↑", "↓"]],
  [t("Left, right"), ["KeyA", "KeyD"], ["←", "→"]],
  [t("Up, down"), ["KeyR", "KeyF"], [tc("key", "PgUp"), tc("key", "PgDn")]],
  [t("Grip, let go"), ["KeyC", "KeyO"], [tc("key", "Space"), tc("key", "Enter")]],
  [t("Switch the view"), ["KeyV"], []],
];

/** @param {EventTarget | null} target */
function isTyping(target) {
  return target instanceof Element && target.closest("input, textarea, select, dialog, [contenteditable]") !== null;
}

/** @param {EventTarget | null} target */
function isButton(target) {
  return target instanceof Element && target.closest("button, a[href], summary, [role=button]") !== null;
}

/**
 * Emits "hands" on every change of direction, "gripper" and "view" once a press, and "unknown" for a key of which the
 * keyboard does not say which it is.
 *
 * @extends {Emitter<HandsEvents & { unknown: null }>}
 */
export class Keyboard extends Emitter {
  /** @param {KeyLabels} [labels] */
  constructor(labels = new KeyLabels()) {
    super();
    this.labels = labels;
    /** @type {Node | null} */
    this.scope = null; // null = off; a node: keys pressed inside it drive
    /** @type {Set<string>} */
    this.down = new Set();
    this._typedMs = Number.NEGATIVE_INFINITY; // when a key of a field was last pressed or let go
    /** @type {Set<string>} */
    this._typed = new Set(); // pressed in a field and not let go since
    addEventListener("keydown", (event) => this._keyDown(event));
    addEventListener("keyup", (event) => this._keyUp(event));
    for (const name of LETS_GO) addEventListener(name, () => this.release(), true);
    document.addEventListener("focusin", (event) => this.down.size && isTyping(event.target) && this.release());
  }

  /**
   * Keys drive while they are pressed inside `scope`; null turns them off and lets go of everything.
   *
   * @param {Node | null} scope
   * @returns {void}
   */
  listen(scope) {
    this.scope = scope;
    this.release();
  }

  /**
   * Held keys as [x, y, z]; opposite keys cancel.
   *
   * @returns {Direction}
   */
  direction() {
    const pairs = [...this.down].map((code) => AXES[code]);
    const held = (/** @type {number} */ axis, /** @type {number} */ sign) =>
      Number(pairs.some((pair) => pair?.[0] === axis && pair[1] === sign));
    return /** @type {Direction} */ ([0, 1, 2].map((axis) => held(axis, 1) - held(axis, -1)));
  }

  /**
   * Lets go of every key; one that is still down counts when it is pressed anew.
   *
   * @returns {void}
   */
  release() {
    if (this.down.size === 0) return;
    this.down.clear();
    this._changed();
  }

  /**
   * The place of a key, as far as it can be told; "" for none.
   *
   * @param {KeyboardEvent} event
   * @returns {string}
   */
  _placeOf({ code, key }) {
    if (code && code !== "Unidentified") return code;
    return BY_KEY[key.toLowerCase()] ?? this.labels.placeOf(key) ?? "";
  }

  /** @param {KeyboardEvent} event */
  _keyDown(event) {
    if (TAKES_KEYS.has(event.key)) this.release();
    if (isTyping(event.target)) {
      this._typed.add(event.code);
      this._typedMs = event.timeStamp;
    } else if (!event.repeat) this._typed.delete(event.code); // its release went elsewhere
    if (!this.scope || event.isComposing || event.ctrlKey || event.altKey || event.metaKey || isTyping(event.target))
      return;
    if (this.scope !== document && !(event.target instanceof Node && this.scope.contains(event.target))) return;
    const code = this._placeOf(event);
    if (code === "" && (event.key === "Unidentified" || event.key === "Process")) this.emit("unknown");
    const gripper = GRIPPER[code];
    const isLate = event.timeStamp - this._typedMs < TYPING_MS;
    if (gripper) {
      if (isButton(event.target) && !code.startsWith("Key")) return; // Space and Enter press that button
      event.preventDefault();
      if (isLate)
        this._typedMs = event.timeStamp; // it was meant for the field that has just gone
      else if (!event.repeat) this.emit("gripper", gripper);
      return;
    }
    if (code === SWITCH_VIEW) {
      event.preventDefault();
      if (!event.repeat) this.emit("view");
      return;
    }
    if (!(code in AXES)) {
      if (isLate) this._typedMs = event.timeStamp;
      return;
    }
    event.preventDefault();
    if (event.repeat || this.down.has(code)) return;
    this.down.add(code);
    this._changed();
  }

  /** @param {KeyboardEvent} event */
  _keyUp(event) {
    if (this._typed.delete(event.code)) this._typedMs = event.timeStamp; // it was held for so long
    if (TAKES_KEYS.has(event.key)) this.release(); // macOS never tells the release of what went up meanwhile
    if (this.down.delete(this._placeOf(event))) this._changed();
  }

  _changed() {
    this.emit("hands");
  }
}

/** Which device the person chose in this session; null before the set-up. */
export const chosenDevice = {
  /**
   * @param {string} session
   * @returns {ChosenDevice | null}
   */
  get: (session) => lasting.get(`${session}:device`, null),
  /**
   * @param {string} session
   * @param {ChosenDevice} device
   * @returns {boolean}
   */
  set: (session, device) => lasting.set(`${session}:device`, device),
};
