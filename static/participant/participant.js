// The participant's page: one socket, one pair of hands, and a view for each state of the study.

import { h } from "../common/dom.js";
import { onlyFreshKeys } from "../common/fresh_keys.js";
import { t } from "../common/language.js";
import { refusalText } from "../common/problem.js";
import { sessionOfPage, socketUrl } from "../common/root.js";
import { ask, card, Shell } from "../common/shell.js";
import { setWordsLimit } from "../common/words_limit.js";
import { Pads } from "../hands/gamepad.js";
import { Input } from "../hands/input.js";
import { Keyboard } from "../hands/keyboard.js";
import { Sound } from "../readings/sound.js";
import { LabSocket } from "../wire/socket.js";
import { legendFor } from "./controls.js";
import { DriveView } from "./drive.js";

/** @import { Page } from "../../tests/javascript/wire.d.ts" */
/** @import { ConnectionState, Question } from "../common/shell.js" */
/** @import { DrivingPage, PausedPage } from "./drive.js" */
/** @import { Context, PageOf, View } from "./view.js" */
/** @typedef {(context: Context, page: PageOf<never, never>) => View} MakesView each takes the content of its own state */

/** @type {Map<string, MakesView>} */
const views = new Map();
const DRIVING = new Set(["practice_ready", "practice", "trial_ready", "trial"]);
const OVER = new Set(["done", "withdrawn", "aborted", "screened_out", "lapsed"]);

onlyFreshKeys();
const session = sessionOfPage();
const socket = new LabSocket({ url: socketUrl(`/s/${session}/socket`), name: session });
const sound = new Sound();
const keyboard = new Keyboard();
const pads = new Pads();
const input = new Input({ socket, keyboard, pads, session });
socket.addEventListener("welcome", (event) => setWordsLimit(event.detail.words_limit));
const shell = new Shell({ socket, onHelp: help, onStop: stop });
/** @type {Context} */
const context = { session, socket, sound, keyboard, pads, input, closeDialogs };

/** @type {View | null} */
let view = null;
/** @type {string | null} */
let shown = null; // identity of what is on the page

/**
 * @param {View} next
 * @param {string} identity
 * @returns {void}
 */
function replace(next, identity) {
  if (next !== view) view?.close?.();
  view = next;
  shown = identity;
  shell.main.replaceChildren(next.element);
  const plain = !(next instanceof DriveView);
  shell.element.classList.toggle("driving", !plain);
  if (plain) {
    scrollTo(0, 0);
    (next.element.querySelector("h1") ?? shell.main).focus({ preventScroll: true });
  }
}

/**
 * Whether the scene is on the screen: while there is a robot to see, and in a pause that began there.
 *
 * @param {Page} page
 * @returns {page is DrivingPage | PausedPage}
 */
function isDriving(page) {
  if (page.state === "paused") return view instanceof DriveView || Boolean(page.content.scene);
  return DRIVING.has(page.state);
}

/**
 * @param {Page} page
 * @returns {void}
 */
function showPage(page) {
  shell.rest(OVER.has(page.state));
  shell.offer({
    help: !OVER.has(page.state),
    stop: !OVER.has(page.state) && page.state !== "consent" && page.state !== "eligibility",
  });
  if (isDriving(page)) {
    const drive = view instanceof DriveView ? view : new DriveView(context);
    if (view !== drive) replace(drive, "drive");
    drive.show(page);
    return;
  }
  const identity = `${page.state}:${page.trial}:${JSON.stringify(page.content)}`;
  if (identity === shown) return; // the same page again after a reconnect: what was typed stays
  const makesView = views.get(page.state) ?? unknownView;
  replace(makesView(context, /** @type {PageOf<never, never>} */ (page)), identity);
}

/**
 * The views of the study's pages, before the first of them is shown: the lab names them in this document.
 *
 * @returns {Promise<void>}
 */
async function loadViews() {
  /** @type {NodeListOf<HTMLLinkElement>} */
  const links = document.querySelectorAll("link[data-state]");
  await Promise.all(
    Array.from(links, async (link) => {
      const { view } = await import(link.href);
      views.set(link.dataset.state ?? "", view);
    }),
  );
}

/** @type {MakesView} */
function unknownView(_context, { state }) {
  const line = t("The study is in a part this page does not know ({state}). Please reload the page.", { state });
  return { element: card({ title: t("One moment"), lines: [line] }) };
}

/** @returns {void} */
function closeDialogs() {
  for (const dialog of document.querySelectorAll("dialog")) dialog.close();
}

/**
 * @param {Question} question
 * @returns {Promise<string | null>}
 */
async function withDialog(question) {
  view?.dialog?.(true);
  try {
    return await ask(question);
  } finally {
    view?.dialog?.(false);
  }
}

async function help() {
  const driving = view instanceof DriveView;
  const text = await withDialog({
    title: t("Help"),
    text: driving
      ? [
          t(
            "Move the gripper around the object named on the page, close it, lift, carry the object over its bin, and open the gripper. If an object falls over, go on: the page tells you what comes next.",
          ),
        ]
      : [t("Read the page at your own pace. Everything you answer is saved when you press the button at its end.")],
    extra: driving ? h("div", { class: "legend-box" }, legendFor(input)) : null,
    field: { label: t("Do you need the experimenter? Say what is wrong (optional)."), required: false },
    confirm: t("Ask the experimenter"),
    back: t("Close"),
    testid: "help-dialog",
  });
  if (text === null) return;
  socket.submit("help", { text: text || null }).then(
    () => shell.toasts.show(t("The experimenter has been told.")),
    () => {},
  );
}

async function stop() {
  const reason = await withDialog({
    title: t("Stop taking part?"),
    text: [
      t(
        "You can stop at any time, without any disadvantage. Your participation then ends and cannot be taken up again.",
      ),
    ],
    field: { label: t("If you like, tell us why (optional)."), required: false },
    confirm: t("Stop taking part"),
    back: t("Go on"),
    danger: true,
    testid: "stop-dialog",
  });
  if (reason !== null) socket.submit("withdraw", { reason: reason || null }).catch(() => {});
}

/** @returns {HTMLButtonElement} */
function reloadButton() {
  const reload = h("button", { type: "button", class: "primary large" }, t("Reload the page"));
  reload.addEventListener("click", () => location.reload());
  return reload;
}

/**
 * @param {ConnectionState} state
 * @returns {void}
 */
function final(state) {
  const again = h(
    "button",
    { type: "button", class: "primary large", data: { testid: "take-over" } },
    t("Use this tab instead"),
  );
  again.addEventListener("click", () => {
    shown = null;
    socket.takeOver();
  });
  /** @type {Partial<Record<ConnectionState, Parameters<typeof card>[0]>>} */
  const pages = {
    superseded: {
      title: t("The study is open in another tab"),
      lines: [t("This tab has stopped. Go on in the other one and close this one, or bring the study back here.")],
      actions: [again],
      testid: "page-superseded",
    },
    denied: {
      title: t("This link does not work any more"),
      lines: [
        t("Open the link you were given once more. If it still does not work, ask the person who gave it to you."),
      ],
      actions: [],
      testid: "page-denied",
    },
    unusable: {
      title: t("The study cannot go on at the moment"),
      lines: [
        t("The lab cannot run this session. Nothing you did is lost. Tell the person who gave you the link."),
        t("When they have seen to it, reload this page."),
      ],
      actions: [reloadButton()],
      testid: "page-unusable",
    },
    too_many: {
      title: t("This page is open too often"),
      lines: [t("Close the other tabs and devices that show it, then reload this page.")],
      actions: [reloadButton()],
      testid: "page-too-many",
    },
    outdated: {
      title: t("This page is out of date"),
      lines: [t("The lab has been updated. Reload the page to go on; nothing is lost.")],
      actions: [reloadButton()],
      testid: "page-outdated",
    },
  };
  const words = pages[state];
  if (!words) return;
  closeDialogs();
  shell.offer({ help: false, stop: false });
  replace({ element: card({ sign: "warning", ...words }) }, state);
}

socket.addEventListener("page", (event) => showPage(event.detail));
socket.addEventListener("state", (event) => final(event.detail));
socket.addEventListener("notice", (event) =>
  shell.toasts.show(t("From the experimenter: {text}", { text: event.detail.text }), {
    stays: true,
    onDismiss: () => socket.note("message_dismissed"),
  }),
);
socket.addEventListener("refused", (event) => {
  const { stale, message, code, id, field } = event.detail;
  // What a person cannot act on: a step of an earlier visit, an input that came a moment too late.
  if (stale || (!id && (code === "out_of_order" || code === "illegal"))) return console.warn("refused:", message);
  // Deferred, so that a form can say it beside its question instead.
  queueMicrotask(
    () =>
      event.defaultPrevented ||
      shell.toasts.show(
        code === "internal" ? t("The lab could not save that yet. It is tried again.") : refusalText(field, message),
        { problem: true },
      ),
  );
});
input.addEventListener("device", (event) => {
  if (view instanceof DriveView) return;
  const { there, again } = event.detail;
  if (there && !again) return; // the browser shows it to this page for the first time
  shell.toasts.show(there ? t("The gamepad is back.") : t("The gamepad is unplugged. The keyboard works too."));
});

document.body.append(shell.element);
replace(
  {
    element: card({
      title: t("One moment"),
      lines: [t("Connecting to the lab.")],
      sign: "hourglass",
      testid: "page-connecting",
    }),
  },
  "connecting",
);
loadViews().then(
  () => socket.connect(),
  () =>
    replace(
      {
        element: card({
          title: t("This page is not complete"),
          lines: [t("A part of it could not be loaded. Nothing is lost; reload the page to go on.")],
          sign: "warning",
          actions: [reloadButton()],
          testid: "page-incomplete",
        }),
      },
      "incomplete",
    ),
);

// For tests, and for whoever opens the console.
window.salab = {
  socket,
  input,
  pads,
  sound,
  get page() {
    return shown;
  },
};
