// Before anybody agrees to something they could not do: can this browser draw the robot, and if not, what may help.

import { h, icon } from "../common/dom.js";
import { t } from "../common/language.js";
import { canDraw } from "./webgl.js";

/** @import { LabSocket } from "../wire/socket.js" */

/** @type {ReadonlyArray<string>} */
export const ADVICE = [
  t(
    "Switch on hardware acceleration (also called graphics acceleration) in this browser's settings, and start it anew.",
  ),
  t("Close other programs and tabs that show 3-D pictures or videos."),
  t("Open the same link in another browser on a computer: Chrome, Edge or Firefox in its present version."),
];

/**
 * A warning that is there only while the browser cannot draw. The lab is told, so that the experimenter sees it too.
 *
 * @param {{ socket: LabSocket, needed: boolean }} wiring `needed`: the study has a scene
 * @returns {{ element: HTMLElement, fits: () => boolean }} `fits` looks again, and leads to the warning if it must
 */
export function pictureCheck({ socket, needed }) {
  const again = h(
    "button",
    { type: "button", class: "secondary", data: { testid: "picture-again" } },
    t("Check again"),
  );
  const element = h(
    "section",
    { class: "no-picture", role: "alert", tabindex: "-1", hidden: true, data: { testid: "no-picture" } },
    h("h2", {}, icon("warning"), t("This browser cannot show the robot")),
    h("p", {}, t("It draws no 3-D pictures (WebGL), and you could not see what you drive. What may help:")),
    h(
      "ul",
      {},
      ADVICE.map((line) => h("li", {}, line)),
    ),
    h("div", { class: "actions" }, again),
  );
  let told = true;
  const look = () => {
    const works = !needed || canDraw();
    element.hidden = works;
    if (works === told) return works;
    told = works;
    socket.submit("picture", works ? { there: true } : { there: false, why: "no_webgl" }).catch(() => {});
    return works;
  };
  again.addEventListener("click", look);
  look();
  const fits = () => {
    const works = look();
    if (!works) {
      element.scrollIntoView({ block: "center" });
      element.focus({ preventScroll: true });
    }
    return works;
  };
  return { element, fits };
}
