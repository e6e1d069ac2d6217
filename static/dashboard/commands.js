// What the experimenter can do with a session: the buttons' words, the question before each, and what was done.
//
// Whether an act is possible now, and if not why, is said by the lab (`session.why_not`).

import { problemText } from "../common/problem.js";
import { ask } from "../common/shell.js";

/** @import { Field, Toasts } from "../common/shell.js" */
/** @import { Api } from "./api.js" */
/**
 * @typedef {object} Command
 * @property {string} name as the API knows it
 * @property {string} label
 * @property {string} done what is said afterwards
 * @property {(who: string) => string} title
 * @property {string} confirm
 * @property {string[]} text
 * @property {Field} [field]
 * @property {boolean} [danger]
 */

const WORDS = "Kept in the lab, never exported";

/** @type {Command[]} */
export const COMMANDS = [
  {
    name: "start",
    label: "Start",
    done: "started.",
    title: (who) => `Start for ${who}?`,
    confirm: "Start",
    text: [
      "As if the participant had pressed the Start button of the practice or trial that waits. Make sure that they are ready: the robot listens to their controls at once.",
    ],
  },
  {
    name: "pause",
    label: "Pause",
    done: "paused.",
    title: (who) => `Pause ${who}?`,
    confirm: "Pause session",
    text: ["The robot stops at once. The participant sees that the session is paused."],
    field: { label: `Reason (optional. ${WORDS})`, required: false },
  },
  {
    name: "resume",
    label: "Resume",
    done: "resumed.",
    title: (who) => `Resume ${who}?`,
    confirm: "Resume session",
    text: ["The session goes on where it was paused, once no other cause keeps it paused."],
    field: { label: `Remark (optional. ${WORDS})`, required: false },
  },
  {
    name: "free_arm",
    label: "Free the arm",
    done: "the arm is freed with the next tick.",
    title: (who) => `Free the arm of ${who}?`,
    confirm: "Free the arm",
    text: [
      "The pick-and-place under way begins again: the arm goes back to its start, and the object to where it stood. Both attempts stay in the data, and both count.",
      "In a pause it is done as soon as the session goes on.",
    ],
    field: { label: `Reason (optional. ${WORDS})`, required: false },
  },
  {
    name: "repeat_practice",
    label: "Repeat practice",
    done: "goes back to practice.",
    title: (who) => `Let ${who} practise once more?`,
    confirm: "Repeat practice",
    text: [
      "The trial that waits for its start gives way to its practice. What was recorded of the practice so far stays, and the new ticks follow it.",
    ],
    field: { label: `Reason (optional. ${WORDS})`, required: false },
  },
  {
    name: "abort_trial",
    label: "Abort trial",
    done: "the trial is aborted, the session goes on.",
    danger: true,
    title: (who) => `Abort the trial of ${who}?`,
    confirm: "Abort trial",
    text: [
      "Only this trial ends. What was recorded of it stays, marked as aborted, and no analysis counts it. The session goes on with the questionnaires after this trial, then the next one.",
      "This cannot be taken back: a trial is not run twice.",
    ],
    field: { label: `Reason (${WORDS.toLowerCase()})`, required: true, missing: "Give a reason." },
  },
  {
    name: "abort",
    label: "Abort session",
    done: "the session is aborted.",
    danger: true,
    title: (who) => `Abort the whole session of ${who}?`,
    confirm: "Abort session",
    text: [
      "The session ends for good and its slot in the counterbalancing is given to the next participant. What was recorded stays, marked as aborted.",
    ],
    field: { label: `Reason (${WORDS.toLowerCase()})`, required: true, missing: "Give a reason." },
  },
];

/**
 * Asks, does it, and says what came of it. Resolves when all is done.
 *
 * @param {Api} api
 * @param {Toasts} toasts
 * @param {string} participant
 * @param {Command} command
 * @returns {Promise<void>}
 */
export async function act(api, toasts, participant, command) {
  const { name, title, text, field = null, confirm, danger = false, done } = command;
  const reason = await ask({ title: title(participant), text, field, confirm, danger, testid: `${name}-dialog` });
  if (reason === null) return;
  try {
    await api.act(participant, name, reason);
    toasts.show(`${participant}: ${done}`);
  } catch (error) {
    // Another experimenter, or the participant, was quicker: the lab says how things stand.
    toasts.show(`${participant}: nothing was done. ${problemText(error)}`, { problem: true });
  }
}

/**
 * A button that can always be reached: when it can do nothing it says why, to eyes and to screen readers.
 *
 * @param {HTMLButtonElement} button
 * @param {() => string} why "" when it can act
 * @param {Toasts} toasts
 * @param {() => void} run
 * @returns {void}
 */
export function reasoned(button, why, toasts, run) {
  button.addEventListener("click", () => {
    const reason = why();
    if (reason) toasts.show(reason);
    else run();
  });
}

/**
 * Shows whether the button can act now.
 *
 * @param {HTMLButtonElement} button
 * @param {string} why "" when it can act
 * @returns {void}
 */
export function say(button, why) {
  button.setAttribute("aria-disabled", String(why !== ""));
  button.title = why;
  button.setAttribute("aria-description", why);
}
