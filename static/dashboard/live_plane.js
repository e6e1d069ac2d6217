// The paper's Fig. 2, live: what each place of the table is worth to the robot. Drawn as the person at the table sees
// it from behind the robot: forward (x) is up, left (y) is left.

import { freshId, h, setText } from "../common/dom.js";
import { problemText } from "../common/problem.js";

/** @import { Plane } from "../../tests/javascript/api.d.ts" */
/** @typedef {(metres: number) => number} ToPixels */

const EVERY_MS = 500;
const SCALE = 620; // pixels a metre
const MARGIN = { left: 58, right: 14, top: 14, bottom: 46 };
const STEP_M = 0.2;
// From light to dark, one hue to the next: the order stays readable without colour.
const RAMP = [
  [250, 247, 225],
  [250, 214, 137],
  [238, 155, 88],
  [200, 91, 90],
  [138, 46, 101],
  [66, 20, 84],
];
const KINDS = { information: "A · Expected information gain", reward: "B · Goal-oriented reward" };

export class PlaneView {
  /** @param {{ load: (kind: Plane["kind"]) => Promise<Plane> }} wiring */
  constructor({ load }) {
    this.load = load;
    /** @type {Plane["kind"]} */
    this.kind = "information";
    this.busy = false;
    this.lastMs = -Infinity;
    this.again = 0;
    const name = freshId("plane");
    this.canvas = h("canvas", {
      class: "plane",
      role: "img",
      "aria-label": "Heatmap over the table",
      data: { testid: "heatmap" },
    });
    this.legend = h("div", { class: "plane-legend" });
    this.goals = h("ol", { class: "plane-goals", type: "A" });
    this.caption = h("p", { class: "hint" });
    this.note = h("p", { class: "hint", role: "status" }, "There is a heatmap while the robot is being driven.");
    const choice = (/** @type {Plane["kind"]} */ kind) =>
      h(
        "label",
        {},
        h("input", {
          type: "radio",
          name,
          value: kind,
          checked: kind === this.kind,
          data: { testid: `heatmap-${kind}` },
          on: { change: () => this._choose(kind) },
        }),
        KINDS[kind],
      );
    this.picture = h(
      "div",
      { class: "plane-picture", hidden: true },
      h("div", { class: "plane-scroll" }, this.canvas),
      h("div", {}, this.legend, h("h3", {}, "Goals"), this.goals),
    );
    this.element = h(
      "section",
      { class: "board-card", "aria-labelledby": `${name}-title` },
      h("h2", { id: `${name}-title` }, "Where the robot would rather be (paper, Fig. 2)"),
      h(
        "fieldset",
        { class: "plane-choice" },
        h("legend", { class: "visually-hidden" }, "Heatmap"),
        choice("information"),
        choice("reward"),
      ),
      this.note,
      this.picture,
      this.caption,
    );
  }

  /**
   * Draws the newest tick, at most twice a second; what comes meanwhile is drawn together, a little later.
   *
   * @returns {Promise<void>}
   */
  async refresh() {
    const waitMs = this.busy ? EVERY_MS : this.lastMs + EVERY_MS * 0.9 - performance.now();
    clearTimeout(this.again);
    if (waitMs > 0) {
      this.again = setTimeout(() => this.element.isConnected && this.refresh(), waitMs);
      return;
    }
    this.busy = true;
    this.lastMs = performance.now();
    const kind = this.kind;
    try {
      const plane = await this.load(kind);
      if (kind === this.kind) this._draw(plane);
    } catch (error) {
      this.picture.hidden = true;
      this.caption.hidden = true;
      this.note.hidden = false;
      setText(this.note, problemText(error));
    } finally {
      this.busy = false;
    }
    if (kind !== this.kind) this._again();
  }

  /** @param {Plane["kind"]} kind */
  _choose(kind) {
    this.kind = kind;
    this._again();
  }

  _again() {
    this.lastMs = -Infinity;
    this.refresh();
  }

  /** @param {Plane} plane */
  _draw(plane) {
    this.note.hidden = true;
    this.picture.hidden = false;
    this.caption.hidden = false;
    const { x_m, y_m, values } = plane;
    const [x0, x1] = ends(x_m);
    const [y0, y1] = ends(y_m);
    const width = (y1 - y0) * SCALE;
    const height = (x1 - x0) * SCALE;
    const { left, top, right, bottom } = MARGIN;
    this.canvas.width = Math.round(width + left + right);
    this.canvas.height = Math.round(height + top + bottom);
    const pen = this.canvas.getContext("2d");
    if (!pen) return; // the words below say the same
    /** @type {ToPixels} */
    const px = (y) => left + (y1 - y) * SCALE;
    /** @type {ToPixels} */
    const py = (x) => top + (x1 - x) * SCALE;
    const all = values.flat();
    const [low, high] = [Math.min(...all), Math.max(...all)];
    const cell = { w: width / (y_m.length - 1), h: height / (x_m.length - 1) };
    pen.save();
    pen.beginPath();
    pen.rect(left, top, width, height);
    pen.clip();
    for (const { x, y, value } of places(plane)) {
      pen.fillStyle = colour((value - low) / (high - low || 1));
      pen.fillRect(px(y) - cell.w / 2, py(x) - cell.h / 2, cell.w + 1, cell.h + 1);
    }
    pen.restore();
    frame(pen, px, py, plane, { left, top, width, height });
    for (const [index, { position_m }] of plane.goals.entries()) {
      if (position_m) mark(pen, px(position_m[1]), py(position_m[0]), letter(index));
    }
    cross(pen, px(plane.gripper_m[1]), py(plane.gripper_m[0]));
    this._words(plane, low, high);
  }

  /**
   * @param {Plane} plane
   * @param {number} low
   * @param {number} high
   */
  _words(plane, low, high) {
    const digits = high - low < 0.01 ? 4 : 3;
    const unit = plane.unit === "m" ? " m" : "";
    const stops = [high, (low + high) / 2, low].map((value) => h("span", {}, `${value.toFixed(digits)}${unit}`));
    this.legend.replaceChildren(
      h("div", {
        class: "plane-ramp",
        style: `background: linear-gradient(${rampStops()})`,
      }),
      h("div", { class: "plane-stops" }, stops),
    );
    this.goals.replaceChildren(
      ...plane.goals.map((goal) =>
        h(
          "li",
          {},
          `${goal.label}: ${goal.probability.toFixed(2)}`,
          goal.instructed ? h("span", { class: "instructed" }, "instructed") : null,
        ),
      ),
    );
    setText(
      this.caption,
      `${plane.caption} Plane at the gripper's height, z = ${plane.z_m.toFixed(2)} m; + is the gripper, the outline is the table. Tick ${plane.tick}.`,
    );
    this.canvas.setAttribute(
      "aria-label",
      `${KINDS[plane.kind]} over the table: from ${low.toFixed(digits)} to ${high.toFixed(digits)}${unit}, highest ${highest(plane)}.`,
    );
  }
}

/**
 * The least and the greatest.
 *
 * @param {number[]} values
 * @returns {[low: number, high: number]}
 */
function ends(values) {
  return [Math.min(...values), Math.max(...values)];
}

/**
 * Each place of the plane with its value.
 *
 * @param {Plane} plane
 * @returns {{ x: number, y: number, value: number }[]}
 */
function places({ x_m, y_m, values }) {
  return x_m.flatMap((x, i) => y_m.map((y, j) => ({ x, y, value: values[i]?.[j] ?? 0 })));
}

/**
 * @param {Plane} plane
 * @returns {string}
 */
function highest(plane) {
  const best = places(plane).reduce((high, place) => (place.value > high.value ? place : high));
  return `at x = ${best.x.toFixed(2)} m, y = ${best.y.toFixed(2)} m`;
}

/**
 * The ramp as stops of a CSS gradient, the highest first.
 *
 * @returns {string}
 */
function rampStops() {
  const last = RAMP.length - 1;
  return [...RAMP]
    .reverse()
    .map((one, index) => `rgb(${one.join(" ")}) ${(100 * index) / last}%`)
    .join(", ");
}

/**
 * @param {number} index
 * @returns {string}
 */
function letter(index) {
  return String.fromCharCode(65 + index);
}

/**
 * @param {number} share from 0, lowest, to 1
 * @returns {string}
 */
function colour(share) {
  const place = Math.min(0.9999, Math.max(0, share)) * (RAMP.length - 1);
  const [below = [], above = below] = RAMP.slice(Math.floor(place));
  const channels = below.map((from, index) => Math.round(from + ((above[index] ?? from) - from) * (place % 1)));
  return `rgb(${channels.join(" ")})`;
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {ToPixels} px
 * @param {ToPixels} py
 * @param {Plane} plane
 * @param {{ left: number, top: number, width: number, height: number }} box in pixels
 */
function frame(pen, px, py, { x_m, y_m, table_m }, { left, top, width, height }) {
  pen.strokeStyle = "#17212b";
  pen.fillStyle = "#17212b";
  pen.lineWidth = 1;
  pen.strokeRect(left, top, width, height);
  pen.setLineDash([6, 4]);
  pen.strokeRect(px(table_m[3]), py(table_m[1]), px(table_m[2]) - px(table_m[3]), py(table_m[0]) - py(table_m[1]));
  pen.setLineDash([]);
  pen.font = "13px system-ui, sans-serif";
  pen.textAlign = "center";
  for (const y of steps(y_m)) pen.fillText(y.toFixed(1), px(y), top + height + 18);
  pen.fillText("y, metres (left of the robot is positive)", left + width / 2, top + height + 38);
  pen.textAlign = "right";
  for (const x of steps(x_m)) pen.fillText(x.toFixed(1), left - 6, py(x) + 4);
  pen.save();
  pen.translate(14, top + height / 2);
  pen.rotate(-Math.PI / 2);
  pen.textAlign = "center";
  pen.fillText("x, metres (forward)", 0, 0);
  pen.restore();
}

/**
 * @param {number[]} values
 * @returns {number[]}
 */
function steps(values) {
  const [low, high] = ends(values);
  const first = Math.ceil(low / STEP_M - 1e-6);
  const last = Math.floor(high / STEP_M + 1e-6);
  return Array.from({ length: last - first + 1 }, (_, index) => (first + index) * STEP_M);
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {number} x
 * @param {number} y
 * @param {string} text
 */
function mark(pen, x, y, text) {
  pen.beginPath();
  pen.arc(x, y, 11, 0, 2 * Math.PI);
  pen.fillStyle = "#fff";
  pen.fill();
  pen.lineWidth = 2;
  pen.strokeStyle = "#17212b";
  pen.stroke();
  pen.fillStyle = "#17212b";
  pen.font = "bold 13px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.fillText(text, x, y + 4.5);
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {number} x
 * @param {number} y
 */
function cross(pen, x, y) {
  for (const { stroke, width } of [
    { stroke: "#fff", width: 7 },
    { stroke: "#0b5c7d", width: 3 },
  ]) {
    pen.strokeStyle = stroke;
    pen.lineWidth = width;
    pen.beginPath();
    pen.moveTo(x - 10, y);
    pen.lineTo(x + 10, y);
    pen.moveTo(x, y - 10);
    pen.lineTo(x, y + 10);
    pen.stroke();
  }
}
