// The experimenter's page: links, sessions and what can be done with them, roster, data. Talks to the HTTP API with a bearer token.

import { copyButton } from "../common/copy.js";
import { freshId, h, icon, setText, whileBusy } from "../common/dom.js";
import { problemText } from "../common/problem.js";
import { Toasts } from "../common/shell.js";
import { numberProblem, numerals } from "../common/typed_number.js";
import { Api, isRefused } from "./api.js";
import { act } from "./commands.js";
import { CrowdingNotice } from "./crowding.js";
import { Export } from "./export.js";
import { HelpCalls } from "./help_calls.js";
import { Live } from "./live.js";
import { Results } from "./results.js";
import { RobotNote } from "./robot_note.js";
import { Roster } from "./roster.js";
import { showQr } from "./roster_dialogs.js";
import { Rows } from "./sessions_table.js";
import { TroubleNotice } from "./trouble.js";

/** @import { InvitationReply, InviteRequest } from "../../tests/javascript/api.d.ts" */
/** @import { Session } from "./api.js" */
/** @import { Command } from "./commands.js" */

const POLL_MS = 1000;
const STALE_MS = 4000;

const api = new Api();
const toasts = new Toasts();
const main = h("main", { id: "main" });
const updated = h("span", { class: "updated", role: "status", data: { testid: "last-updated" } }, "Not updated yet");
const robotNote = new RobotNote();
const leave = h(
  "button",
  { type: "button", class: "secondary small", hidden: true, data: { testid: "log-out" } },
  "Forget token",
);
const initials = h("input", {
  type: "text",
  maxlength: 20,
  size: 6,
  autocomplete: "off",
  spellcheck: "false",
  value: api.initials,
  data: { testid: "initials" },
});
initials.addEventListener("change", () => {
  api.initials = initials.value;
});
const signed = h(
  "label",
  {
    class: "signed",
    hidden: true,
    title:
      "They stand in the record of what you do, and are exported. Several experimenters share one token: this tells you apart.",
  },
  "Your initials",
  initials,
);
let timer = 0;
let lastMs = 0; // by a clock that is never set
let lastAt = new Date();

/**
 * @param {string} [problem] why the token was not taken
 * @returns {void}
 */
function login(problem = "") {
  clearInterval(timer);
  calls.update([]);
  live.stop();
  roster.stop();
  results.stop();
  leave.hidden = true;
  signed.hidden = true;
  const fieldId = freshId("token");
  const field = h("input", {
    id: fieldId,
    type: "password",
    autocomplete: "off",
    spellcheck: "false",
    data: { testid: "token-input" },
  });
  const error = h(
    "p",
    { class: "field-error", role: "alert", hidden: problem === "", data: { testid: "login-error" } },
    icon("warning"),
    h("span", {}, problem),
  );
  const button = h(
    "button",
    { type: "submit", class: "primary", data: { testid: "login-button" } },
    "Open the dashboard",
  );
  const form = h(
    "form",
    { novalidate: true },
    h("div", { class: "field" }, h("label", { for: fieldId }, "Experimenter token"), field),
    error,
    h("div", { class: "actions" }, button),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    whileBusy(button, "Checking", async () => {
      api.setToken(field.value.trim());
      await enter();
    });
  });
  main.replaceChildren(
    h(
      "section",
      { class: "card", data: { testid: "page-login" } },
      h("h1", {}, "Experimenter's dashboard"),
      h("p", {}, "The lab prints a link with the token when it starts. Open that link, or paste the token here."),
      form,
    ),
  );
  field.focus();
}

/** @returns {Promise<void>} */
async function enter() {
  try {
    const sessions = await api.sessions();
    board();
    drawn(sessions);
    clearInterval(timer);
    timer = setInterval(poll, POLL_MS);
    live.start();
    robotNote.ask(api);
  } catch (error) {
    if (isRefused(error)) api.setToken("");
    login(problemText(error));
  }
}

const calls = new HelpCalls({ api, toasts, onSeen: () => poll() });
const results = new Results({ api, toasts });
const roster = new Roster({ api, toasts, onActed: () => poll() });
const onAct = async (/** @type {string} */ participant, /** @type {Command} */ command) => {
  await act(api, toasts, participant, command);
  poll();
};
const rows = new Rows({ toasts, onAct });
const trouble = new TroubleNotice();
const crowding = new CrowdingNotice();
const live = new Live({ api, toasts, main, onAct, onSessions: drawn });
live.feed.addEventListener("trouble", (event) => trouble.show(event.detail));
live.feed.addEventListener("crowding", (event) => crowding.show(event.detail));

/**
 * @param {Session[]} sessions
 * @returns {void}
 */
function drawn(sessions) {
  lastMs = performance.now();
  lastAt = new Date();
  draw(sessions);
}

/**
 * @param {Session[]} sessions
 * @returns {void}
 */
function draw(sessions) {
  rows.update(sessions);
  calls.update(sessions);
  results.follow(sessions);
  sayUpdated();
}

/** @returns {void} */
function sayUpdated() {
  const stale = performance.now() - lastMs > STALE_MS;
  updated.classList.toggle("stale", stale);
  const at = lastAt.toLocaleTimeString([], { hour12: false });
  setText(updated, stale ? `Not up to date: last heard from the lab at ${at}` : `Updated ${at}`);
}

let polling = false;
/** @returns {Promise<void>} */
async function poll() {
  sayUpdated(); // a lab that hangs lets every question wait
  if (live.fed) return draw(live.sessions);
  if (polling) return;
  polling = true;
  try {
    drawn(await api.sessions());
  } catch (error) {
    if (isRefused(error)) login(problemText(error));
    else sayUpdated();
  } finally {
    polling = false;
  }
}

/** @returns {void} */
function board() {
  leave.hidden = false;
  signed.hidden = false;
  roster.start();
  results.start();
  main.replaceChildren(
    h(
      "div",
      { class: "board", data: { testid: "page-dashboard" } },
      h("h1", { class: "visually-hidden" }, "Sessions, roster and data"),
      createCard(),
      sessionsCard(),
      roster.element,
      results.element,
    ),
  );
}

/** @returns {HTMLElement} */
function createCard() {
  const countId = freshId("count");
  const labelId = freshId("label");
  const count = h("input", {
    id: countId,
    type: "text", // a field of the type number makes 35 of 3,5
    inputmode: "numeric",
    autocomplete: "off",
    value: "1",
    class: "narrow",
    data: { testid: "create-count" },
  });
  const label = h("input", {
    id: labelId,
    type: "text",
    autocomplete: "off",
    data: { testid: "create-label" },
  });
  const error = h("p", { class: "field-error", role: "alert", hidden: true });
  const links = h("div", { class: "links", data: { testid: "links" } });
  const create = (/** @type {NonNullable<InviteRequest["kind"]>} */ kind) => async () => {
    const wanted = Number(numerals(count.value)[0]);
    error.hidden = true;
    if (numberProblem(count.value, { whole: true, least: 1, most: 200 })) {
      error.hidden = false;
      setText(error, `The number of links must be a whole number from 1 to 200, not “${count.value}”.`);
      count.focus();
      return;
    }
    try {
      const made = await api.create({ demo: kind === "demo", kind, label: label.value.trim(), count: wanted });
      links.prepend(...made.map(linkRows));
      label.value = "";
      poll();
      roster.refresh();
    } catch (problem) {
      error.hidden = false;
      setText(error, `No link was created: ${problemText(problem)}`);
    }
  };
  const add = h(
    "button",
    { type: "button", class: "primary", data: { testid: "create-participant" } },
    "Create participant link",
  );
  const addDemo = h(
    "button",
    { type: "button", class: "secondary", data: { testid: "create-demo" } },
    "Create demo link",
  );
  const addPilot = h(
    "button",
    { type: "button", class: "secondary", data: { testid: "create-pilot" } },
    "Create pilot link",
  );
  addPilot.addEventListener("click", () => whileBusy(addPilot, "Creating", create("pilot")));
  add.addEventListener("click", () => whileBusy(add, "Creating", create("study")));
  addDemo.addEventListener("click", () => whileBusy(addDemo, "Creating", create("demo")));
  return h(
    "section",
    { class: "board-card", "aria-labelledby": "create-title" },
    h("h2", { id: "create-title" }, "New links"),
    h(
      "div",
      { class: "create" },
      h("div", { class: "field" }, h("label", { for: countId }, "How many"), count),
      h("div", { class: "field grow" }, h("label", { for: labelId }, "Recruitment id or note (never exported)"), label),
      add,
      addPilot,
      addDemo,
    ),
    error,
    h(
      "p",
      { class: "hint" },
      "A link is shown only once, here. Pilots and demos use no counterbalancing slot; an export holds pilots when asked for, demos never. The demo link that the lab prints at its start makes its demo when it is first opened.",
    ),
    links,
  );
}

/**
 * @param {InvitationReply} invitation
 * @returns {HTMLElement}
 */
function linkRows({ participant, link, panel_link, second_device, kind, demo }) {
  const qr = (/** @type {string} */ url) => {
    const button = h(
      "button",
      {
        type: "button",
        class: "secondary small",
        "aria-label": `QR code of ${participant}`,
        data: { testid: "show-qr" },
      },
      "QR code",
    );
    button.addEventListener("click", () =>
      showQr(api, participant, url).catch((error) => toasts.show(problemText(error), { problem: true })),
    );
    return button;
  };
  const marked = demo ? " (demo)" : kind === "pilot" ? " (pilot)" : "";
  const line = (/** @type {string} */ name, /** @type {string} */ url, /** @type {string} */ testid) =>
    url &&
    h(
      "div",
      { class: "link-row" },
      h("span", {}, name),
      h("input", {
        type: "text",
        readonly: true,
        value: url,
        "aria-label": `${name} of ${participant}`,
        data: { testid },
      }),
      h(
        "span",
        { class: "buttons" },
        copyButton(() => url, "Copy", `copy-${testid}`),
        qr(url),
      ),
    );
  return h(
    "div",
    { class: "panel", data: { testid: "new-link", participant } },
    h("p", {}, h("strong", {}, participant), marked),
    line("Participant link", link, "participant-link"),
    line("Second device", second_device ? panel_link : "", "second-device-link"),
  );
}

/** @returns {HTMLElement} */
function sessionsCard() {
  const exporting = new Export({ api, toasts });
  return h(
    "section",
    { class: "board-card", "aria-labelledby": "sessions-title" },
    h(
      "div",
      { class: "board-head" },
      h("h2", { id: "sessions-title" }, "Sessions"),
      h("span", { class: "top-actions" }, updated, rows.filter, exporting.button),
    ),
    robotNote.element,
    exporting.progress,
    rows.element,
  );
}

leave.addEventListener("click", async () => {
  await api.leave();
  login();
});
document.body.append(
  h(
    "div",
    { class: "app" },
    h(
      "header",
      { class: "top" },
      h(
        "span",
        { class: "brand" },
        h("span", { class: "brand-mark", "aria-hidden": "true" }),
        h("span", { class: "brand-title" }, "Shared Autonomy Lab · Dashboard"),
      ),
      h("span", { class: "top-actions" }, signed, leave),
    ),
    h("div", { class: "messages" }, trouble.element, crowding.element, calls.element, toasts.element),
    main,
  ),
);
setInterval(() => lastMs && sayUpdated(), POLL_MS);
if (api.token) enter();
else login();

// For tests, and for whoever opens the console.
window.salab = { calls };
