// The second device: waits, shows a reading (or what another kind of second task has) with a loud sound, and takes the
// answer. Made to be read from across a room.

import { h, icon, setText } from "../common/dom.js";
import { onlyFreshKeys } from "../common/fresh_keys.js";
import { t } from "../common/language.js";
import { refusalText } from "../common/problem.js";
import { sessionOfPage, socketUrl } from "../common/root.js";
import { card, Toasts } from "../common/shell.js";
import { unsavedNotice } from "../common/unsaved.js";
import { AlertView } from "../readings/alert.js";
import { Sound } from "../readings/sound.js";
import { wordsFor } from "../readings/words.js";
import { LabSocket } from "../wire/socket.js";

/** @import { IconName } from "../common/dom.js" */
/** @import { ConnectionState } from "../common/shell.js" */

const OVER = new Set(["done", "withdrawn", "aborted", "screened_out", "lapsed"]);
/** @type {Record<ConnectionState, [sign: IconName, text: string]>} */
const CONNECTION = {
  connecting: ["lost", t("Connecting")],
  closed: ["lost", t("Connecting")],
  open: ["check", t("Connected")],
  lost: ["lost", t("Connection lost – trying again")],
  superseded: ["warning", t("Open on another device")],
  denied: ["warning", t("Link not valid")],
  unusable: ["warning", t("Cannot go on")],
  too_many: ["warning", t("Open too often")],
  outdated: ["warning", t("Page out of date")],
};

onlyFreshKeys();
const session = sessionOfPage();
const socket = new LabSocket({ url: socketUrl(`/s/${session}/panel/socket`), name: `${session}:panel` });
const sound = new Sound();
const toasts = new Toasts();
const alert = new AlertView({ socket, sound, away: false });

const connection = h("span", { class: "connection", role: "status", data: { testid: "connection" } });
const on = h(
  "button",
  { type: "button", class: "primary huge", data: { testid: "panel-start" } },
  icon("sound"),
  t("Turn the sound on"),
);
on.addEventListener("click", async () => {
  if (!(await sound.alarm()))
    return toasts.show(t("This browser did not let the sound through. Press the button once more."), { problem: true });
  started = true;
  setTimeout(() => alert.covering || sound.silence(), 800);
  refresh();
});
const lockedTitle = h("h1", {});
const lockedText = h("p", {});
const locked = h("section", { class: "panel-wait", data: { testid: "panel-locked" } }, lockedTitle, lockedText, on);
const last = h("p", { class: "panel-last", role: "status", data: { testid: "panel-last" } });
const waitTitle = h("h1", {});
const waitText = h("p", {});
const device = h("span", { class: "brand-title" });
const heardText = h("p", {}, t("Did you hear the alarm?"));
const yes = h("button", { type: "button", class: "primary large", data: { testid: "panel-heard" } }, t("I heard it"));
const no = h(
  "button",
  { type: "button", class: "secondary large", data: { testid: "panel-silent" } },
  t("I heard nothing"),
);
const again = h(
  "button",
  { type: "button", class: "secondary large", data: { testid: "panel-again" } },
  icon("sound"),
  t("Play it again"),
);
const asking = h(
  "div",
  { class: "panel-asking", data: { testid: "panel-asking" } },
  heardText,
  h("div", { class: "actions" }, yes, no, again),
);
yes.addEventListener("click", () => {
  asking.hidden = true;
  socket.note("panel_heard", { heard: true });
});
no.addEventListener("click", () => {
  setText(heardText, t("Turn up the volume of this device, take it off silent mode, and play the alarm again."));
  socket.note("panel_heard", { heard: false });
});
again.addEventListener("click", () => sound.alarm());
const waiting = h(
  "section",
  { class: "panel-wait", data: { testid: "panel-waiting" } },
  h("div", { class: "pulse", "aria-hidden": "true" }),
  waitTitle,
  waitText,
  asking,
  last,
);
const main = h("main", { id: "main" }, locked, waiting, alert.element);

/** @type {HTMLElement | null} */
let ended = null;
let words = wordsFor(null).panel;
let started = false; // the button was pressed: sound is known to come through

/**
 * The words of the study's second task, once the lab has said which.
 *
 * @returns {void}
 */
function name() {
  words = wordsFor(socket.welcome).panel;
  document.title = words.device;
  setText(device, words.device);
  setText(lockedTitle, words.title);
  setText(lockedText, words.purpose);
  setText(waitTitle, words.waiting);
  setText(waitText, words.next);
}

/** @returns {void} */
function refresh() {
  const open = alert.covering && !alert.concealed;
  locked.hidden = ended !== null || started || open;
  waiting.hidden = ended !== null || !started || open;
  const [sign, text] = CONNECTION[socket.state];
  connection.dataset.state = socket.state;
  if (connection.dataset.text === text) return;
  connection.dataset.text = text;
  connection.replaceChildren(icon(sign), h("span", {}, text));
}

/**
 * @param {string} title
 * @param {string} line
 * @param {HTMLElement | null} [action]
 * @returns {void}
 */
function finish(title, line, action = null) {
  ended?.remove();
  ended = card({ title, lines: [line], sign: "check", testid: "panel-ended", actions: action ? [action] : [] });
  alert.clear();
  main.append(ended);
  refresh();
}

/** @returns {void} */
function reopen() {
  ended?.remove();
  ended = null;
  refresh();
}

alert.addEventListener("open", refresh);
alert.addEventListener("released", (event) => {
  const results = { answered: words.answered, expired: words.missed, trial_ended: t("The round has ended.") };
  setText(last, event.detail ? results[event.detail] : "");
  refresh();
});
sound.addEventListener("state", refresh);
socket.addEventListener("state", (event) => {
  alert.pause(event.detail !== "open");
  if (event.detail === "superseded") {
    const again = h(
      "button",
      { type: "button", class: "primary large", data: { testid: "take-over" } },
      t("Use this screen instead"),
    );
    again.addEventListener("click", () => {
      reopen();
      socket.takeOver();
    });
    finish(t("The panel is open somewhere else"), words.elsewhere, again);
  } else if (event.detail === "unusable")
    finish(t("The study cannot go on at the moment"), t("The lab cannot run this session. Tell the experimenter."));
  else if (event.detail === "too_many")
    finish(
      t("This page is open too often"),
      t("Close the other tabs and devices that show it, then reload this page."),
    );
  else if (event.detail === "denied")
    finish(t("This link does not work any more"), t("Open the link for the second device once more."));
  else if (event.detail === "outdated") finish(t("This page is out of date"), t("Reload the page to go on."));
  refresh();
});
socket.addEventListener("welcome", name);
socket.addEventListener("page", (event) => {
  const { state } = event.detail;
  if (socket.welcome && socket.welcome.placement !== "second_device")
    return finish(
      t("This study has no second device"),
      t("Everything appears on the participant's own screen. You can close this page."),
    );
  if (OVER.has(state)) return finish(t("That is all"), words.over);
  if (ended) reopen();
  alert.pause(state === "paused");
  alert.conceal(state === "paused");
  if (!["practice", "trial", "paused"].includes(state)) alert.clear();
  setText(waitText, state === "paused" ? t("The round is paused.") : words.next);
  refresh();
});
socket.addEventListener("status", (event) =>
  alert.pause(["paused", "held", "recovering"].includes(event.detail.status)),
);
socket.addEventListener("notice", (event) => toasts.show(event.detail.text));
socket.addEventListener(
  "refused",
  ({ detail: { stale, field, message } }) => stale || toasts.show(refusalText(field, message), { problem: true }),
);

document.body.append(
  h(
    "div",
    { class: "app panel-app" },
    h(
      "header",
      { class: "top" },
      h("span", { class: "brand" }, h("span", { class: "brand-mark", "aria-hidden": "true" }), device),
      connection,
    ),
    h("div", { class: "messages" }, unsavedNotice(socket), toasts.element),
    main,
  ),
);
name();
refresh();
on.focus();
socket.connect();
window.salab = { socket, sound, alert };
