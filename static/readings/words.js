// What the pages say about the second task. The readings have words of their own; every other kind of distractor names
// what it shows (`welcome.stimuli`), and the same lines are made from that.

import { t } from "../common/language.js";

/** @import { StimulusWords } from "../../tests/javascript/wire.d.ts" */
/**
 * @typedef {object} Words
 * @property {string} title of one, for who hears the page
 * @property {string} fresh above a new one
 * @property {string} prompt where the lab sends none
 * @property {string} submit on the button that hands in what was typed
 * @property {string} missing when nothing was typed
 * @property {(typed: string) => string} noNumber when a number was asked for and none was typed
 * @property {string} late when the time is up
 * @property {string} handled after a reload: it was dealt with
 * @property {string} handsOff while it covers the view
 * @property {string} practice what there is to be practised
 * @property {string} missed on the participant's page, when the time was up
 * @property {{ device: string, title: string, purpose: string, waiting: string, next: string, answered: string,
 *   missed: string, elsewhere: string, over: string }} panel the second device
 * @property {{ loud: string, watch: string, second: string }} setup
 */

/**
 * @param {string} meanwhile what else there is to do
 * @returns {string}
 */
function practiceWords(meanwhile) {
  const lines = [
    t("Move the block into the bin that the page names."),
    meanwhile,
    t("Take your time; this part does not count."),
  ];
  return lines.filter(Boolean).join(" ");
}

/** @type {Words} */
const READINGS = {
  title: t("Sensor reading"),
  fresh: t("New sensor reading"),
  prompt: t("Type the reading, then press Enter"),
  submit: t("Log reading"),
  missing: t("Type the number shown above first."),
  noNumber: (typed) => t("“{typed}” is not a number. Type the number shown above.", { typed }),
  late: t("Time is up for this reading."),
  handled: t("This reading is logged."),
  handsOff: t("Take your hands off the robot's controls. They come back after you have logged the reading."),
  missed: t("Time ran out for that reading."),
  practice: practiceWords(t("A reading comes meanwhile, as it will in the rounds.")),
  panel: {
    device: t("Sensor panel"),
    title: t("Sensor readings"),
    purpose: t("This screen shows the readings. Press the button once, so that the browser lets the alarm through."),
    waiting: t("Waiting for a reading"),
    next: t("The next reading appears here, with a loud sound. Type it and press Enter."),
    answered: t("Reading saved."),
    missed: t("Time ran out for the last reading."),
    elsewhere: t("Readings appear there."),
    over: t("No more readings. You can close this page."),
  },
  setup: {
    loud: t("Readings come with a loud sound. Set the volume so that it is clear and not unpleasant."),
    watch: t("You can also go on without sound; then watch for the readings."),
    second: t(
      "Readings appear on a second device, with a loud sound. Open it there, press its button, and leave it on that page.",
    ),
  },
};

/**
 * @param {StimulusWords} named
 * @returns {Words}
 */
function wordsOf({ one, many }) {
  const capital = (/** @type {string} */ text) => text.charAt(0).toUpperCase() + text.slice(1);
  return {
    title: capital(one),
    fresh: t("New {one}", { one }),
    prompt: t("Type your answer, then press Enter"),
    submit: t("Answer"),
    missing: t("Type your answer first."),
    noNumber: (typed) => t("“{typed}” is not a number. Type the answer as a number.", { typed }),
    late: t("Time is up for this {one}.", { one }),
    handled: t("This {one} is answered.", { one }),
    handsOff: t("Take your hands off the robot's controls. They come back after you have answered."),
    missed: t("Time ran out for that {one}.", { one }),
    practice: practiceWords(t("The {many} begin meanwhile, as they will in the rounds.", { many })),
    panel: {
      device: t("Second device"),
      title: capital(many),
      purpose: t("This screen shows the {many}. Press the button once, so that the browser lets the alarm through.", {
        many,
      }),
      waiting: t("Waiting for the next {one}", { one }),
      next: t("The next {one} appears here, with a loud sound.", { one }),
      answered: t("Answer saved."),
      missed: t("Time ran out for the last {one}.", { one }),
      elsewhere: t("The {many} appear there.", { many }),
      over: t("No more {many}. You can close this page.", { many }),
    },
    setup: {
      loud: t("{many} come with a loud sound. Set the volume so that it is clear and not unpleasant.", {
        many: capital(many),
      }),
      watch: t("You can also go on without sound; then watch for the {many}.", { many }),
      second: t(
        "{many} appear on a second device, with a loud sound. Open it there, press its button, and leave it on that page.",
        { many: capital(many) },
      ),
    },
  };
}

/**
 * The words of the study's second task.
 *
 * @param {{ stimuli?: StimulusWords | null, placement?: string } | null} welcome what the lab said first; null before it did
 * @returns {Words}
 */
export function wordsFor(welcome) {
  if (welcome?.placement === "none") return { ...READINGS, practice: practiceWords("") };
  return welcome?.stimuli ? wordsOf(welcome.stimuli) : READINGS;
}
