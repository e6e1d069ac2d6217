// Single questions of a form: radio groups, text and number fields, with their own error line.

import { freshId, h, icon, setText } from "../common/dom.js";

/** {id, element, value(), fail(text), clear(), focus(), required} for {id, prompt, kind, options, required}. */
export function question(
  { id, prompt, kind = "choice", options = [], required = true },
  { kept = null, onChange = () => {}, optionalNote = true } = {},
) {
  const errorId = freshId("error");
  const errorText = h("span", {});
  const error = h("p", { id: errorId, class: "field-error", role: "alert", hidden: true }, icon("warning"), errorText);
  const note = optionalNote && !required ? h("span", { class: "optional" }, " (optional)") : null;
  const made =
    kind === "choice"
      ? choice({ id, prompt, options, kept, errorId, note })
      : typed({ id, prompt, kind, kept, errorId, note });
  made.element.append(error);
  made.element.addEventListener("input", () => {
    clear();
    onChange(id, made.value());
  });
  function clear() {
    error.hidden = true;
    made.element.classList.remove("missing");
    for (const control of made.controls) control.removeAttribute("aria-invalid");
  }
  return {
    id,
    required,
    element: made.element,
    value: made.value,
    clear,
    fail(text) {
      setText(errorText, text);
      error.hidden = false;
      made.element.classList.add("missing");
      for (const control of made.controls) control.setAttribute("aria-invalid", "true");
    },
    focus() {
      made.element.scrollIntoView({ block: "center" });
      (made.controls.find((control) => control.checked) ?? made.controls[0])?.focus({ preventScroll: true });
    },
  };
}

function choice({ id, prompt, options, kept, errorId, note }) {
  const name = freshId("choice");
  const controls = options.map((option) => {
    const radio = h("input", { type: "radio", name, value: option.id, "aria-describedby": errorId });
    radio.checked = kept === option.id;
    return radio;
  });
  const element = h(
    "fieldset",
    { class: "question", data: { testid: `question-${id}` } },
    h("legend", {}, prompt, note),
    h(
      "div",
      { class: "options" },
      controls.map((radio, index) => h("label", { class: "option" }, radio, h("span", {}, options[index].label))),
    ),
  );
  return { element, controls, value: () => controls.find((radio) => radio.checked)?.value ?? null };
}

function typed({ id, prompt, kind, kept, errorId, note }) {
  const fieldId = freshId("field");
  const control =
    kind === "number"
      ? h("input", { id: fieldId, type: "number", step: "any", inputmode: "decimal", "aria-describedby": errorId })
      : kind === "long"
        ? h("textarea", { id: fieldId, rows: 4, maxlength: 5000, "aria-describedby": errorId })
        : h("input", { id: fieldId, type: "text", maxlength: 500, autocomplete: "off", "aria-describedby": errorId });
  if (kept !== null) control.value = kept;
  const element = h(
    "div",
    { class: "question field", data: { testid: `question-${id}` } },
    h("label", { for: fieldId }, prompt, note),
    control,
  );
  const value = () => {
    const text = control.value.trim();
    if (text === "") return null;
    return kind === "number" ? Number(text) : text;
  };
  return { element, controls: [control], value };
}

/** Marks what is required and empty; returns whether all is there, and moves focus to the first gap. */
export function checkAll(questions) {
  const missing = questions.filter((one) => one.required && (one.value() === null || Number.isNaN(one.value())));
  for (const one of missing) one.fail("Please answer this question.");
  missing[0]?.focus();
  return missing.length === 0;
}

/** {question: value} without the empty ones. */
export function valuesOf(questions) {
  return Object.fromEntries(questions.map((one) => [one.id, one.value()]).filter(([, value]) => value !== null));
}

/** Shows the lab's refusals of `answers.<id>` beside their questions. Returns a function that stops listening. */
export function showRefusals(socket, questions) {
  const listen = (event) => {
    const ids = [...String(event.detail.field ?? "").matchAll(/answers\.([^,\s]+)/g)].map((match) => match[1]);
    const wrong = questions.filter((one) => ids.includes(one.id));
    if (wrong.length === 0) return;
    event.preventDefault(); // shown here, so no toast
    for (const one of wrong) one.fail(event.detail.message.replace(/^(?=[a-z])/, "This answer "));
    const first = questions.find((one) => !one.element.querySelector(".field-error").hidden);
    first?.focus();
  };
  socket.addEventListener("refused", listen);
  return () => socket.removeEventListener("refused", listen);
}
