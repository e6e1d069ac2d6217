// Practice and trials: the scene, what to do now, what the robot is doing, and the hands.

import { h, icon, setText } from "../common/dom.js";
import { t } from "../common/language.js";
import { AlertView } from "../readings/alert.js";
import { wordsFor } from "../readings/words.js";
import { CardOverScene } from "./card_over_scene.js";
import { legendFor, UNKNOWN_KEY } from "./controls.js";
import { FreeButton, TimeWords } from "./freeing.js";
import { HintLine } from "./hint.js";
import { indicator } from "./indicator.js";
import { Inset } from "./inset.js";
import { InstructionCard } from "./instruction_card.js";
import { PassingNotice } from "./passing_notice.js";
import { PictureReport } from "./picture_report.js";
import { Progress } from "./progress.js";
import { Scene } from "./scene.js";
import { secondDevice } from "./second_device.js";
import { startCard } from "./start_card.js";
import { StateSign } from "./state_sign.js";
import { view as pausedView } from "./views/paused.js";

/** @import { Instruction, Status, Tick } from "../../tests/javascript/wire.d.ts" */
/** @import { CameraView } from "./scene.js" */
/** @import { Context, PageOf, View } from "./view.js" */
/** @import { Look } from "./picture.js" */
/** @import { Sign } from "./state_sign.js" */
/**
 * @typedef {object} Driving
 * @property {string} scene
 * @property {CameraView[]} views
 * @property {boolean} [inset] the second picture, from the side; left out: none
 * @property {Instruction | null} instruction
 * @property {"table" | "round"} [practice_task] what practice asks for; left out: what the rounds ask for
 * @property {number} tasks
 * @property {boolean} ready
 * @property {string | null} [panel_link] of the second device, where the study has one
 * @property {Record<string, Look>} [looks] with a layout of the study's own: how its objects and bins are drawn, by id
 */
/** @typedef {PageOf<Driving, "practice_ready" | "practice" | "trial_ready" | "trial">} DrivingPage */
/** @typedef {PageOf<Driving & { can_resume: boolean, can_free?: boolean, text: string, causes?: string[] }, "paused">} PausedPage */

const GRIPPER = { open: t("Gripper open"), closed: t("Gripper closed"), moving: t("Gripper moving") };
/** @type {ReadonlySet<Sign>} the time of a round stands still */
const STANDS_STILL = new Set(["paused", "lost", "held", "recovering", "starting"]);

/** @implements {View} */
export class DriveView {
  /** @param {Context} context */
  constructor(context) {
    const { socket, input, sound, session } = context;
    this.context = context;
    this.socket = socket;
    this.input = input;
    this.sound = sound;
    this.scene = new Scene({ socket, session });
    this.inset = new Inset();
    /** @type {DrivingPage | PausedPage | null} */
    this.page = null;
    this.key = "";
    /** @type {Tick | null} */
    this.tick = null;
    /** @type {Status["status"] | null} */
    this.status = null;
    /** @type {AlertView | null} */
    this.alert = null;
    /** @type {ReturnType<typeof secondDevice> | null} */
    this.panel = null; // of a round, where the readings appear on another device
    this.second = h("div", { class: "side-card", hidden: true, data: { testid: "second-lost" } });
    this.dialogOpen = false;
    this.sign = new StateSign();
    this.assist = h("p", { class: "assist", hidden: true, data: { testid: "assisting" } });
    this.instruction = new InstructionCard();
    this.progress = new Progress();
    this.time = new TimeWords();
    this.free = new FreeButton({ socket, onDialog: (open) => this.dialog(open) });
    this.hint = new HintLine();
    this.gripper = h("p", { class: "gripper-state", data: { testid: "gripper-state" } });
    this.hands = indicator(this.input);
    this.legend = h("div", { class: "legend-box" });
    this.soundButton = h(
      "button",
      { type: "button", class: "secondary small sound-off", hidden: true, data: { testid: "sound-off" } },
      icon("sound"),
      t("Sound is off: turn it on"),
    );
    this.soundButton.addEventListener("click", () => this.sound.unlock());
    this.notice = new PassingNotice();
    this.card = new CardOverScene();
    this.region = h(
      "div",
      {
        class: "drive-scene",
        tabindex: "-1",
        role: "group",
        "aria-label": t("The robot. Keys drive it while the round is running."),
      },
      this.scene.element,
      this.soundButton,
      this.notice.element,
      this.hint.element,
      this.card.element,
    );
    this.side = h(
      "aside",
      { class: "side", tabindex: "0", "aria-label": t("What to do and what the robot is doing") },
      this.sign.element,
      this.assist,
      this.second,
      this.instruction.element,
      this.inset.element,
      h("div", { class: "side-card way-on" }, this.progress.element, this.time.element, this.free.element),
      h("section", { class: "side-card controls", "aria-label": t("Controls") }, this.hands.element, this.legend),
    );
    this.hands.words.append(this.gripper);
    this.body = h(
      "div",
      { class: "drive-body" },
      h("h1", { class: "visually-hidden" }, t("Driving the robot")),
      this.region,
      this.side,
    );
    this.element = h("div", { class: "drive", data: { testid: "page-drive" } }, this.body);
    if (this.socket.welcome?.placement === "same_page_away") {
      this.alert = new AlertView({ socket: this.socket, sound: this.sound, away: true });
      this.element.append(this.alert.element);
      this.alert.addEventListener("open", () => {
        this.context.closeDialogs();
        this._refresh();
      });
      this.alert.addEventListener("released", (event) => {
        this._refresh();
        this.region.focus({ preventScroll: true });
        if (event.detail === "expired") this.notice.say(wordsFor(this.socket.welcome).missed);
      });
    }
    this.picture = new PictureReport({ socket, watch: this.scene.watch });
    this._drawLegend();
    this._deafen = [
      this.scene.watch.on("change", () => this._refresh()),
      socket.on("tick", (event) => this._onTick(event.detail)),
      socket.on("status", (event) => this._onStatus(event.detail)),
      socket.on("instruction", (event) => this.instruction.show(event.detail)),
      socket.on("state", () => this._refresh()),
      socket.on("saves", () => this._refresh()),
      input.on("device", (event) => this._device(event.detail)),
      input.keyboard.on("unknown", () => this.notice.say(UNKNOWN_KEY)),
      input.keyboard.labels.on("labels", () => this._drawLegend()),
      input.on("view", () => this._driving() && this.scene.next()),
      sound.on("state", () => this._refresh()),
    ];
  }

  /**
   * A page for practice_ready, practice, trial_ready, trial or paused.
   *
   * @param {DrivingPage | PausedPage} page
   * @returns {void}
   */
  show(page) {
    const before = this.page;
    this.page = page;
    if (page.state === "paused") {
      if (this.key === "") {
        // The first thing this tab sees of the round, after a reload.
        this.key = `paused:${page.trial}`;
        this.scene.show({ src: page.content.scene, key: this.key, views: page.content.views });
        this._showInset(page.content);
        this.instruction.looks = page.content.looks ?? {};
        if (page.content.instruction) this.instruction.show(page.content.instruction);
        this._drawProgress(0, page.content.tasks);
      }
      const { element, goOn } = pausedView(this.context, page, () => this.scene.watch.reload());
      this.card.show(element, { goOn });
    } else {
      const { content } = page;
      const part = page.state.replace("_ready", "");
      const key = `${part}:${page.trial}`;
      const resumed = this.key.startsWith("paused:");
      if (resumed) this.scene.key = key; // it is on the screen already
      if (this.key !== key) {
        this.key = key;
        this.tick = null;
        if (!resumed) this.alert?.clear();
        this._drawProgress(0, content.tasks);
      }
      this.scene.show({ src: content.scene, key, views: content.views });
      this._showInset(content);
      this.instruction.looks = content.looks ?? {};
      if (content.instruction) this.instruction.show(content.instruction);
      if (page.state.endsWith("_ready")) this._startCard(page);
      else this.card.show(null);
      if (this._ticking()) this._secondDevice();
      this.status = content.ready === false ? "starting" : null;
    }
    if (before?.state !== page.state && !page.state.endsWith("_ready") && page.state !== "paused") {
      this.region.focus({ preventScroll: true });
      for (const one of [document.documentElement, this.region]) one.scrollTop = 0; // Start may have stood below the fold
    }
    this._refresh();
  }

  /**
   * Dialogs take the hands off too.
   *
   * @param {boolean} open
   * @returns {void}
   */
  dialog(open) {
    this.dialogOpen = open;
    this._refresh();
    if (!open && this._driving()) this.region.focus({ preventScroll: true });
  }

  /** @returns {void} */
  close() {
    for (const stop of this._deafen) stop();
    this.picture.close();
    this.panel?.close();
    this.page = null; // what comes after, such as the end of a question, finds nobody who drives
    this.free.close();
    this.input.drive(false);
    this.alert?.close();
    this.scene.close();
    this.inset.close();
    this.hands.close();
    this.notice.hide();
  }

  /** @param {Driving} content */
  _showInset({ scene, inset = false }) {
    this.inset.show({ src: scene, key: this.scene.key ?? "", there: inset });
  }

  /** @param {DrivingPage} page */
  _startCard(page) {
    // The readings of a round appear on the second device: nobody starts while it is missing.
    this._secondDevice();
    const { element, button } = startCard({ socket: this.socket, page, panel: this.panel?.element ?? null });
    this.card.show(element, { start: button });
  }

  _secondDevice() {
    this.panel?.close();
    this.panel = null;
    this.second.hidden = true;
    if (this.socket.welcome?.placement !== "second_device") return;
    const link = this.page?.content.panel_link ?? null;
    const { socket, context } = this;
    this.panel = secondDevice({ socket, session: context.session, link, onChange: () => this._refresh() });
  }

  /** @param {Tick} tick */
  _onTick(tick) {
    if (!this._ticking()) return; // the last of a phase whose page is gone already
    this.tick = tick;
    if (this.status !== "paused") this.status = null;
    this.instruction.show(tick.instruction);
    this._drawProgress(tick.done_tasks, tick.tasks);
    setText(this.gripper, tick.holding ? t("Gripper holding") : GRIPPER[tick.gripper]);
    if (tick.notice) this.notice.say(tick.notice);
    if (tick.slipped) this.sound.slipped();
    this._refresh();
  }

  /** @param {Status} message */
  _onStatus({ status }) {
    this.status = status;
    this._refresh();
  }

  /**
   * @param {number} done
   * @param {number} tasks
   */
  _drawProgress(done, tasks) {
    if (!this.page) return;
    const round = { trial: this.page.trial ?? 0, trials: this.page.trials };
    const practice = this.key.startsWith("practice");
    const unknown = this.key.startsWith("paused:");
    const where = unknown
      ? t("Round {trial} of {trials}", round)
      : practice
        ? t("Practice before round {trial} of {trials}", round)
        : t("Task {task} of {tasks} · Round {trial} of {trials}", { task: Math.min(done + 1, tasks), tasks, ...round });
    this.progress.show(where, unknown || practice ? null : { done, tasks });
  }

  /** @param {{ there: boolean, again: boolean }} pad */
  _device({ there, again }) {
    this._drawLegend();
    this.notice.say(
      there
        ? again
          ? t("The gamepad is back. You can use it again.")
          : t("The gamepad is here. You can use it now.")
        : t("The gamepad is unplugged. The keyboard has taken over: see the keys on the right."),
    );
  }

  _drawLegend() {
    const { chosen, device, pads } = this.input;
    const isHidden = chosen === "gamepad" && device !== "gamepad" && pads.problem === null;
    this.legend.replaceChildren(
      isHidden ? h("p", { class: "hint" }, t("To drive with the gamepad, press any of its buttons.")) : "",
      legendFor(this.input),
    );
  }

  /** @returns {boolean} */
  _ticking() {
    return this.page !== null && (this.page.state === "practice" || this.page.state === "trial");
  }

  /** @returns {boolean} */
  _driving() {
    return this._ticking() && this.socket.open && this.status !== "paused" && !this.alert?.covering && !this.dialogOpen;
  }

  /** @returns {Sign} */
  _state() {
    if (this.socket.state !== "open") return "lost";
    if (this.page?.state === "paused" || this.status === "paused") return "paused";
    if (!this.socket.saves) return "unsaved";
    if (this.status === "held" || this.status === "recovering" || this.status === "starting") return this.status;
    if (!this._ticking()) return this._startsWithout() ?? "ready";
    if (this.tick && this.tick.status !== "running") return this.tick.status;
    return "running";
  }

  /** @returns {"unseen" | "alone" | null} what is missing for a start, besides the robot */
  _startsWithout() {
    if (!this.scene.watch.there) return "unseen";
    return this.panel !== null && !this.panel.there() ? "alone" : null;
  }

  _refresh() {
    const { page } = this;
    if (!page) return;
    const state = this._state();
    this.picture.tell(page, this._ticking() && (this.status === null || this.status === "running"));
    this.sign.show(state);
    if (state === "lost" || state === "paused") this.notice.hide();
    this.soundButton.hidden = this.sound.ready || this.alert === null;
    this.card.refresh(state, this.scene.watch.there);
    this._showTick(state);
    this._showSecondDevice();
    this._showAlert(state);
    const driven = this._ticking() || (page.state === "paused" && page.content.can_free);
    this.free.offer(!driven ? "no" : state === "lost" ? "lost" : state === "resetting" ? "returning" : "yes");
    this.input.drive(this._driving());
  }

  /** @param {Sign} state */
  _showTick(state) {
    const { tick } = this;
    this.hint.show(state === "running" && tick?.blocked ? tick : null);
    const assisting = tick?.assisting ?? null;
    this.assist.hidden = assisting === null;
    if (assisting !== null) setText(this.assist, assisting ? t("The robot is assisting") : t("You are driving"));
    this.time.show(this._ticking() ? (tick?.ending ?? null) : null);
  }

  _showSecondDevice() {
    const alone = this._ticking() && this.panel !== null && !this.panel.there();
    if (alone && this.second.hidden) this.second.replaceChildren(this.panel?.element ?? "");
    this.second.hidden = !alone;
  }

  /** @param {Sign} state */
  _showAlert(state) {
    this.alert?.pause(STANDS_STILL.has(state));
    this.alert?.conceal(this.page?.state === "paused");
    this.body.inert = Boolean(this.alert?.covering && !this.alert.concealed);
  }
}
