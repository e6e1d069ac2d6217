// Belief as bars and values over the last minute as lines. Every value also stands there as a number; lines differ by
// their dashes and their names, not only by colour.

import { h, s, setText } from "../common/dom.js";

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

  show(goals) {
    if (goals.map((goal) => goal.id).join() !== [...this.rows.keys()].join()) {
      this.rows = new Map(goals.map((goal) => [goal.id, this._row()]));
      this.body.replaceChildren(...[...this.rows.values()].map((row) => row.element));
    }
    for (const goal of goals) {
      const row = this.rows.get(goal.id);
      setText(row.name, goal.label);
      row.mark.hidden = !goal.instructed;
      row.bar.style.width = `${(100 * goal.probability).toFixed(1)}%`;
      setText(row.number, goal.probability.toFixed(2));
    }
  }

  _row() {
    const name = h("span", {});
    const mark = h("span", { class: "instructed" }, "instructed");
    const bar = h("div", { class: "belief-bar" });
    const number = h("td", { class: "number" });
    return {
      name,
      mark,
      bar,
      number,
      element: h(
        "tr",
        {},
        h("th", { scope: "row" }, name, mark),
        h("td", { class: "belief-track", "aria-hidden": "true" }, h("div", {}, bar)),
        number,
      ),
    };
  }
}

/**
 * A line chart of the last 60 s. `series`: [{key, label, dash}]; `low`/`high`: fixed ends of the axis, or null for
 * what the values need; `marks`: values with a thin line of their own.
 */
export class LineChart {
  constructor({ title, series, low = null, high = null, marks = [], unit = "", digits = 2, testid }) {
    Object.assign(this, { series, low, high, marks, unit, digits, title });
    this.plot = s("g", {});
    this.svg = s(
      "svg",
      { class: "line-chart", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title },
      this.plot,
    );
    this.values = new Map(series.map((one) => [one.key, h("strong", {}, "–")]));
    const legend = h(
      "ul",
      { class: "chart-legend" },
      series.map((one) =>
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
          this.values.get(one.key),
        ),
      ),
    );
    this.element = h("figure", { class: "chart", data: { testid } }, h("figcaption", {}, title), legend, this.svg);
  }

  /** `points`: [{s, values by key}] with the newest last; missing values leave gaps. */
  show(points) {
    const now = points.at(-1)?.s ?? 0;
    const shown = points.filter((point) => now - point.s <= SPAN_S);
    const all = shown.flatMap((point) => this.series.map((one) => point[one.key])).filter(Number.isFinite);
    const low = this.low ?? Math.min(0, ...all);
    let high = this.high ?? Math.max(0, ...all);
    if (high - low < 1e-9) high = low + 1;
    const x = (time) => LEFT + (WIDTH - LEFT - RIGHT) * (1 + (time - now) / SPAN_S);
    const y = (value) => TOP + (HEIGHT - TOP - BOTTOM) * (1 - (value - low) / (high - low));
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
      setText(this.values.get(one.key), Number.isFinite(last) ? `${last.toFixed(this.digits + 1)}${this.unit}` : "–");
    }
    this.plot.replaceChildren(...parts);
  }
}

function axis(y, text) {
  return s(
    "g",
    {},
    s("line", { class: "grid", x1: LEFT, x2: WIDTH - RIGHT, y1: y, y2: y }),
    s("text", { class: "tick", x: LEFT - 6, y: y + 4, "text-anchor": "end" }, text),
  );
}

function path(points, key, x, y) {
  let pen = false;
  let d = "";
  for (const point of points) {
    const there = Number.isFinite(point[key]);
    if (there) d += `${pen ? "L" : "M"}${x(point.s).toFixed(1)} ${y(point[key]).toFixed(1)}`;
    pen = there;
  }
  return d;
}
