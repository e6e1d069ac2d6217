// The way out of an arm that is stuck: a button that asks before it frees it, and what is said when time runs out.

import { h, icon, setText } from "../common/dom.js";
import { t, tn } from "../common/language.js";
import { ask } from "../common/shell.js";

/** @import { Tick } from "../../tests/javascript/wire.d.ts" */
/** @import { LabSocket } from "../wire/socket.js" */

const TITLE = t("Free the arm?");
const TEXT = [
  t(
    "The arm goes back to its start, and the object of this task stands where it stood. You then pick it up once more.",
  ),
  t("What you did so far counts as well, so there is nothing to be gained: do it when the arm does not come free."),
];

/**
 * A button that can be pressed while somebody drives. It takes the hands off first, and a second press to mean it: keys
 * held for driving cannot free the arm, since the harmless answer has the focus.
 */
export class FreeButton {
  /**
   * @param {object} wiring
   * @param {Pick<LabSocket, "submit">} wiring.socket
   * @param {(open: boolean) => void} wiring.onDialog
   */
  constructor({ socket, onDialog }) {
    this.socket = socket;
    this.onDialog = onDialog;
    this.waiting = false;
    /** @type {AbortController | null} */
    this.asking = null;
    this.button = h(
      "button",
      { type: "button", class: "secondary small", data: { testid: "free-button" } },
      icon("reset"),
      h("span", {}, t("Free the arm")),
    );
    this.said = h("p", { class: "free-said", role: "status", hidden: true, data: { testid: "free-said" } });
    this.element = h("section", { class: "free-arm", "aria-label": t("If the arm is stuck") }, this.button, this.said);
    this.button.addEventListener("click", () => this._ask());
  }

  /**
   * Whether there is an arm to be freed; one that goes back already is none, and nobody is asked about it any longer.
   *
   * @param {"yes" | "no" | "lost" | "returning"} possible
   * @returns {void}
   */
  offer(possible) {
    this.button.disabled = possible !== "yes" || this.waiting;
    if (possible === "returning" || possible === "no") this.close();
  }

  /** @returns {void} */
  close() {
    this.said.hidden = true;
    this.asking?.abort();
  }

  async _ask() {
    this.onDialog(true);
    this.asking = new AbortController();
    let answer = null;
    try {
      answer = await ask({
        title: TITLE,
        text: TEXT,
        confirm: t("Free the arm"),
        back: t("Go on driving"),
        danger: true,
        testid: "free-dialog",
        signal: this.asking.signal,
      });
    } finally {
      this.asking = null;
      this.onDialog(false);
    }
    if (answer === null || this.waiting) return;
    this.waiting = true;
    this.button.disabled = true;
    try {
      await this.socket.submit("free_arm");
      setText(this.said, t("The arm goes back as soon as the round runs."));
      this.said.hidden = false;
    } catch {
      // said in a message
    } finally {
      this.waiting = false;
    }
  }
}

/** Calm words in the last minute of a time limit: no seconds that run. */
export class TimeWords {
  constructor() {
    this.element = h("p", { class: "time-words", role: "status", data: { testid: "time-words" } });
  }

  /**
   * @param {Tick["ending"]} ending
   * @returns {void}
   */
  show(ending) {
    const words = {
      task: t("The time for this object is nearly over. What comes next follows by itself."),
      trial: t("The time for this round is nearly over. What comes next follows by itself."),
    };
    setText(this.element, ending ? words[ending] : "");
    this.element.hidden = !ending;
  }
}

/** @typedef {{ task_s?: number, trial_s?: number }} Limits seconds; what is missing has no limit */

/**
 * What is said beforehand of the way out and of the time there is, each a sentence or two.
 *
 * @param {Limits} limits
 * @returns {string[]}
 */
export function beforehand({ task_s, trial_s }) {
  /** @param {number} seconds */
  const time = (seconds) =>
    seconds % 60 === 0
      ? tn("one minute", "{n} minutes", seconds / 60)
      : tn("one second", "{n} seconds", Math.round(seconds));
  const lines = [
    t(
      "If the arm is stuck, press “Free the arm” beside the picture. It goes back to its start, and you pick the object up once more.",
    ),
  ];
  if (task_s)
    lines.push(
      t(
        "There is time enough: {time} to pick an object up, and as much to bring it to its bin. If it does not work out in that time, the next object follows by itself.",
        { time: time(task_s) },
      ),
    );
  if (trial_s) lines.push(t("A round takes {time} at most, whatever is left to do then.", { time: time(trial_s) }));
  return lines;
}
