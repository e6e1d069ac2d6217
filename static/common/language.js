// The participant's texts in the study's language. English stands in the code, where a text is shown, and is its own
// key; the lab sends the translations with the page (app/web/page_words.py). `study/language/words.py` does the same for
// the texts that the lab makes.
//
//   t("Pick up the {object}.", { object })              {name} is a placeholder
//   tn("One question is left.", "{n} questions are left.", n)
//   tc("direction", "left")                             where one English word has two meanings
//
// They take literal texts only: tools read them from here. Texts are at hand before any module runs.

/**
 * @typedef {object} Catalogue
 * @property {string} language a tag such as "de"
 * @property {"ltr" | "rtl"} dir
 * @property {Record<string, string>} texts by the English text, or by context, U+0004 and text
 * @property {Record<string, Record<string, string>>} plurals by the English singular, then by plural category
 * @property {string} digits from nought to nine
 * @property {string} decimal the mark before the decimals
 * @property {string} minus
 * @property {string} numbering the digits' name, for Intl
 */
/** @typedef {Record<string, string | number>} Values for placeholders; numbers are written as the language does */

/** @type {Catalogue} */
const ENGLISH = {
  language: "en",
  dir: "ltr",
  texts: {},
  plurals: {},
  digits: "0123456789",
  decimal: ".",
  minus: "-",
  numbering: "latn",
};
const sent = document.getElementById("catalogue")?.textContent;
/** @type {Catalogue} */
const catalogue = sent ? JSON.parse(sent) : ENGLISH;
const category = new Intl.PluralRules(catalogue.language);

/** Direction and number signs of the study's language; `decimal` is what stands before the decimals. */
export const LANGUAGE = {
  tag: catalogue.language,
  dir: catalogue.dir,
  decimal: catalogue.decimal,
  digits: catalogue.digits,
};

/**
 * A text in the study's language.
 *
 * @param {string} text in English, with placeholders such as `{object}`
 * @param {Values} [values]
 * @returns {string}
 */
export function t(text, values = {}) {
  return filled(catalogue.texts[text] ?? text, values);
}

/**
 * A text about a number of things; `{n}` is the number.
 *
 * @param {string} one in English, for one
 * @param {string} many in English, for any other number
 * @param {number} n
 * @param {Values} [values]
 * @returns {string}
 */
export function tn(one, many, n, values = {}) {
  const known = catalogue.plurals[one];
  const chosen = known ? (known[category.select(n)] ?? known.other ?? many) : n === 1 ? one : many;
  return filled(chosen, { n, ...values });
}

/**
 * A text that means something else elsewhere; `context` tells translators what is meant.
 *
 * @param {string} context
 * @param {string} text
 * @param {Values} [values]
 * @returns {string}
 */
export function tc(context, text, values = {}) {
  return filled(catalogue.texts[`${context}\u0004${text}`] ?? text, values);
}

/**
 * "a, b or c".
 *
 * @param {ReadonlyArray<string>} choices
 * @returns {string}
 */
export function either(choices) {
  const last = choices[choices.length - 1] ?? "";
  if (choices.length < 2) return last;
  return t("{some} or {last}", { some: choices.slice(0, -1).join(", "), last });
}

/**
 * A number as the language writes it.
 *
 * @param {number} value
 * @param {number} [decimals] as many as it takes if left out
 * @returns {string}
 */
export function number(value, decimals) {
  const digits =
    decimals === undefined
      ? { maximumFractionDigits: 6 }
      : { minimumFractionDigits: decimals, maximumFractionDigits: decimals };
  const how = { useGrouping: false, numberingSystem: catalogue.numbering, ...digits };
  return new Intl.NumberFormat(catalogue.language, how).format(value);
}

/**
 * A plain numeral such as "601.70" as the language writes it, digit for digit; what is none stays as it is.
 *
 * @param {string} text
 * @returns {string}
 */
export function numeral(text) {
  if (!/^[+-]?\d+(\.\d+)?$/.test(text)) return text;
  const signs = [...catalogue.digits];
  const others = { ".": catalogue.decimal, "-": catalogue.minus };
  return text.replace(/[\d.-]/g, (sign) => others[/** @type {"." | "-"} */ (sign)] ?? signs[Number(sign)] ?? sign);
}

/**
 * @param {string} text
 * @param {Values} values
 * @returns {string}
 */
function filled(text, values) {
  return text.replace(/\{([a-z_]+)\}/g, (placeholder, name) => {
    const value = values[name];
    if (value === undefined) return placeholder;
    if (typeof value === "number") return number(value);
    // Isolated, so that its own direction does not reorder the text around it.
    return catalogue.dir === "rtl" ? `\u2068${value}\u2069` : value;
  });
}
