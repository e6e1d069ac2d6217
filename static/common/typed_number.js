// A number as somebody typed it, in any script: which numbers it can be. `study/flow/typed_number.py` reads alike, and
// has the last word; a test holds the two together.

import { either, LANGUAGE, t, numeral as written } from "./language.js";

const ALIKE = new Map([
  ...[..."．﹒。｡"].map((mark) => /** @type {const} */ ([mark, "."])),
  ...[..."，﹐、､،"].map((mark) => /** @type {const} */ ([mark, ","])),
  ...[..."−－﹣‐‑‒–"].map((mark) => /** @type {const} */ ([mark, "-"])),
  ...[..."＋﹢"].map((mark) => /** @type {const} */ ([mark, "+"])),
  ...[..."’＇"].map((mark) => /** @type {const} */ ([mark, "'"])),
  ...[..."ｅＥ"].map((mark) => /** @type {const} */ ([mark, "e"])),
]);
const DECIMALS = ".,\u066b";
const THOUSANDS = ".,' \u066c";
const WHOLE = /^([+-]?) *([0-9.,\u066b' \u066c]*[0-9])(?:[eE]([+-]?[0-9]+))?$/u;
const MAX_EXPONENT_DIGITS = 6;

/** @typedef {{ mark?: string, whole?: boolean, least?: number | null, most?: number | null }} Bounds what a question takes */

/**
 * The plain numerals that this can stand for; none when it is no number. Two: the mark may be a decimal or a thousands
 * mark, and the first takes it for a decimal mark.
 *
 * @param {string} typed
 * @returns {string[]}
 */
export function numerals(typed) {
  const found = WHOLE.exec(plain(typed).trim());
  if (!found) return [];
  const [, sign = "", mantissa = "", exponent] = found;
  let digits = (exponent ?? "").replace(/^[+-]?0*/u, "");
  if (digits.length > MAX_EXPONENT_DIGITS) digits = "9".repeat(MAX_EXPONENT_DIGITS);
  const tail = digits === "" ? "" : `e${exponent?.startsWith("-") ? "-" : ""}${digits}`;
  return readings(mantissa, exponent === undefined).map(([whole, fraction]) => {
    const minus = sign === "-" && /[1-9]/u.test(whole + fraction) ? "-" : "";
    return `${minus}${whole.replace(/^0+/u, "") || "0"}${fraction ? `.${fraction}` : ""}${tail}`;
  });
}

/**
 * What is wrong with a number for a question, in words that follow the number; null when it can be taken.
 *
 * @param {string} typed
 * @param {Bounds} asked
 * @returns {string | null}
 */
export function numberProblem(typed, { mark = LANGUAGE.decimal, whole = false, least = null, most = null } = {}) {
  const read = numerals(typed);
  const [numeral] = read;
  const shown = { typed: typed.trim() };
  if (numeral === undefined)
    return t("“{typed}” is not a number. Please write it in digits alone, such as {whole} or {fraction}.", {
      ...shown,
      whole: 12,
      fraction: 3.5,
    });
  if (read.length > 1 && [...plain(typed)].find((one) => DECIMALS.includes(one)) !== mark)
    return t("“{typed}” could be {numbers}. Please write {mark} for decimals, and no mark between thousands.", {
      ...shown,
      numbers: either([...read].reverse().map(written)),
      mark,
    });
  const value = Number(numeral);
  if (!Number.isFinite(value)) return t("“{typed}” is too large.", shown);
  if (value === 0 && /[1-9]/u.test(numeral.replace(/e.*/u, ""))) return t("“{typed}” is too small.", shown);
  if (whole && !Number.isInteger(value)) return t("“{typed}” is not a whole number.", shown);
  if (least !== null && value < least)
    return t("“{typed}” is below {least}, the least that is taken.", { ...shown, least });
  if (most !== null && value > most) return t("“{typed}” is above {most}, the most that is taken.", { ...shown, most });
  return null;
}

/**
 * Every character as the plain one it stands for, without those that nobody sees.
 *
 * @param {string} typed
 * @returns {string}
 */
function plain(typed) {
  return [...typed].map((character) => digit(character) ?? mark(character)).join("");
}

/**
 * The digit that a character is in any script. The digits of a script stand side by side, from 0 to 9; scripts that stand
 * side by side themselves (the mathematical ones) have their plain digit as compatible form.
 *
 * @param {string} character
 * @returns {string | null}
 */
function digit(character) {
  if (!/^\p{Nd}$/u.test(character)) return null;
  const compatible = character.normalize("NFKC");
  if (/^[0-9]$/u.test(compatible)) return compatible;
  const point = character.codePointAt(0) ?? 0;
  let before = 0;
  while (/^\p{Nd}$/u.test(String.fromCodePoint(point - before - 1))) before += 1;
  return String(before % 10);
}

/**
 * @param {string} character
 * @returns {string}
 */
function mark(character) {
  if (/^(?:\p{Cf}|\p{Variation_Selector})$/u.test(character)) return "";
  if (/^[\p{Zs}\t\r\n]$/u.test(character)) return " ";
  return ALIKE.get(character) ?? character;
}

/**
 * [whole part, fraction] of every way to read digits and marks, decimal marks first.
 *
 * @param {string} mantissa
 * @param {boolean} grouped
 * @returns {[string, string][]}
 */
function readings(mantissa, grouped) {
  /** @type {[string, string][]} */
  const found = [];
  for (const decimal of DECIMALS) {
    const [before = "", fraction = "", ...more] = mantissa.split(decimal);
    if (fraction === "" || more.length > 0 || !/^[0-9]+$/u.test(fraction)) continue;
    const whole = ungrouped(before, grouped);
    if (whole !== null) found.push([whole, fraction]);
  }
  const whole = ungrouped(mantissa, grouped);
  if (whole) found.push([whole, ""]);
  return found;
}

/**
 * A whole part without its thousands marks, "" for none; null when they do not stand where they belong.
 *
 * @param {string} whole
 * @param {boolean} grouped
 * @returns {string | null}
 */
function ungrouped(whole, grouped) {
  if (/^[0-9]*$/u.test(whole)) return whole;
  const [one, ...more] = new Set(whole.replace(/[0-9]/gu, ""));
  if (!grouped || one === undefined || more.length > 0 || !THOUSANDS.includes(one)) return null;
  const m = one === "." ? "\\." : one;
  const places = new RegExp(`^(?:[1-9][0-9]{0,2}(?:${m}[0-9]{3})+|[1-9][0-9]?(?:${m}[0-9]{2})+${m}[0-9]{3})$`, "u");
  return places.test(whole) ? whole.replaceAll(one, "") : null;
}
