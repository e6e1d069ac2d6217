// Links that a study file names: only to pages, never to scripts.

/**
 * The link as an address of the web, or null.
 *
 * @param {string} link
 * @returns {string | null}
 */
export function safeLink(link) {
  try {
    const url = new URL(link, location.href);
    return ["http:", "https:"].includes(url.protocol) ? url.href : null;
  } catch {
    return null;
  }
}
