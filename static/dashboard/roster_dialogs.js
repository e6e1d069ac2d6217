// What the experimenter does to one participant, each after a question that says what will happen.

import { freshId, h } from "../common/dom.js";
import { ask } from "../common/shell.js";

/** @import { EraseReply, LinkReply, RosterLine, RosterReply } from "../../tests/javascript/api.d.ts" */
/** @import { Api } from "./api.js" */

const person = (/** @type {string} */ participant) => `/api/participants/${encodeURIComponent(participant)}`;

/**
 * @param {Api} api
 * @param {RosterLine} line
 * @returns {Promise<string | null>} what was done, null when nothing was
 */
export async function reject(api, { participant }) {
  const reason = await ask({
    testid: "reject-dialog",
    title: `Reject ${participant}?`,
    danger: true,
    confirm: "Reject",
    text: [
      "The session was completed, but its data cannot be used. Its place in the counterbalancing is given to the next participant. The data stay in the export, marked by the event “rejected”. This cannot be taken back.",
    ],
    field: { label: "Reason (kept in the lab, never exported)", required: true, missing: "Give a reason." },
  });
  if (reason === null) return null;
  await api.send(`${person(participant)}/reject`, { reason });
  return `${participant}: rejected. The cell is free again.`;
}

/**
 * @param {Api} api
 * @param {RosterLine} line
 * @param {RosterReply["withdrawal"]} consentSays
 * @returns {Promise<string | null>}
 */
export async function withdraw(api, { participant }, consentSays) {
  const name = freshId("keep");
  const radio = (/** @type {RosterReply["withdrawal"]} */ value) =>
    h("input", { type: "radio", name, value, checked: value === consentSays, data: { testid: `withdraw-${value}` } });
  const kept = radio("keep");
  const erased = radio("erase");
  const choices = h(
    "fieldset",
    { class: "question" },
    h("legend", {}, `What was recorded so far (the consent text says: ${consentSays})`),
    h(
      "div",
      { class: "options" },
      h("label", { class: "option" }, kept, "Keep it"),
      h("label", { class: "option" }, erased, "Erase it for good"),
    ),
  );
  const reason = await ask({
    testid: "withdraw-dialog",
    title: `Withdraw ${participant} at their wish?`,
    danger: true,
    confirm: "Withdraw",
    extra: choices,
    text: [
      "The session ends at once and the participant sees the page for those who stopped. Their place in the counterbalancing is given to the next participant.",
    ],
    field: { label: "Remark (optional, kept in the lab unless erased, never exported)", required: false },
  });
  if (reason === null) return null;
  const keep = !erased.checked;
  await api.send(`${person(participant)}/withdraw`, { reason: reason || null, keep });
  return `${participant}: withdrawn${keep ? "" : " and erased"}.`;
}

/**
 * @param {Api} api
 * @param {RosterLine} line
 * @returns {Promise<string | null>}
 */
export async function erase(api, { participant }) {
  const typed = await ask({
    testid: "erase-dialog",
    title: `Erase ${participant} for good?`,
    danger: true,
    confirm: "Erase for good",
    text: [
      "Everything about this participant is deleted, and a database in the data folder overwrites the space it took: records, answers, links and names. A session that is running ends. Only the mark that there was a participant of this id stays. This cannot be undone.",
      "Exports you made before, and copies of the data you made elsewhere, are not reached from here.",
    ],
    field: {
      label: `Type ${participant} to confirm`,
      required: true,
      missing: `Type ${participant}.`,
      check: (value) => (value.trim() === participant ? "" : `This is not ${participant}.`),
    },
  });
  if (typed === null) return null;
  /** @type {EraseReply} */
  const { overwritten } = await api.send(`${person(participant)}/erase`, { confirm: typed.trim() });
  if (overwritten === null) {
    return `${participant}: erased. The database is on a server: it overwrites the space in its own time, and its logs and backups are not reached.`;
  }
  return `${participant}: erased.${overwritten ? "" : " The space is overwritten at the next erasure, because another program was reading the data."}`;
}

/**
 * @param {Api} api
 * @param {RosterLine} line
 * @returns {Promise<null>}
 */
export async function newLink(api, { participant }) {
  /** @type {LinkReply} */
  const { link, panel_link } = await api.send(`${person(participant)}/link`, {});
  const second = panel_link ? [h("h3", {}, "Second device"), await qrBox(api, participant, panel_link)] : [];
  await showQr(api, participant, link, `Another link of ${participant}`, second);
  return null;
}

/**
 * A link to read, and as a QR code to scan.
 *
 * @param {Api} api
 * @param {string} participant
 * @param {string} link
 * @param {string} [title]
 * @param {HTMLElement[]} [more] below it
 * @returns {Promise<void>}
 */
export async function showQr(api, participant, link, title = `Link of ${participant}`, more = []) {
  await ask({
    testid: "qr-dialog",
    title,
    text: ["It opens the participant's page and cannot be shown again."],
    confirm: null,
    back: "Close",
    extra: [await qrBox(api, participant, link), ...more],
  });
}

/**
 * @param {Api} api
 * @param {string} participant
 * @param {string} link
 * @returns {Promise<HTMLElement>}
 */
async function qrBox(api, participant, link) {
  const svg = await api.text("/api/qr", { link });
  const picture = h("img", {
    class: "qr",
    alt: `QR code of the link of ${participant}`,
    src: `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`,
    data: { testid: "qr" },
  });
  const field = h("input", {
    type: "text",
    readonly: true,
    value: link,
    "aria-label": `Link of ${participant}`,
    data: { testid: "qr-link" },
  });
  return h("div", { class: "qr-box" }, picture, field);
}
