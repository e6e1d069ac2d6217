// The last page, whichever way it came to it.

import { h, setText } from "../../common/dom.js";
import { t, tn } from "../../common/language.js";
import { safeLink } from "../../common/links.js";
import { card } from "../../common/shell.js";
import { tab } from "../../common/store.js";

/** @import { IconName } from "../../common/dom.js" */
/** @import { Context, PageOf, View } from "../view.js" */

/** @type {Record<"done" | "withdrawn" | "aborted" | "screened_out" | "lapsed", [title: string, sign: IconName]>} */
const ENDS = {
  done: [t("Thank you"), "check"],
  withdrawn: [t("You have stopped taking part"), "hand"],
  aborted: [t("The session was ended"), "warning"],
  screened_out: [t("This study does not fit your device"), "info"],
  lapsed: [t("There is no place left in this study"), "info"],
};

const FORWARD_S = 10;

/**
 * The last page. Its link appears when the lab has everything this browser still kept for it, and not before.
 *
 * @param {Context} context
 * @param {PageOf<{ text: string[], completion_link: string | null }, keyof typeof ENDS>} page
 * @returns {View}
 */
export function view({ socket, session }, page) {
  const [title, sign] = ENDS[page.state];
  const link = page.content.completion_link ? safeLink(page.content.completion_link) : null;
  const last = h("div", { class: "last-words" });
  let timer = 0;
  /** @type {boolean | null} */
  let saved = null;

  /** @param {string} link */
  function forward(link) {
    const key = `${session}:forwarded`; // once: who comes back to this page wants to read it
    const onward = h(
      "a",
      { class: "button primary large", href: link, rel: "noreferrer", data: { testid: "completion-link" } },
      page.state === "done" ? t("Continue to the completion page") : t("Continue"),
    );
    const actions = h("div", { class: "actions" }, onward);
    last.replaceChildren(actions);
    if (page.state !== "done" || tab.get(key, false)) return;
    let left = FORWARD_S;
    const words = h("p", { class: "hint", data: { testid: "forward-words" } });
    const stay = h(
      "button",
      { type: "button", class: "secondary large", data: { testid: "forward-stay" } },
      t("Stay on this page"),
    );
    const say = () =>
      setText(words, tn("You are taken there in one second.", "You are taken there in {n} seconds.", left));
    stay.addEventListener("click", () => {
      clearInterval(timer);
      words.remove();
      stay.remove();
      onward.focus();
    });
    timer = setInterval(() => {
      left -= 1;
      say();
      if (left > 0) return;
      clearInterval(timer);
      tab.set(key, true);
      location.assign(link);
    }, 1000);
    say();
    last.append(words);
    actions.append(stay);
  }

  function update() {
    const now = socket.outbox.waiting().length === 0;
    if (now === saved) return;
    saved = now;
    if (!saved)
      last.replaceChildren(
        h(
          "p",
          { class: "waiting", role: "status", data: { testid: "still-saving" } },
          h("span", { class: "spinner", "aria-hidden": "true" }),
          t("Your last answers are on their way. Please keep this page open until this line is gone."),
        ),
      );
    else if (link) forward(link);
    else last.replaceChildren();
  }
  const stayHere = (/** @type {BeforeUnloadEvent} */ event) => saved || event.preventDefault();
  const deafen = [socket.on("ack", update), socket.on("refused", update)];
  addEventListener("beforeunload", stayHere);
  update();
  const element = card({ title, sign, lines: page.content.text, testid: `page-${page.state}`, body: last });
  const close = () => {
    clearInterval(timer);
    for (const stop of deafen) stop();
    removeEventListener("beforeunload", stayHere);
  };
  return { element, close };
}
