// What the browser keeps: JSON under names of ours. A full or forbidden storage costs convenience, never a step.

function wrap(area) {
  return {
    get(name, fallback = null) {
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

/** Hex digits from the browser's random source; works without a secure context, unlike `crypto.randomUUID`. */
export function randomHex(bytes) {
  const values = crypto.getRandomValues(new Uint8Array(bytes));
  return Array.from(values, (value) => value.toString(16).padStart(2, "0")).join("");
}
