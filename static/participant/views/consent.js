// What taking part means: agree, or choose not to.

import { freshId, h, icon, whileBusy } from "../../common/dom.js";
import { t } from "../../common/language.js";
import { ask, card } from "../../common/shell.js";
import { paragraphs } from "../forms.js";
import { pictureCheck } from "../picture_check.js";

/** @import { Context, PageOf, View } from "../view.js" */

/**
 * @param {Context} context
 * @param {PageOf<{ title: string, text: string[], contact: string, hash: string, needs_picture?: boolean }>} page
 * @returns {View}
 */
export function view({ socket }, page) {
  const { title, text, contact, hash, needs_picture = false } = page.content;
  const picture = pictureCheck({ socket, needed: needs_picture });
  const boxId = freshId("agree");
  const box = h("input", { type: "checkbox", id: boxId, data: { testid: "consent-box" } });
  const error = h(
    "p",
    { class: "field-error", role: "alert", hidden: true },
    icon("warning"),
    h("span", {}, t("Tick the box above if you agree, or choose not to take part.")),
  );
  box.addEventListener("change", () => {
    error.hidden = true;
  });
  const agree = h(
    "button",
    { type: "submit", class: "primary large", data: { testid: "consent-agree" } },
    t("Agree and continue"),
  );
  const decline = h(
    "button",
    { type: "button", class: "secondary large", data: { testid: "consent-decline" } },
    t("I do not want to take part"),
  );
  decline.addEventListener("click", async () => {
    const answer = await ask({
      title: t("Not take part?"),
      text: [t("Nothing has been recorded about you. You cannot come back with this link.")],
      confirm: t("Do not take part"),
      danger: true,
      testid: "decline-dialog",
    });
    if (answer !== null) whileBusy(decline, t("Saving"), () => socket.submit("decline").catch(() => {}));
  });
  const form = h(
    "form",
    { novalidate: true },
    h("label", { class: "agree", for: boxId }, box, h("span", {}, t("I have read this and I agree to take part."))),
    error,
    h("div", { class: "actions" }, agree, decline),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (!box.checked) {
      error.hidden = false;
      box.focus();
      return;
    }
    if (!picture.fits()) return;
    whileBusy(agree, t("Saving"), () => socket.submit("consent", { accepted: true, hash }).catch(() => {}));
  });
  const element = card({
    title: title || t("Taking part"),
    testid: "page-consent",
    body: [
      picture.element,
      h("div", { class: "prose" }, paragraphs(text)),
      contact ? h("p", { class: "contact" }, contact) : null,
      form,
    ],
  });
  return { element };
}
