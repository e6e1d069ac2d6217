// The counterbalancing as a filled grid: one row for each order of the conditions, one chip for each participant.

import { h, icon } from "../common/dom.js";

/** @import { CellReply, GridReply } from "../../tests/javascript/api.d.ts" */
/** @import { IconName } from "../common/dom.js" */

/** @type {Record<CellReply["cell"], [sign: IconName, words: string]>} */
const CELLS = {
  done: ["check", "complete"],
  under_way: ["play", "under way"],
  waiting: ["clock", "not opened or at consent"],
};
const SHOWN = 24;

/**
 * @param {GridReply[]} rows
 * @returns {HTMLTableElement}
 */
export function gridTable(rows) {
  const most = Math.max(1, ...rows.map((row) => row.cells.length));
  const body = rows.map((row) =>
    h(
      "tr",
      { class: row.next ? "next-order" : "", data: { testid: "order-row", next: row.next } },
      h(
        "th",
        { scope: "row" },
        row.order.map((name, index) => [index > 0 && h("span", { "aria-label": "then" }, " → "), name]),
      ),
      h(
        "td",
        { class: "number" },
        String(row.cells.length),
        h("small", { class: "ids", data: { testid: "order-counts" } }, balance(row.counts)),
        h("span", { class: "fill", "aria-hidden": "true", style: `--share: ${row.cells.length / most}` }),
      ),
      h("td", {}, chips(row.cells)),
      h(
        "td",
        {},
        row.next && h("strong", { class: "mark-line", data: { level: "good" } }, icon("play"), "Next participant"),
      ),
    ),
  );
  return h(
    "table",
    { class: "sessions order-grid", data: { testid: "order-grid" } },
    h("caption", { class: "visually-hidden" }, "Orders of the conditions and who holds each"),
    h(
      "thead",
      {},
      h(
        "tr",
        {},
        ["Order", "Filled", "Participants", "Given out next"].map((name) => h("th", { scope: "col" }, name)),
      ),
    ),
    h("tbody", {}, body),
  );
}

/**
 * What has become of those who were given an order; those whose place lapsed hold no cell.
 *
 * @param {GridReply["counts"]} counts
 * @returns {string}
 */
function balance({ done = 0, under_way = 0, waiting = 0, lapsed = 0 }) {
  const told = [`${done} complete`, `${under_way} under way`];
  if (waiting) told.push(`${waiting} not begun`);
  if (lapsed) told.push(`${lapsed} lapsed`);
  return told.join(", ");
}

/**
 * @param {CellReply[]} cells
 * @returns {HTMLElement}
 */
function chips(cells) {
  const shown = cells.slice(-SHOWN);
  const left = cells.length - shown.length;
  return h(
    "ul",
    { class: "chips" },
    left > 0 && h("li", { class: "chip" }, `${left} more`),
    shown.map(({ participant, cell }) => {
      const [sign, words] = CELLS[cell];
      return h(
        "li",
        { class: "chip", title: `${participant}: ${words}`, data: { cell, participant } },
        icon(sign),
        participant,
        h("span", { class: "visually-hidden" }, `, ${words}`),
      );
    }),
  );
}

/** @returns {HTMLElement} */
export function legend() {
  return h(
    "p",
    { class: "hint legend" },
    Object.values(CELLS).map(([sign, words]) => h("span", { class: "mark-line" }, icon(sign), words)),
  );
}
