// The page of the open link. It changes nothing until its button is pressed: whoever only fetches a link enrols nobody.

import { h, icon, setText, whileBusy } from "../common/dom.js";
import { t } from "../common/language.js";
import { safeLink } from "../common/links.js";
import { problemText } from "../common/problem.js";
import { labUrl } from "../common/root.js";
import { card } from "../common/shell.js";

/** @import { JoinReply } from "../../tests/javascript/api.d.ts" */
/** @import { IconName } from "../common/dom.js" */

const LOST_AGAIN_MS = 30_000;
/** @type {JoinReply["state"] | null} */
let shown = null;
const main = h("main", { id: "main", tabindex: "-1" });
const title = h("span", { class: "brand-title" }, "Shared Autonomy Lab");

/** @type {Partial<Record<JoinReply["state"], [title: string, sign: IconName, lines: string[]]>>} */
const WORDS = {
  back: [t("Welcome back"), "hourglass", [t("You are where you left it.")]],
  full: [t("All places are taken"), "info", []],
  busy: [
    t("There is no room at this moment"),
    "hourglass",
    [
      t(
        "As many people are taking part right now as this study can serve well. Please wait a little, or come back later with the same link.",
      ),
      t(
        "You can leave this page open. It asks again by itself, and shows the button to begin as soon as there is room.",
      ),
    ],
  ],
  closed: [
    t("This study is not open"),
    "info",
    [
      t(
        "Nobody can begin over this link at the moment. If you have begun already, open the link in the browser you began in.",
      ),
    ],
  ],
  bad_link: [
    t("This link is not complete"),
    "warning",
    [
      t(
        "Open the link once more from where you found it, in full. If it still does not work, tell the person or the service that gave it to you.",
      ),
    ],
  ],
  elsewhere: [
    t("This study was begun in another browser"),
    "warning",
    [
      t(
        "Somebody has already taken part, or begun to, with the id in this link. If that was you, go back to the browser you began in: the study goes on there. If you cannot, ask the researcher for a personal link.",
      ),
    ],
  ],
};

/**
 * @param {string} path
 * @param {RequestInit} [options]
 * @returns {Promise<JoinReply>}
 */
async function asked(path, options = {}) {
  const answer = await fetch(labUrl(path), { cache: "no-store", ...options });
  /** @type {JoinReply | { detail: unknown }} */
  const reply = await answer.json();
  if ("state" in reply) return reply;
  throw new Error(typeof reply.detail === "string" ? reply.detail : "the lab did not understand the link");
}

/**
 * @param {JoinReply} reply
 * @returns {void}
 */
function show(reply) {
  shown = reply.state;
  setText(title, reply.title);
  document.title = reply.title;
  const [heading, sign, lines] = WORDS[reply.state] ?? [reply.title, null, []];
  const actions = [];
  if (reply.state === "begin" || reply.state === "back")
    actions.push(beginButton(reply.state === "begin" ? t("Begin") : t("Go on")));
  const link = reply.link && safeLink(reply.link);
  if (link)
    actions.push(
      h(
        "a",
        { class: "button primary large", href: link, rel: "noreferrer", data: { testid: "full-link" } },
        t("Continue"),
      ),
    );
  const words = reply.state === "back" ? lines : [...reply.lines, ...lines];
  main.replaceChildren(
    card({ title: heading, sign, lines: words, actions, body: problem, testid: `page-join-${reply.state}` }),
  );
  main.querySelector("h1")?.focus({ preventScroll: true });
  if (reply.again_s) setTimeout(look, reply.again_s * 1000);
}

/** @returns {Promise<void>} */
async function look() {
  try {
    const reply = await asked(`/join/offer${location.search}`);
    if (reply.state !== shown) show(reply);
    else if (reply.again_s) setTimeout(look, reply.again_s * 1000);
  } catch {
    if (shown === "busy") setTimeout(look, LOST_AGAIN_MS);
    else lost();
  }
}

/** @returns {void} */
function lost() {
  main.replaceChildren(
    card({
      title: t("The lab does not answer"),
      sign: "lost",
      lines: [t("Please reload this page in a moment.")],
      testid: "page-join-lost",
    }),
  );
}

const problemWords = h("span", {});
const problem = h(
  "p",
  { class: "field-error", role: "alert", hidden: true, data: { testid: "join-problem" } },
  icon("warning"),
  problemWords,
);

/**
 * @param {string} label
 * @returns {HTMLButtonElement}
 */
function beginButton(label) {
  const button = h("button", { type: "button", class: "primary large", data: { testid: "join-begin" } }, label);
  button.addEventListener("click", () =>
    whileBusy(button, t("One moment"), async () => {
      problem.hidden = true;
      const entries = [...new URLSearchParams(location.search)]
        .slice(0, 50)
        .map(([name, value]) => [name, value.slice(0, 1000)]);
      try {
        const reply = await asked("/join", {
          method: "POST",
          headers: { "Content-Type": "application/json" },
          body: JSON.stringify({ parameters: Object.fromEntries(entries) }),
        });
        if (reply.page) location.replace(reply.page);
        else show(reply);
      } catch (error) {
        setText(problemWords, t("That did not work: {problem}", { problem: problemText(error) }));
        problem.hidden = false;
      }
    }),
  );
  return button;
}

document.body.append(
  h(
    "div",
    { class: "app" },
    h(
      "header",
      { class: "top" },
      h("span", { class: "brand" }, h("span", { class: "brand-mark", "aria-hidden": "true" }), title),
    ),
    main,
  ),
);
await look();
