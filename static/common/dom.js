// Building elements without ever parsing a string as HTML: what comes from the lab or a study file is only text.

const SVG = "http://www.w3.org/2000/svg";

/** @typedef {string | number | boolean | null | undefined} Attribute true is an empty one; false, null, undefined none */
/** @typedef {Node | string | number | false | null | undefined | ReadonlyArray<Child>} Child the empty ones are left out */
/**
 * Attributes by their names, and two things that are none: listeners under `on`, and `data`.
 *
 * @typedef {{
 *   class?: string,
 *   on?: Record<string, (event: Event) => void>,
 *   data?: Record<string, Attribute>,
 *   [attribute: string]: Attribute | Record<string, Attribute | ((event: Event) => void)>,
 * }} Props
 */
/** @typedef {keyof typeof ICONS} IconName */

/**
 * @param {HTMLElement | SVGElement} element
 * @param {Props} [props]
 * @returns {void}
 */
function apply(element, props = {}) {
  const { on = {}, data = {}, ...attributes } = props;
  for (const [event, handler] of Object.entries(on)) element.addEventListener(event, handler);
  for (const [name, value] of Object.entries(data)) {
    if (value !== undefined && value !== null) element.dataset[name] = String(value);
  }
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name === "value" && element instanceof HTMLElement) {
      /** @type {HTMLInputElement} */ (element).value = String(value);
    } else element.setAttribute(name, value === true ? "" : String(value));
  }
}

/**
 * @param {Element} element
 * @param {ReadonlyArray<Child>} children
 * @returns {void}
 */
function append(element, children) {
  for (const child of children) {
    if (child === undefined || child === null || child === false) continue;
    if (child instanceof Node) element.append(child);
    else if (typeof child === "object") append(element, child);
    else element.append(String(child));
  }
}

/**
 * An HTML element; strings among its children become text.
 *
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Props} [props]
 * @param {...Child} children
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function h(tag, props, ...children) {
  const element = document.createElement(tag);
  apply(element, props);
  append(element, children);
  return element;
}

/**
 * The same for SVG.
 *
 * @template {keyof SVGElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Props} [props]
 * @param {...Child} children
 * @returns {SVGElementTagNameMap[Tag]}
 */
export function s(tag, props, ...children) {
  const element = document.createElementNS(SVG, tag);
  apply(element, props);
  append(element, children);
  return element;
}

/**
 * Sets text only when it differs, so that live regions announce changes and nothing else.
 *
 * @param {Node} element
 * @param {string} text
 * @returns {void}
 */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

let counter = 0;

/**
 * An id for `for` and `aria-describedby`, unique in this document.
 *
 * @param {string} stem
 * @returns {string}
 */
export function freshId(stem) {
  counter += 1;
  return `${stem}-${counter}`;
}

const ICONS = {
  play: "M8 5v14l11-7z",
  pause: "M7 5h3.6v14H7zM13.4 5H17v14h-3.6z",
  check: "M9.2 16.6 4.6 12l-1.9 1.9 6.5 6.5L21.3 8.3l-1.9-1.9z",
  warning: "M12 3 1.5 21h21zM11 10h2v5.5h-2zM11 17h2v2h-2z",
  lost: "M3 4.3 4.3 3 21 19.7 19.7 21l-4.2-4.2a7 7 0 0 0-7.9.8L6 16a9.3 9.3 0 0 1 4.2-2.2L7.5 11a12.6 12.6 0 0 0-3 1.9L2.8 11a15 15 0 0 1 3-1.9zM12 18l2.2 2.2L12 22.4l-2.2-2.2zM12 6c3.6 0 6.900 1.400 9.300 3.700l-1.700 1.800A10.800 10.800 0 0 0 11 8.600L8.800 6.400A15 15 0 0 1 12 6z",
  reset: "M12 5V1.500L7 6l5 4.500V7a5 5 0 1 1-5 5H5a7 7 0 1 0 7-7z",
  grip: "M5 3h2.600v7.200L10 12v9H7.500v-7.600L5 11.500zM16.400 3H19v8.500l-2.500 1.900V21H14v-9l2.400-1.800z",
  sound:
    "M3 9v6h4l5 5V4L7 9zM14.500 8.200a5 5 0 0 1 0 7.600zM14.500 4.300v2.100a6 6 0 0 1 0 11.200v2.100a8 8 0 0 0 0-15.400z",
  gamepad:
    "M7.500 7h9A5.500 5.500 0 0 1 22 12.500c0 3-1 5-2.700 5-1.800 0-2.800-2.500-4.300-2.500H9c-1.500 0-2.500 2.500-4.300 2.500-1.700 0-2.700-2-2.700-5A5.500 5.500 0 0 1 7.500 7zM7.200 9.500v1.800H5.400v1.400h1.800v1.800h1.500v-1.800h1.800v-1.400H8.700V9.500zM16 10a1.200 1.200 0 1 0 0 2.400A1.200 1.200 0 0 0 16 10z",
  keyboard:
    "M3 6h18a1 1 0 0 1 1 1v10a1 1 0 0 1-1 1H3a1 1 0 0 1-1-1V7a1 1 0 0 1 1-1zM5 9v2h2V9zM8.700 9v2h2V9zM12.400 9v2h2V9zM16.200 9v2H19V9zM7 13.500v2h10v-2z",
  help: "M12 2a10 10 0 1 0 0 20 10 10 0 0 0 0-20zM11 17h2v2h-2zM12 5.500a3.800 3.800 0 0 0-3.800 3.700h2a1.800 1.800 0 1 1 2.900 1.500c-1.200.900-2.100 1.700-2.100 4.300h2c0-1.700.500-2.100 1.500-2.900A3.800 3.800 0 0 0 12 5.500z",
  info: "M12 2a10 10 0 1 0 0 20 10 10 0 0 0 0-20zM11 6.500h2v2.200h-2zM11 10.500h2v7h-2z",
  hourglass: "M6 2h12v5l-4.500 5 4.500 5v5H6v-5l4.500-5L6 7zM8.200 4v2.200L12 10.500l3.800-4.300V4z",
  clock:
    "M12 2a10 10 0 1 0 0 20 10 10 0 0 0 0-20zM12 4.200a7.800 7.800 0 1 1 0 15.600 7.800 7.800 0 0 1 0-15.600zM11 7h2v4.600l3.300 3.300-1.400 1.400L11 12.400z",
  hand: "M8 11V4.500a1.300 1.300 0 0 1 2.600 0V10h.6V3.300a1.300 1.300 0 0 1 2.600 0V10h.6V4.500a1.300 1.300 0 0 1 2.600 0V13h.5V8.500a1.200 1.200 0 0 1 2.500 0V15c0 4-2.500 7-6.500 7-3 0-4.500-1.300-6-4l-3-5.300c-.500-1 .800-2 1.700-1.300z",
};

/**
 * A decorative icon; the words beside it carry the meaning.
 *
 * @param {IconName} name
 * @returns {SVGSVGElement}
 */
export function icon(name) {
  return s(
    "svg",
    { class: "icon", viewBox: "0 0 24 24", "aria-hidden": "true", focusable: "false" },
    s("path", { d: ICONS[name], "fill-rule": "evenodd" }),
  );
}

/**
 * Marks a button as working until the promise settles; a second press meanwhile does nothing.
 *
 * @param {HTMLButtonElement} button
 * @param {string} busyText
 * @param {() => unknown} work what is waited for when it is a promise
 * @returns {Promise<void>}
 */
export async function whileBusy(button, busyText, work) {
  if (button.getAttribute("aria-busy") === "true") return;
  const children = [...button.childNodes];
  button.setAttribute("aria-busy", "true");
  button.replaceChildren(h("span", { class: "spinner", "aria-hidden": "true" }), busyText);
  try {
    await work();
  } finally {
    button.removeAttribute("aria-busy");
    button.replaceChildren(...children);
  }
}
