// A key counts where it was pressed. Whoever holds one down while a field, a button or a page appears under it has not
// typed into the field or pressed the button: the keyboard only repeats what was meant for something else.

/** @type {Map<string, EventTarget | null>} each key that is down, and what it was pressed in */
const pressedIn = new Map();
let isWatching = false;

/**
 * What a key is called in here: its place, or what it types where a keyboard tells no place.
 *
 * @param {KeyboardEvent} event
 * @returns {string}
 */
function nameOf({ code, key }) {
  return code || key;
}

/**
 * Whether this is a key that was pressed before, and somewhere else.
 *
 * @param {KeyboardEvent} event
 * @returns {boolean}
 */
export function isStale(event) {
  return event.repeat && pressedIn.get(nameOf(event)) !== event.target;
}

/**
 * Takes the repeats of such keys from the whole page. Once for each page, before anything else listens to keys.
 *
 * @returns {void}
 */
export function onlyFreshKeys() {
  if (isWatching) return;
  isWatching = true;
  addEventListener(
    "keydown",
    (event) => {
      if (!event.repeat) pressedIn.set(nameOf(event), event.target);
      else if (isStale(event)) {
        event.preventDefault();
        event.stopImmediatePropagation();
      }
    },
    true,
  );
  addEventListener("keyup", (event) => pressedIn.delete(nameOf(event)), true);
  addEventListener("blur", () => pressedIn.clear());
}
