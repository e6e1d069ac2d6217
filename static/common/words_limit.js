// What free words may hold, wherever they are typed. How many characters, the lab says, and it has the last word.

import { t } from "./language.js";

let limit = Number.POSITIVE_INFINITY;

/**
 * The lab has said how many characters it takes.
 *
 * @param {number} characters
 * @returns {void}
 */
export function setWordsLimit(characters) {
  limit = characters;
}

/**
 * Why the lab would not take these words as they are; "" when it would. Characters are counted as the lab counts them: an
 * emoji is one. Nothing is ever cut off.
 *
 * @param {string} text
 * @returns {string}
 */
export function wordsProblem(text) {
  const characters = [...text];
  if (characters.length > limit)
    return t("This has {n} characters, and at most {most} can be saved. Please shorten it.", {
      n: characters.length,
      most: limit,
    });
  const unseen = characters.find((one) => /^[\p{Cc}\p{Cs}]$/u.test(one) && one !== "\t" && one !== "\n");
  if (unseen === undefined) return "";
  const code = (unseen.codePointAt(0) ?? 0).toString(16).toUpperCase().padStart(4, "0");
  return t("This holds a character that nobody can read ({code}). Please take it out.", { code: `U+${code}` });
}
