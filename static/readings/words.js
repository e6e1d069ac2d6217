// What the pages say about the second task. The readings have words of their own; every other kind of distractor names
// what it shows (`welcome.stimuli`), and the same lines are made from that.

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
    "Move the block into the bin that the page names.",
    meanwhile,
    "Take your time; this part does not count.",
  ];
  return lines.filter(Boolean).join(" ");
}

/** @type {Words} */
const READINGS = {
  title: "Sensor reading",
  fresh: "New sensor reading",
  prompt: "Type the reading, then press Enter",
  submit: "Log reading",
  missing: "Type the number shown above first.",
  noNumber: (typed) => `“${typed}” is not a number. Type the number shown above.`,
  late: "Time is up for this reading.",
  handled: "This reading is logged.",
  handsOff: "Take your hands off the robot's controls. They come back after you have logged the reading.",
  missed: "Time ran out for that reading.",
  practice: practiceWords("A reading comes meanwhile, as it will in the rounds."),
  panel: {
    device: "Sensor panel",
    title: "Sensor readings",
    purpose: "This screen shows the readings. Press the button once, so that the browser lets the alarm through.",
    waiting: "Waiting for a reading",
    next: "The next reading appears here, with a loud sound. Type it and press Enter.",
    answered: "Reading saved.",
    missed: "Time ran out for the last reading.",
    elsewhere: "Readings appear there.",
    over: "No more readings. You can close this page.",
  },
  setup: {
    loud: "Readings come with a loud sound. Set the volume so that it is clear and not unpleasant.",
    watch: "You can also go on without sound; then watch for the readings.",
    second:
      "Readings appear on a second device, with a loud sound. Open it there, press its button, and leave it on that page.",
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
    fresh: `New ${one}`,
    prompt: "Type your answer, then press Enter",
    submit: "Answer",
    missing: "Type your answer first.",
    noNumber: (typed) => `“${typed}” is not a number. Type the answer as a number.`,
    late: `Time is up for this ${one}.`,
    handled: `This ${one} is answered.`,
    handsOff: "Take your hands off the robot's controls. They come back after you have answered.",
    missed: `Time ran out for that ${one}.`,
    practice: practiceWords(`The ${many} begin meanwhile, as they will in the rounds.`),
    panel: {
      device: "Second device",
      title: capital(many),
      purpose: `This screen shows the ${many}. Press the button once, so that the browser lets the alarm through.`,
      waiting: `Waiting for the next ${one}`,
      next: `The next ${one} appears here, with a loud sound.`,
      answered: "Answer saved.",
      missed: `Time ran out for the last ${one}.`,
      elsewhere: `The ${many} appear there.`,
      over: `No more ${many}. You can close this page.`,
    },
    setup: {
      loud: `${capital(many)} come with a loud sound. Set the volume so that it is clear and not unpleasant.`,
      watch: `You can also go on without sound; then watch for the ${many}.`,
      second: `${capital(many)} appear on a second device, with a loud sound. Open it there, press its button, and leave it on that page.`,
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
