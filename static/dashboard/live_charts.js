// Belief as bars and values over the last minute as lines. Every value also stands there as a number; lines differ by
// their dashes and their names, not only by colour.

import { h, s, setText } from "../common/dom.js";

/** @import { Goal } from "../../tests/javascript/api.d.ts" */
/** @typedef {{ key: string, label: string, dash?: string }} Series */
/** @typedef {Record<string, number | null | undefined> & { s: number }} Point values by key at a trial time; what is missing leaves a gap */

const WIDTH = 520;
const HEIGHT = 150;
const LEFT = 44;
const RIGHT = 12;
const TOP = 10;
const BOTTOM = 26;
const SPAN_S = 60;

/** A table of goals with a bar and a number each; rows stay the same elements from tick to tick. */
export class BeliefBars {
  constructor() {
    /** @type {Map<string, ReturnType<typeof beliefRow>>} */
    this.rows = new Map();
    this.body = h("tbody", {});
    this.element = h(
      "table",
      { class: "belief", data: { testid: "belief" } },
      h("caption", { class: "visually-hidden" }, "Belief: how likely each goal is to the robot"),
      h(
        "thead",
        { class: "visually-hidden" },
        h(
          "tr",
          {},
          ["Goal", "Bar", "Probability"].map((name) => h("th", { scope: "col" }, name)),
        ),
      ),
      this.body,
    );
  }

  /**
   * @param {ReadonlyArray<Goal>} goals
   * @returns {void}
   */
  show(goals) {
    if (goals.map((goal) => goal.id).join() !== [...this.rows.keys()].join()) {
      this.rows = new Map(goals.map((goal) => [goal.id, beliefRow()]));
      this.body.replaceChildren(...[...this.rows.values()].map((row) => row.element));
    }
    for (const goal of goals) {
      const row = this.rows.get(goal.id);
      if (!row) continue;
      setText(row.name, goal.label);
      row.mark.hidden = !goal.instructed;
      row.bar.style.width = `${(100 * goal.probability).toFixed(1)}%`;
      setText(row.number, goal.probability.toFixed(2));
    }
  }
}

function beliefRow() {
  const name = h("span", {});
  const mark = h("span", { class: "instructed" }, "instructed");
  const bar = h("div", { class: "belief-bar" });
  const number = h("td", { class: "number" });
  const element = h(
    "tr",
    {},
    h("th", { scope: "row" }, name, mark),
    h("td", { class: "belief-track", "aria-hidden": "true" }, h("div", {}, bar)),
    number,
  );
  return { name, mark, bar, number, element };
}

/** A line chart of the last 60 s. */
export class LineChart {
  /**
   * @param {object} chart
   * @param {string} chart.title
   * @param {Series[]} chart.series
   * @param {number | null} [chart.low] lower end of the axis; null for what the values need
   * @param {number | null} [chart.high]
   * @param {number[]} [chart.marks] values with a thin line of their own
   * @param {number} [chart.digits]
   * @param {string} chart.testid
   */
  constructor({ title, series, low = null, high = null, marks = [], digits = 2, testid }) {
    this.low = low;
    this.high = high;
    this.marks = marks;
    this.digits = digits;
    this.plot = s("g", {});
    this.svg = s(
      "svg",
      { class: "line-chart", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title },
      this.plot,
    );
    this.series = series.map((one) => ({ ...one, value: h("strong", {}, "–") }));
    const legend = h(
      "ul",
      { class: "chart-legend" },
      this.series.map((one) =>
        h(
          "li",
          {},
          s(
            "svg",
            { viewBox: "0 0 30 8", "aria-hidden": "true" },
            s("line", {
              x1: 0,
              y1: 4,
              x2: 30,
              y2: 4,
              class: `line ${one.key}`,
              "stroke-dasharray": one.dash ?? "none",
            }),
          ),
          one.label,
          " ",
          one.value,
        ),
      ),
    );
    this.element = h("figure", { class: "chart", data: { testid } }, h("figcaption", {}, title), legend, this.svg);
  }

  /**
   * Draws points, the newest last.
   *
   * @param {Point[]} points
   * @returns {void}
   */
  show(points) {
    const now = points.at(-1)?.s ?? 0;
    const shown = points.filter((point) => now - point.s <= SPAN_S);
    const all = shown.flatMap((point) => this.series.map((one) => point[one.key])).filter(isNumber);
    const low = this.low ?? Math.min(0, ...all);
    let high = this.high ?? Math.max(0, ...all);
    if (high - low < 1e-9) high = low + 1;
    const x = (/** @type {number} */ time) => LEFT + (WIDTH - LEFT - RIGHT) * (1 + (time - now) / SPAN_S);
    const y = (/** @type {number} */ value) => TOP + (HEIGHT - TOP - BOTTOM) * (1 - (value - low) / (high - low));
    /** @type {SVGElement[]} */
    const parts = [low, (low + high) / 2, high].map((value) => axis(y(value), value.toFixed(this.digits)));
    for (const seconds of [-60, -40, -20, 0])
      parts.push(
        s(
          "text",
          { class: "tick", x: x(now + seconds), y: HEIGHT - 8, "text-anchor": seconds === 0 ? "end" : "middle" },
          seconds === 0 ? "now" : `${seconds} s`,
        ),
      );
    for (const value of this.marks)
      parts.push(
        s("line", { class: "threshold", x1: LEFT, x2: WIDTH - RIGHT, y1: y(value), y2: y(value) }),
        s("text", { class: "tick", x: WIDTH - RIGHT, y: y(value) - 3, "text-anchor": "end" }, value.toFixed(1)),
      );
    for (const one of this.series) {
      parts.push(
        s("path", { class: `line ${one.key}`, "stroke-dasharray": one.dash ?? "none", d: path(shown, one.key, x, y) }),
      );
      const last = points.at(-1)?.[one.key];
      setText(one.value, isNumber(last) ? last.toFixed(this.digits + 1) : "–");
    }
    this.plot.replaceChildren(...parts);
  }
}

/**
 * @param {number} y
 * @param {string} text
 * @returns {SVGGElement}
 */
function axis(y, text) {
  return s(
    "g",
    {},
    s("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y, y2: y }),
    s("text", { class: "tick", x: LEFT - 6, y: y + 4, "text-anchor": "end" }, text),
  );
}

/**
 * @param {Point[]} points
 * @param {string} key
 * @param {(time: number) => number} x
 * @param {(value: number) => number} y
 * @returns {string} what an SVG path calls d
 */
function path(points, key, x, y) {
  let pen = false;
  let d = "";
  for (const point of points) {
    const value = point[key];
    const there = isNumber(value);
    if (there) d += `${pen ? "L" : "M"}${x(point.s).toFixed(1)} ${y(value).toFixed(1)}`;
    pen = there;
  }
  return d;
}

/**
 * @param {unknown} value
 * @returns {value is number}
 */
function isNumber(value) {
  return Number.isFinite(value);
}
