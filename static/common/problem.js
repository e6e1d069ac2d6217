// What to tell a person about something that went wrong.

/**
 * The words of whatever was thrown.
 *
 * @param {unknown} thrown
 * @returns {string}
 */
export function problemText(thrown) {
  return thrown instanceof Error ? thrown.message : String(thrown);
}
