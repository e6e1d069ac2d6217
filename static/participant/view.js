// What the views of the participant's page have in common. Types only: no module loads this file.

/** @import { Page } from "../../tests/javascript/wire.d.ts" */
/** @import { Pads } from "../hands/gamepad.js" */
/** @import { Input } from "../hands/input.js" */
/** @import { Keyboard } from "../hands/keyboard.js" */
/** @import { Sound } from "../readings/sound.js" */
/** @import { LabSocket } from "../wire/socket.js" */

/**
 * What there is once on a page, whatever it shows.
 *
 * @typedef {object} Context
 * @property {string} session
 * @property {LabSocket} socket
 * @property {Sound} sound
 * @property {Keyboard} keyboard
 * @property {Pads} pads
 * @property {Input} input
 * @property {() => void} closeDialogs
 */
/**
 * What stands on the page in one state of the study.
 *
 * @typedef {object} View
 * @property {HTMLElement} element
 * @property {() => void} [close] called when another view takes its place
 * @property {(open: boolean) => void} [dialog] called when a dialog comes over it, or goes
 */
/**
 * The lab's word on what to show, with the content of its state (study/flow/pages).
 *
 * @template Content
 * @template {string} [State=string]
 * @typedef {Omit<Page, "state" | "content"> & { state: State, content: Content }} PageOf
 */

export {};
