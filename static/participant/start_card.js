// Before practice and each round: what comes, and the button that begins it.

import { h } from "../common/dom.js";
import { t } from "../common/language.js";
import { stepButton } from "../common/shell.js";
import { wordsFor } from "../readings/words.js";

/** @import { LabSocket } from "../wire/socket.js" */
/** @import { DrivingPage } from "./drive.js" */

const PRACTICE_ON_TABLE = [
  t("Pick up the block, move it and put it down again."),
  t("Take your time; this part does not count."),
].join(" ");

/**
 * @param {{ socket: LabSocket, page: DrivingPage, panel: HTMLElement | null }} wiring `panel`: what is to be said of the second device
 * @returns {{ element: HTMLElement, button: HTMLButtonElement }}
 */
export function startCard({ socket, page, panel }) {
  const { state, trial, trials, content } = page;
  const practice = state === "practice_ready";
  const round = { trial: trial ?? 0, trials };
  const title = practice ? t("Practice first") : t("Round {trial} of {trials}", round);
  const onTable = content.practice_task === "table";
  const text = practice
    ? onTable
      ? PRACTICE_ON_TABLE
      : wordsFor(socket.welcome).practice
    : t("The robot is in place. When you press Start, the round begins.");
  const button = stepButton({
    socket,
    step: "start",
    label: practice ? t("Start practice") : t("Start round {trial}", round),
    busy: t("Starting"),
    kind: "primary large",
    testid: "start-button",
  });
  const element = h(
    "section",
    { class: "start-card", data: { testid: `page-${state}` } },
    h("div", {}, h("h1", { tabindex: "-1" }, title), h("p", {}, text), panel),
    button,
  );
  return { element, button };
}
