// What to tell a person about something that went wrong.

import { t } from "./language.js";

/**
 * The words of whatever was thrown.
 *
 * @param {unknown} thrown
 * @returns {string}
 */
export function problemText(thrown) {
  return thrown instanceof Error ? thrown.message : String(thrown);
}

/**
 * Why the lab refused something, for the person. What a person can mend, the lab says in a sentence of their language; the
 * others are for whoever wrote the page, go on from the field's name ("must be …"), and are English.
 *
 * @param {string | null} field
 * @param {string} message
 * @returns {string}
 */
export function refusalText(field, message) {
  if (!/^[a-z]/.test(message)) return message;
  const problem = field ? `${field} ${message}` : message;
  return t("The lab does not take this. Please tell the experimenter: {problem}", { problem });
}
