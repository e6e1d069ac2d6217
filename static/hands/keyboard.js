// The keyboard as an equal way to drive. Keys by position (so that WASD stay where they are on any layout).

import { Emitter } from "../common/emitter.js";
import { lasting } from "../common/store.js";

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

/**
 * What the pages print: what it does, and the keys for it.
 *
 * @type {[what: string, first: string[], second: string[]][]}
 */
export const LEGEND = [
  ["Forward, back", ["W", "S"], ["↑", "↓"]],
  ["Left, right", ["A", "D"], ["←", "→"]],
  ["Up, down", ["R", "F"], ["PgUp", "PgDn"]],
  ["Grip, let go", ["C", "O"], ["Space", "Enter"]],
  ["Switch the view", ["V"], []],
];

/** @param {EventTarget | null} target */
function isTyping(target) {
  return target instanceof Element && target.closest("input, textarea, select, dialog, [contenteditable]") !== null;
}

/** @param {EventTarget | null} target */
function isButton(target) {
  return target instanceof Element && target.closest("button, a[href], summary") !== null;
}

/**
 * Emits "hands" on every change of direction, "gripper" and "view" once a press.
 *
 * @extends {Emitter<HandsEvents>}
 */
export class Keyboard extends Emitter {
  constructor() {
    super();
    /** @type {Node | null} */
    this.scope = null; // null = off; a node: keys pressed inside it drive
    /** @type {Set<string>} */
    this.down = new Set();
    addEventListener("keydown", (event) => this._keyDown(event));
    addEventListener("keyup", (event) => this._keyUp(event));
    addEventListener("blur", () => this.release());
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

  /** @returns {void} */
  release() {
    if (this.down.size === 0) return;
    this.down.clear();
    this._changed();
  }

  /** @param {KeyboardEvent} event */
  _keyDown(event) {
    if (!this.scope || event.ctrlKey || event.altKey || event.metaKey || isTyping(event.target)) return;
    if (this.scope !== document && !(event.target instanceof Node && this.scope.contains(event.target))) return;
    const gripper = GRIPPER[event.code];
    if (gripper) {
      if (isButton(event.target) && !event.code.startsWith("Key")) return; // Space and Enter press that button
      event.preventDefault();
      if (!event.repeat) this.emit("gripper", gripper);
      return;
    }
    if (event.code === SWITCH_VIEW) {
      event.preventDefault();
      if (!event.repeat) this.emit("view");
      return;
    }
    if (!(event.code in AXES)) return;
    event.preventDefault();
    if (event.repeat || this.down.has(event.code)) return;
    this.down.add(event.code);
    this._changed();
  }

  /** @param {KeyboardEvent} event */
  _keyUp(event) {
    if (this.down.delete(event.code)) this._changed();
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
