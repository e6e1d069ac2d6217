// The second device as the participant's page sees it: how to open it, whether it is there, whether its alarm was heard.

import { copyButton } from "../common/copy.js";
import { h, icon } from "../common/dom.js";
import { t } from "../common/language.js";
import { labUrl } from "../common/root.js";

/** @import { LabSocket } from "../wire/socket.js" */

/**
 * @param {{ socket: LabSocket, session: string, link: string | null, onChange: () => void }} wiring
 *   `link` is null where only the experimenter has it
 * @returns {{ element: HTMLElement, there: () => boolean, heard: () => boolean | null, close: () => void }}
 */
export function secondDevice({ socket, session, link, onChange }) {
  const state = h("p", { class: "second-state", role: "status", data: { testid: "panel-state" } });
  const field = h("input", {
    type: "text",
    readonly: true,
    value: link ?? "",
    "aria-label": t("Link for the second device"),
    class: "link-field",
    data: { testid: "panel-link" },
  });
  const ways = link
    ? h(
        "div",
        { class: "second-ways", data: { testid: "panel-ways" } },
        h("img", {
          class: "qr",
          alt: t("QR code of the link for the second device"),
          src: labUrl(`/s/${session}/second-device.svg`),
          data: { testid: "panel-qr" },
        }),
        h(
          "div",
          {},
          h("p", {}, t("Point the second device's camera at the code, or open this link there:")),
          h(
            "div",
            { class: "copy-line" },
            field,
            copyButton(() => link, t("Copy link")),
          ),
        ),
      )
    : h("p", {}, t("The experimenter has the link and opens it for you."));
  const there = () => socket.panel?.connected === true;
  const heard = () => socket.panel?.heard ?? null;
  const show = () => {
    const [sign, words, kind] = !there()
      ? /** @type {const} */ (["hourglass", t("Waiting for the second device"), "waiting"])
      : heard() === null
        ? /** @type {const} */ ([
            "check",
            t("The second device is there. Now turn its sound on, and say there whether you heard it."),
            "there",
          ])
        : heard()
          ? /** @type {const} */ (["check", t("The second device is there, and its alarm was heard."), "heard"])
          : /** @type {const} */ ([
              "warning",
              t("The second device is there, but nobody heard its alarm. Turn up its volume."),
              "silent",
            ]);
    if (state.dataset.kind === kind) return;
    state.dataset.kind = kind;
    state.replaceChildren(icon(sign), h("span", {}, words));
    ways.hidden = there();
  };
  const close = socket.on("panel", () => {
    show();
    onChange();
  });
  show();
  return { element: h("div", { class: "second-device" }, ways, state), there, heard, close };
}
