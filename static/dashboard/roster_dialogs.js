// What the experimenter does to one participant, each after a question that says what will happen.

import { freshId, h } from "../common/dom.js";
import { ask } from "../common/shell.js";

const person = (participant) => `/api/participants/${encodeURIComponent(participant)}`;

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

export async function withdraw(api, { participant }, consentSays) {
  const name = freshId("keep");
  const choice = (value, label) =>
    h(
      "label",
      { class: "option" },
      h("input", { type: "radio", name, value, checked: value === consentSays, data: { testid: `withdraw-${value}` } }),
      label,
    );
  const choices = h(
    "fieldset",
    { class: "question" },
    h("legend", {}, `What was recorded so far (the consent text says: ${consentSays})`),
    h("div", { class: "options" }, choice("keep", "Keep it"), choice("erase", "Erase it for good")),
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
  const keep = choices.querySelector("input:checked")?.value !== "erase";
  await api.send(`${person(participant)}/withdraw`, { reason: reason || null, keep });
  return `${participant}: withdrawn${keep ? "" : " and erased"}.`;
}

export async function erase(api, { participant }) {
  const typed = await ask({
    testid: "erase-dialog",
    title: `Erase ${participant} for good?`,
    danger: true,
    confirm: "Erase for good",
    text: [
      "Everything about this participant is deleted and the space it took is overwritten: records, answers, links and names. A session that is running ends. Only the mark that there was a participant of this id stays. This cannot be undone.",
      "Exports you made before and backups are not reached from here.",
    ],
    field: {
      label: `Type ${participant} to confirm`,
      required: true,
      missing: `Type ${participant}.`,
      check: (value) => (value === participant ? "" : `This is not ${participant}.`),
    },
  });
  if (typed === null) return null;
  const { overwritten } = await api.send(`${person(participant)}/erase`, { confirm: typed });
  return `${participant}: erased.${overwritten ? "" : " The space is overwritten at the next erasure, because another program was reading the data."}`;
}

export async function newLink(api, { participant }) {
  const { link } = await api.send(`${person(participant)}/link`, {});
  await showQr(api, participant, link, `Another link of ${participant}`);
  return null;
}

/** A link to read, and as a QR code to scan. */
export async function showQr(api, participant, link, title = `Link of ${participant}`) {
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
  await ask({
    testid: "qr-dialog",
    title,
    text: ["It opens the participant's page and cannot be shown again."],
    confirm: null,
    back: "Close",
    extra: h("div", { class: "qr-box" }, picture, field),
  });
}
