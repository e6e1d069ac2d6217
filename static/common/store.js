// What the browser keeps: JSON under names of ours. A full or forbidden storage costs convenience, never a step.

/**
 * What is kept is as trustworthy as the browser it is kept in: `get` believes what its reader says it is.
 *
 * @typedef {object} Kept
 * @property {<Value>(name: string, fallback: Value) => Value} get the fallback is for what was never kept
 * @property {(name: string, value: unknown) => boolean} set returns whether it was kept
 * @property {(name: string) => void} remove
 */

/**
 * @param {() => Storage} area asked for each time: a browser may forbid it
 * @returns {Kept}
 */
function wrap(area) {
  return {
    get(name, fallback) {
      try {
        const text = area().getItem(`salab:${name}`);
        return text === null ? fallback : JSON.parse(text);
      } catch {
        return fallback;
      }
    },
    set(name, value) {
      try {
        area().setItem(`salab:${name}`, JSON.stringify(value));
        return true;
      } catch {
        return false;
      }
    },
    remove(name) {
      try {
        area().removeItem(`salab:${name}`);
      } catch {
        // nothing was kept
      }
    },
  };
}

/** Kept in this browser. */
export const lasting = wrap(() => localStorage);
/** Kept in this tab, over a reload. */
export const tab = wrap(() => sessionStorage);

/**
 * Hex digits from the browser's random source; works without a secure context, unlike `crypto.randomUUID`.
 *
 * @param {number} bytes
 * @returns {string}
 */
export function randomHex(bytes) {
  const values = crypto.getRandomValues(new Uint8Array(bytes));
  return Array.from(values, (value) => value.toString(16).padStart(2, "0")).join("");
}
