// Set-up: how to drive (gamepad or keyboard, equal), a live test, sound, and the second device where there is one.

import { h, icon, setText, whileBusy } from "../../common/dom.js";
import { number, t } from "../../common/language.js";
import { card } from "../../common/shell.js";
import { calibrate } from "../../hands/calibration.js";
import { remember, remembered } from "../../hands/gamepad.js";
import { DEAD_ZONE } from "../../hands/mapping.js";
import { wordsFor } from "../../readings/words.js";
import { keyboardLegend, lightUp, padLegend, UNKNOWN_KEY } from "../controls.js";
import { indicator } from "../indicator.js";
import { pictureCheck } from "../picture_check.js";
import { secondDevice } from "../second_device.js";

/** @import { Child } from "../../common/dom.js" */
/** @import { ChosenDevice } from "../../hands/keyboard.js" */
/** @import { Pad } from "../../hands/gamepad.js" */
/** @import { Context, PageOf, View } from "../view.js" */
/**
 * @typedef {object} Content
 * @property {"second_device" | "same_page_away" | "none"} placement
 * @property {string | null} panel_link
 * @property {"any" | "preferred" | "required"} [gamepad]
 * @property {boolean} [needs_sound]
 * @property {boolean} [needs_picture] the study has a scene
 */
/**
 * @typedef {object} Chosen
 * @property {ChosenDevice["device"] | null} device
 * @property {Pad | null} pad
 * @property {boolean | null} sound null until the person has said whether they hear it
 */

const PRESSED = { close: t("Gripper: close pressed"), open: t("Gripper: open pressed") };

/**
 * @param {number} step
 * @param {string} title
 * @param {string} testid
 */
function section(step, title, testid) {
  const state = h("span", { class: "done-mark", role: "status" });
  const body = h("div", {});
  const element = h(
    "section",
    { class: "setup-step", data: { testid } },
    h("h2", {}, h("span", { class: "step-number", "aria-hidden": "true" }, number(step)), title, state),
    body,
  );
  const done = (/** @type {string} */ text) => {
    state.replaceChildren(...(text ? [icon("check"), text] : []));
    element.classList.toggle("done", Boolean(text));
  };
  return { element, body, done };
}

/**
 * @param {Context} context
 * @param {PageOf<Content>} page
 * @returns {View}
 */
export function view({ socket, session, input, pads, keyboard, sound }, page) {
  const words = wordsFor(socket.welcome).setup;
  const { placement, panel_link, gamepad = "any", needs_sound = false, needs_picture = false } = page.content;
  const picture = pictureCheck({ socket, needed: needs_picture });
  /** @type {Chosen} */
  const chosen = {
    device: input.chosen,
    pad: pads.pad,
    sound: null,
  };
  const drive = section(1, t("How do you want to drive?"), "setup-drive");
  // The alarm sounds where the readings appear, and that is where it has to be heard.
  const onPanel = placement === "second_device";
  const hear = section(2, t("Can you hear the alarm?"), "setup-sound");
  const second = onPanel ? section(2, t("Open the second device"), "setup-panel") : null;

  const driveDetail = h("div", { class: "setup-detail" });
  const pad =
    gamepad === "preferred"
      ? t("Recommended. Any pad with a stick or a cross, and a few buttons")
      : t("Any pad with a stick or a cross, and a few buttons");
  /** @type {[device: ChosenDevice["device"], label: string, hint: string][]} */
  const devices = [
    ["gamepad", t("Gamepad"), pad],
    ["keyboard", t("Keyboard"), t("Letters or arrow keys")],
  ];
  const radios = devices
    .filter(([device]) => device === "gamepad" || gamepad !== "required")
    .map(([device, label, hint]) => {
      const radio = h("input", { type: "radio", name: "device", value: device });
      radio.checked = chosen.device === device;
      radio.addEventListener("change", () => choose(device));
      const element = h(
        "label",
        { class: "device-card", data: { testid: `device-${device}` } },
        radio,
        icon(device),
        h("span", {}, h("strong", {}, label), h("small", {}, hint)),
      );
      return { radio, element };
    });
  const driveErrorText = h("span", {});
  const driveError = h("p", { class: "field-error", role: "alert", hidden: true }, icon("warning"), driveErrorText);
  drive.body.append(
    h(
      "fieldset",
      { class: "device-cards" },
      h("legend", { class: "visually-hidden" }, t("Controls")),
      radios.map((one) => one.element),
    ),
    driveDetail,
    driveError,
  );

  /** @param {ChosenDevice["device"]} device */
  function choose(device) {
    chosen.device = device;
    driveError.hidden = true;
    stopDetail();
    if (device === "keyboard") {
      input.choose("keyboard");
      const legend = h("div", {}, keyboardLegend(keyboard.labels));
      showTest(legend);
      const deafen = keyboard.labels.on("labels", () => legend.replaceChildren(keyboardLegend(keyboard.labels)));
      const stop = stopDetail;
      stopDetail = () => {
        deafen();
        stop();
      };
    } else if (chosen.pad && pads.find(chosen.pad.padId)) padReady(chosen.pad, pads.slot);
    else startCalibration();
  }

  let stopDetail = () => {};
  const byKeyboard = radios.find(({ radio }) => radio.value === "keyboard");

  function startCalibration({ anew = false } = {}) {
    stopDetail();
    drive.done("");
    chosen.pad = null;
    pads.use(null);
    const steps = calibrate({
      pads,
      known: (padId) => (anew ? null : remembered(padId)),
      onDone: padReady,
      useKeyboard: byKeyboard ? () => byKeyboard.radio.click() : null,
    });
    stopDetail = steps.close;
    driveDetail.replaceChildren(steps.element);
  }

  /**
   * @param {Pad} pad
   * @param {number | null} slot
   */
  function padReady(pad, slot) {
    stopDetail();
    chosen.pad = pad;
    remember(pad);
    input.choose("gamepad", pad, slot);
    const zone = h("input", {
      type: "range",
      id: "dead-zone",
      min: DEAD_ZONE.min,
      max: DEAD_ZONE.max,
      step: 0.05,
      value: String(pad.deadZone),
      data: { testid: "dead-zone" },
    });
    const shown = h("output", { for: "dead-zone" }, t("{n} %", { n: Math.round(pad.deadZone * 100) }));
    zone.addEventListener("input", () => {
      const deadZone = Number(zone.value);
      setText(shown, t("{n} %", { n: Math.round(deadZone * 100) }));
      pads.setDeadZone(deadZone);
      chosen.pad = { ...pad, deadZone };
      remember(chosen.pad);
    });
    const again = h(
      "button",
      { type: "button", class: "secondary small", data: { testid: "calibrate-again" } },
      icon("reset"),
      t("Set up the pad again"),
    );
    again.addEventListener("click", () => startCalibration({ anew: true }));
    const dead = h(
      "div",
      { class: "field inline" },
      h("label", { for: "dead-zone" }, t("Push a stick at least this far")),
      zone,
      shown,
    );
    const legend = padLegend(pad);
    showTest([legend, dead, again]);
    const stop = stopDetail;
    const darken = lightUp(legend, pads);
    stopDetail = () => {
      darken();
      stop();
    };
  }

  /** @param {Child} legend */
  function showTest(legend) {
    const hands = indicator(input);
    const press = h(
      "p",
      { class: "test-gripper", role: "status", data: { testid: "test-gripper" } },
      t("Gripper: nothing pressed yet"),
    );
    const unknown = h("p", { class: "field-error", role: "status", hidden: true }, icon("warning"), UNKNOWN_KEY);
    const deafen = [
      input.on("gripper", (event) => setText(press, PRESSED[event.detail])),
      keyboard.on("unknown", () => {
        unknown.hidden = false;
      }),
    ];
    const area = h(
      "div",
      {
        class: "test-area",
        tabindex: "0",
        role: "group",
        "aria-label": t("Try the controls here"),
        data: { testid: "test-area" },
      },
      h("p", { class: "test-title" }, t("Try it here")),
      hands.element,
      press,
      unknown,
      h(
        "p",
        { class: "hint" },
        chosen.device === "keyboard"
          ? t("Click here (or press Tab to get here), then press the keys.")
          : t("Move the sticks and press the buttons."),
      ),
    );
    driveDetail.replaceChildren(h("div", { class: "setup-columns" }, h("div", {}, legend), area));
    keyboard.listen(area);
    if (chosen.device === "keyboard") area.focus({ preventScroll: true });
    drive.done(t("Ready"));
    stopDetail = () => {
      keyboard.listen(null);
      hands.close();
      for (const stop of deafen) stop();
      stopDetail = () => {};
    };
  }

  const heard = h("p", { class: "hint", role: "status", data: { testid: "sound-result" } });
  const play = h(
    "button",
    { type: "button", class: "secondary", data: { testid: "sound-play" } },
    icon("sound"),
    t("Play the alarm"),
  );
  const yes = h(
    "button",
    { type: "button", class: "secondary", hidden: true, data: { testid: "sound-yes" } },
    t("I heard it"),
  );
  const no = h(
    "button",
    { type: "button", class: "secondary", hidden: true, data: { testid: "sound-no" } },
    t("I heard nothing"),
  );
  const hearError = h(
    "p",
    { class: "field-error", role: "alert", hidden: true },
    icon("warning"),
    h("span", {}, t("Play the alarm and say whether you heard it.")),
  );
  play.addEventListener("click", async () => {
    const sounded = await sound.alarm();
    yes.hidden = false;
    no.hidden = false;
    setText(
      heard,
      sounded
        ? t("It is playing now. Did you hear it?")
        : t("This browser did not let the sound through. Press the button once more."),
    );
  });
  yes.addEventListener("click", () => sayHeard(true));
  no.addEventListener("click", () => sayHeard(false));
  /** @param {boolean} value */
  function sayHeard(value) {
    chosen.sound = value;
    hearError.hidden = true;
    hear.done(value ? t("Heard") : t("Not heard"));
    setText(
      heard,
      value
        ? t("Good. Keep the volume as it is.")
        : `${t("Turn up the volume or plug in headphones, and play it again.")} ${needs_sound ? t("This study needs sound.") : words.watch}`,
    );
  }
  hear.body.append(h("p", {}, words.loud), h("div", { class: "actions" }, play, yes, no), heard, hearError);

  const panel = second && secondDevice({ socket, session, link: panel_link, onChange: () => secondChanged() });
  const secondErrorText = h("span", {});
  const secondError = h("p", { class: "field-error", role: "alert", hidden: true }, icon("warning"), secondErrorText);
  let without = false; // the experimenter sees to it later
  const later = h(
    "button",
    { type: "button", class: "secondary", hidden: true, data: { testid: "panel-later" } },
    t("Go on; the experimenter opens it later"),
  );
  later.addEventListener("click", () => {
    without = true;
    socket.note("panel_later");
    go.click();
  });
  function secondChanged() {
    second?.done(
      panel?.there() ? (panel.heard() === false ? t("Not heard") : panel.heard() ? t("Ready") : t("There")) : "",
    );
    secondError.hidden = true;
  }
  /** @returns {boolean} whether nothing is missing on the second device */
  function secondFits() {
    if (!panel || without) return true;
    const needed = needs_sound ? panel.heard() === true : panel.heard() !== null;
    if (panel.there() && needed) return true;
    setText(
      secondErrorText,
      panel.there()
        ? t("Turn the sound of the second device on, and say there whether you heard it.")
        : t("Open the second device first: the readings appear there."),
    );
    secondError.hidden = false;
    later.hidden = false;
    second?.element.scrollIntoView({ block: "center" });
    return false;
  }
  if (second && panel) {
    second.body.append(h("p", {}, words.second), panel.element, secondError, h("div", { class: "actions" }, later));
    secondChanged();
  }

  const go = h("button", { type: "button", class: "primary large", data: { testid: "setup-submit" } }, t("Continue"));
  go.addEventListener("click", () => {
    const { device, pad } = chosen;
    if (!device || (device === "gamepad" && !pad)) {
      driveError.hidden = false;
      setText(
        driveErrorText,
        device === "gamepad"
          ? t("Finish setting up the gamepad first, or choose the keyboard.")
          : t("Choose gamepad or keyboard first."),
      );
      drive.element.scrollIntoView({ block: "center" });
      (radios.find((one) => one.radio.checked) ?? radios[0])?.radio.focus({ preventScroll: true });
      return;
    }
    if (!secondFits()) return;
    if (chosen.sound === null && placement !== "none" && !onPanel) {
      hearError.hidden = false;
      play.focus();
      return;
    }
    if (!picture.fits()) return;
    const byPad = device === "gamepad" ? pad : null;
    const data = {
      device,
      pad_id: byPad?.padId.slice(0, 200) ?? null,
      mapping: byPad?.mapping ?? {},
      dead_zone: byPad?.deadZone ?? DEAD_ZONE.default,
      sound: (onPanel ? panel?.heard() : chosen.sound) === true,
    };
    whileBusy(go, t("Saving"), () => socket.submit("setup", data).catch(() => {}));
  });

  const steps = [drive.element, placement === "none" || onPanel ? null : hear.element, second?.element];
  const element = card({
    title: t("Set up"),
    wide: true,
    testid: "page-setup",
    body: [picture.element, ...steps, h("div", { class: "actions" }, go)],
  });
  if (chosen.device) choose(chosen.device);
  const close = () => {
    stopDetail();
    panel?.close();
    sound.silence();
  };
  return { element, close };
}
