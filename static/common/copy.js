// A button that copies text. Pages on plain http have no clipboard API; the old way still works there.

import { h, setText } from "./dom.js";
import { t } from "./language.js";

/**
 * @param {() => string} textOf what to copy, asked for at the press
 * @param {string} label
 * @param {string} [testid]
 * @returns {HTMLButtonElement}
 */
export function copyButton(textOf, label, testid = "copy-button") {
  const button = h("button", { type: "button", class: "secondary small", data: { testid } }, label);
  button.addEventListener("click", async () => {
    const copied = await copy(textOf());
    button.textContent = copied ? t("Copied") : t("Select it and press Ctrl+C");
    setTimeout(() => setText(button, label), 2500);
  });
  return button;
}

/**
 * @param {string} text
 * @returns {Promise<boolean>} whether it was copied
 */
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const area = h("textarea", { value: text, class: "visually-hidden", "aria-hidden": "true" });
    document.body.append(area);
    area.select();
    const copied = document.execCommand("copy");
    area.remove();
    return copied;
  }
}
