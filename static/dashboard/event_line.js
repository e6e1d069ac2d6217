// One event of a session's record, as a line of a list.

import { h, icon } from "../common/dom.js";

/** @import { SessionEvent } from "./api.js" */

/**
 * @param {unknown} value
 * @returns {string}
 */
function shown(value) {
  if (typeof value === "number") return String(Math.round(value * 100) / 100);
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}

/**
 * @param {SessionEvent} event
 * @returns {HTMLLIElement}
 */
export function eventLine({ utc, kind, source, data, tick }) {
  // What a page noted by itself says nothing of who did it and has no words that the lab kept.
  const isNote = kind.startsWith("page.");
  const { by, text, ...rest } = isNote ? {} : data;
  const details = Object.entries(isNote ? data : rest)
    .filter(([, value]) => value !== null && value !== "")
    .map(([name, value]) => `${name}: ${shown(value)}`)
    .join(", ");
  const at = new Date(utc).toLocaleTimeString([], { hour12: false });
  const who = by && by !== source ? `${source} ${by}` : source;
  return h(
    "li",
    {},
    h("span", { class: "event-at" }, at),
    h(
      "span",
      {},
      h("strong", {}, kind.replaceAll(/[_.]/g, " ")),
      ` by ${who}${tick === null ? "" : `, tick ${tick}`}`,
      text ? h("span", { class: "event-words" }, `“${text}”`) : null,
      details ? h("span", { class: "event-details" }, details) : null,
    ),
    text ? icon("info") : null,
  );
}
