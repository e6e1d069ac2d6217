// Drawings for the instruction card: the same shapes and colours as the objects and bins of the scene (sim/view/props.py).
// Those that ship are drawn here; for those of a study's own layout the page is told the look.

import { h, s } from "../common/dom.js";

/** @import { Instruction } from "../../tests/javascript/wire.d.ts" */

/**
 * @typedef {object} Look how an object or bin of a study's own layout is drawn
 * @property {"cylinder" | "box" | "bin"} shape
 * @property {string} color
 * @property {[number, number, number]} [size_m] of an object
 * @property {string} [drawing] id of the object that ships and that it looks like, "" = its shape
 * @property {string} [outline] of an object with a mesh: its silhouette, a path in a square of 100 by 100
 * @property {string} [letter] on a bin
 */

const BLUE = "#0072b2";
const SKY = "#56b4e9";
const GREEN = "#009e73";
const YELLOW = "#f0cd32";
const VERMILION = "#d55e00";
const MAGENTA = "#cc79a7";
const WHITE = "#f6f6f2";
const CREAM = "#ece4d0";
const CARDBOARD = "#a0764c";
const DARK = "#2c323a";
const STEEL = "#969ea6";
const ORANGE = "#e68c00";

/** @type {(x: number, y: number, width: number, height: number, fill: string, rx?: number) => SVGRectElement} */
const rect = (x, y, width, height, fill, rx = 0) => s("rect", { x, y, width, height, rx, fill });
/** @type {(d: string, fill: string) => SVGPathElement} */
const path = (d, fill) => s("path", { d, fill });
/** @type {(cx: number, cy: number, rx: number, ry: number, fill: string) => SVGEllipseElement} */
const oval = (cx, cy, rx, ry, fill) => s("ellipse", { cx, cy, rx, ry, fill });

/** @type {Record<string, () => SVGElement[]>} by the id of an object or a bin */
const DRAWINGS = {
  spray_bottle: () => [
    path("M35 44h30l3 8v56q0 5-5 5H37q-5 0-5-5V52z", SKY),
    path("M35 44q1-8 9-14h12q8 6 9 14z", SKY),
    rect(32, 62, 36, 34, WHITE),
    rect(38, 70, 24, 4, BLUE, 2),
    rect(38, 78, 24, 4, BLUE, 2),
    rect(38, 86, 15, 4, BLUE, 2),
    rect(42, 24, 16, 8, DARK, 1),
    path("M43 24V14H26q-4 0-4-5t4-5h33q9 0 9 9v11z", VERMILION),
    rect(15, 5, 8, 7, DARK, 2),
    path("M32 14h6q-1 9-8 17h-5q6-8 7-17z", DARK),
  ],
  bleach_bottle: () => [
    path("M30 40q2-12 12-18h14q14 6 20 22 3 8 3 16v48q0 6-6 6H34q-6 0-6-6V52q0-6 2-12z", YELLOW),
    path("M63 38q9 4 10 18v10q-5-2-6-9-1-9-5-12z", "#fff"),
    rect(40, 6, 20, 15, BLUE, 3),
    s("path", { d: "M44 7v13M48 7v13M52 7v13M56 7v13", stroke: "#00507e", "stroke-width": 1.4 }),
    rect(28, 68, 51, 36, BLUE),
    rect(28, 80, 51, 11, WHITE),
  ],
  paper_towels: () => [
    rect(28, 14, 44, 96, WHITE),
    oval(50, 110, 22, 5, WHITE),
    oval(50, 14, 22, 6, "#fff"),
    oval(50, 14, 9, 2.7, CARDBOARD),
    oval(50, 14, 6, 1.7, DARK),
    s("path", {
      d: "M28 42q22 8 44 0M28 64q22 8 44 0M28 86q22 8 44 0",
      stroke: STEEL,
      "stroke-width": 1.8,
      "stroke-dasharray": "4 3",
      fill: "none",
    }),
    path("M28 16q-7 4-7 12v78q0 6 7 6z", "#dfe2e4"),
  ],
  wipes_tub: () => [
    path("M42 26q-3-8 2-16 6 3 8 0 4 4 6 1 2 9-1 16z", CREAM),
    rect(27, 36, 46, 74, GREEN, 5),
    rect(27, 54, 46, 38, WHITE),
    ...[0, 1, 2, 3].map((index) => s("circle", { cx: 35.5 + index * 9.7, cy: 73, r: 3.4, fill: GREEN })),
    rect(25, 27, 50, 14, "#fff", 5),
    rect(25, 35, 50, 3, "#d5d9dc"),
  ],
  absorbent_can: () => [
    rect(28, 26, 44, 84, STEEL, 4),
    rect(29, 40, 42, 58, VERMILION),
    rect(29, 44, 42, 8, DARK),
    rect(29, 86, 42, 8, DARK),
    path("M50 55q11 14 11 20a11 9 0 0 1-22 0q0-6 11-20z", CREAM),
    rect(26, 22, 48, 9, STEEL, 3),
    rect(26, 103, 48, 8, STEEL, 3),
    rect(35, 13, 30, 10, DARK, 3),
    ...[40, 46.6, 53.3, 60].map((cx) => s("circle", { cx, cy: 18, r: 1.7, fill: CREAM })),
  ],
  sponge_pack: () => [
    ...[0, 1, 2].flatMap((index) => [
      rect(22, 26 + index * 29, 56, 19, MAGENTA, 4),
      rect(22, 44 + index * 29, 56, 8, "#5c2d58", 2),
    ]),
    ...[
      [30, 34],
      [68, 32],
      [71, 65],
      [29, 61],
      [31, 92],
      [69, 94],
    ].map(([cx, cy]) => s("circle", { cx, cy, r: 2, fill: "#a85a86" })),
    rect(39, 23, 22, 90, WHITE),
  ],
  practice_block: () => [rect(28, 12, 44, 100, CARDBOARD, 5), rect(28, 34, 44, 12, CREAM), rect(28, 74, 44, 12, CREAM)],
  left_bin: () => bin(BLUE, "L"),
  right_bin: () => bin(ORANGE, "R"),
};

/** @type {(color: string) => number} how bright `#rrggbb` is to the eye, 0 to 255 */
const brightness = (color) =>
  [0.299, 0.587, 0.114].reduce(
    (sum, share, channel) => sum + share * Number.parseInt(color.slice(1 + 2 * channel, 3 + 2 * channel), 16),
    0,
  );

/**
 * A mesh's silhouette, or an upright can or carton with a band, in its proportions, as the scene shows it.
 *
 * @param {Look} look
 * @returns {SVGElement[]}
 */
function solid({ shape, color, outline, size_m = [0.06, 0.06, 0.12] }) {
  const [, wide_m, high_m] = size_m;
  const scale = Math.min(56 / wide_m, 92 / high_m);
  const [width, height] = [wide_m * scale, high_m * scale];
  const [left, top] = [50 - width / 2, 110 - height];
  if (outline) {
    const place = `translate(${left} ${top}) scale(${width / 100} ${height / 100})`;
    return [s("path", { d: outline, fill: color, stroke: "none", transform: place })];
  }
  const band = brightness(color) > 200 ? DARK : WHITE;
  const marked = (/** @type {number} */ rounded) => [
    rect(left, top, width, height, color, rounded),
    rect(left, top + 0.4 * height, width, 0.35 * height, band),
  ];
  if (shape === "box") return marked(4);
  const lid = Math.min(6, width / 8);
  return [...marked(5), oval(50, top + lid / 2, width / 2, lid, color)];
}

/**
 * @param {string} color
 * @param {string} letter
 * @returns {SVGElement[]}
 */
function bin(color, letter) {
  return [
    path("M10 30h80l-8 78q-.5 4-5 4H23q-4.500 0-5-4z", color),
    path("M16 30h68l-2 10H18z", DARK),
    s("path", { d: "M10 30h80", stroke: WHITE, "stroke-width": 7, "stroke-linecap": "round" }),
    s(
      "text",
      {
        x: 50,
        y: 96,
        "text-anchor": "middle",
        "font-size": 50,
        "font-weight": 800,
        fill: brightness(color) > 120 ? DARK : WHITE,
        "font-family": "sans-serif",
      },
      letter,
    ),
  ];
}

const unknown = () => [
  s("rect", { x: 24, y: 24, width: 52, height: 84, rx: 6, fill: STEEL }),
  s(
    "text",
    {
      x: 50,
      y: 80,
      "text-anchor": "middle",
      "font-size": 38,
      "font-weight": 700,
      fill: WHITE,
      "font-family": "sans-serif",
    },
    "?",
  ),
];

/**
 * A drawing of an object or bin; an unknown id without a look gets a neutral box. The words beside it name it.
 *
 * @param {string} id
 * @param {Look} [look]
 * @returns {SVGSVGElement}
 */
export function drawing(id, look) {
  const known = look?.drawing || id;
  const own = () => (look?.shape === "bin" ? bin(look.color, look.letter ?? "") : look ? solid(look) : unknown());
  const draw = look && !look.drawing ? own : (Object.hasOwn(DRAWINGS, known) && DRAWINGS[known]) || unknown;
  const outline = { stroke: "#1d2530", "stroke-opacity": 0.55, "stroke-width": 1.2 };
  return s(
    "svg",
    { class: "drawing", viewBox: "0 0 100 120", "aria-hidden": "true", focusable: "false", "data-drawing": id },
    s("g", outline, draw()),
  );
}

/**
 * What an instruction is about: the object, and the bin once one is named; the one that matters now is framed.
 *
 * @param {Pick<Instruction, "kind" | "object" | "object_label" | "bin" | "bin_label">} instruction
 * @param {Record<string, Look>} [looks] of a layout of the study's own, by id
 * @returns {Element[]}
 */
export function instructionPicture({ kind, object, object_label, bin: into, bin_label }, looks = {}) {
  const figure = (/** @type {string} */ id, /** @type {string | null} */ label, /** @type {boolean} */ now) =>
    h(
      "figure",
      { class: now ? "stage now" : "stage" },
      drawing(id, looks[id]),
      h("figcaption", {}, label ?? id.replaceAll("_", " ")),
    );
  const arrow = () =>
    s(
      "svg",
      { class: "arrow", viewBox: "0 0 24 24", "aria-hidden": "true" },
      s("path", { d: "M3 10.5h11V5l7 7-7 7v-5.500H3z" }),
    );
  const first = object === null ? [] : [figure(object, object_label, kind !== "dropoff")];
  const second = into === null ? [] : [figure(into, bin_label, kind === "dropoff")];
  return [...first, ...(first.length && second.length ? [arrow()] : []), ...second];
}
