// Where the lab lives: its public address may have a path in front of everything (a lab at lab.example/study).

const ROOT = new URL("../..", import.meta.url); // modules are served from …/static/

/**
 * The address of a path of the lab, such as "/api/sessions".
 *
 * @param {string} path
 * @returns {string}
 */
export function labUrl(path) {
  return new URL(path.slice(1), ROOT).href;
}

/**
 * The page's own path below the lab's address, such as "/s/4f2a/".
 *
 * @returns {string}
 */
export function labPath() {
  return location.pathname.slice(ROOT.pathname.length - 1);
}

/**
 * The id in the address of a participant's or a second device's page.
 *
 * @returns {string}
 */
export function sessionOfPage() {
  return labPath().match(/^\/s\/([^/]+)/)?.[1] ?? "none";
}

/**
 * `ws(s)://…` for a path of the lab.
 *
 * @param {string} path
 * @returns {string}
 */
export function socketUrl(path) {
  return labUrl(path).replace(/^http/, "ws");
}
