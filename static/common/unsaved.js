// That the lab cannot save, above a participant's page, for as long as it is so.

import { h, icon } from "./dom.js";

/** @import { Lab } from "./shell.js" */

/**
 * @param {Lab} socket
 * @returns {HTMLElement}
 */
export function unsavedNotice(socket) {
  const line = h("p", { class: "unsaved", hidden: true, data: { testid: "unsaved" } });
  socket.addEventListener("state", () => {
    if (socket.state === "lost") line.hidden = true; // that says more
  });
  socket.addEventListener("saves", (event) => {
    const { works, text } = event.detail;
    line.hidden = works;
    line.replaceChildren(icon("warning"), h("span", {}, text ?? ""));
  });
  return h("div", { role: "alert" }, line);
}
