// The view of the page in comfort.py: one scale and a line of free words.

import { freshId, h, icon, setText, whileBusy } from "../../common/dom.js";
import { card } from "../../common/shell.js";

export function view({ socket }, page) {
  const { question, low, high, points, round } = page.content;
  const name = freshId("sure");
  const radios = Array.from({ length: points }, (_, index) =>
    h("input", { type: "radio", name, value: String(index + 1), "aria-label": String(index + 1) }),
  );
  const scale = h(
    "fieldset",
    { class: "item" },
    h("legend", {}, question),
    h(
      "div",
      { class: "scale" },
      h("span", { class: "anchor low" }, low),
      h(
        "div",
        { class: "points" },
        radios.map((radio) => h("label", { class: "point" }, radio, h("span", { "aria-hidden": "true" }, radio.value))),
      ),
      h("span", { class: "anchor high" }, high),
    ),
  );
  let choices = 0;
  scale.addEventListener("change", () => {
    choices += 1;
  });
  const hardId = freshId("hard");
  const hard = h("textarea", { id: hardId, rows: "3", data: { testid: "comfort-hard" } });
  const problem = h("span", {});
  const error = h("p", { class: "field-error", role: "alert", hidden: true }, icon("warning"), problem);
  const say = (text) => {
    setText(problem, text);
    error.hidden = false;
  };
  const go = h("button", { type: "submit", class: "primary large", data: { testid: "comfort-submit" } }, "Continue");
  const form = h(
    "form",
    { novalidate: true, class: "questions" },
    scale,
    h("div", { class: "question" }, h("label", { for: hardId }, "What is still hard? (optional)"), hard),
    error,
    h("div", { class: "actions" }, go),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    error.hidden = true;
    const chosen = radios.find((radio) => radio.checked);
    if (!chosen) return say("Please choose a point of the scale.");
    const data = { sure: Number(chosen.value), hard: hard.value };
    // Noted once, when what was chosen has been taken.
    const noted = () => choices > 1 && socket.note("own.changed", { times: Math.min(choices - 1, 1000) });
    whileBusy(go, "Saving", () =>
      socket
        .submit("comfort", data)
        .then(noted)
        .catch(() => {}),
    );
  });
  // What the lab refuses about a field of this page is said here, not in a message of its own.
  const close = socket.on("refused", (event) => {
    if (event.detail.field !== "hard") return;
    event.preventDefault();
    say(event.detail.message);
  });
  const element = card({
    title: `Before round ${round}`,
    lines: ["You have practised with the robot arm."],
    wide: true,
    body: form,
    testid: "page-comfort",
  });
  return { element, close };
}
