// The 3-D picture: viser's own client in a frame that cannot be touched or focused, our signs above it, and views.

import { h, icon, setText } from "../common/dom.js";
import { t } from "../common/language.js";
import { labUrl } from "../common/root.js";
import { tab } from "../common/store.js";
import { PictureWatch } from "./picture_watch.js";

/** @import { LabSocket } from "../wire/socket.js" */
/** @typedef {{ name: string, label: string }} CameraView */

const SIGNS = {
  lost: t("Connection lost. What you see is old; the robot stands still. Trying again."),
  stale: t("The picture of the robot stopped. Connecting to it again."),
  loading: t("Loading the picture of the robot"),
  no_webgl: t("This browser does not show 3-D pictures, so the robot cannot be seen."),
  context_lost: t("The browser has stopped showing the picture of the robot. Loading it again."),
  not_loaded: t("The picture of the robot does not load. Trying again."),
  connection: t("The picture of the robot stopped. Connecting to it again."),
};

export class Scene {
  /** @param {{ socket: LabSocket, session: string }} wiring */
  constructor({ socket, session }) {
    this.socket = socket;
    this.viewKey = `${session}:view`;
    this.frame = h("iframe", {
      class: "scene-frame",
      title: t("The robot, the table and the bins"),
      tabindex: "-1",
      inert: true,
      data: { testid: "scene-frame" },
    });
    this.signText = h("p", {});
    this.signIcon = h("span", { class: "scene-sign-icon" });
    this.sign = h(
      "div",
      { class: "scene-sign", role: "status", data: { testid: "scene-sign" } },
      this.signIcon,
      this.signText,
    );
    this.watch = new PictureWatch(this.frame);
    this.watch.addEventListener("change", () => this._update());
    this.views = h("div", { class: "views", role: "group", "aria-label": t("Camera view") });
    this.element = h("div", { class: "scene", data: { testid: "scene" } }, this.frame, this.sign, this.views);
    /** @type {string | null} */
    this.key = null;
    /** @type {string | null} */
    this.src = null;
    /** @type {string | null} */
    this._names = null; // of the views that are drawn; null before any are
    this._drawn = false;
    this._sceneLost = false;
    this.watch.addEventListener("connection", ({ detail: connected }) => {
      this._sceneLost = !connected;
      if (connected) {
        this._drawn = true;
        const view = this._keptView();
        if (view) this.socket.send({ type: "view", name: view }); // a new scene starts with the first one
      }
      this._update();
    });
    this._deafen = socket.on("state", () => this._update());
    this._update();
  }

  /**
   * `key` changes when another worker draws (practice, each trial): the frame is then loaded anew.
   *
   * @param {{ src: string, key: string, views: CameraView[] }} scene
   * @returns {void}
   */
  show({ src, key, views }) {
    const names = views.map((view) => view.name).join();
    if (names !== this._names) {
      this._names = names;
      this._drawViews(views);
    }
    if (!src) this.watch.none();
    if (!src || (src === this.src && key === this.key)) return;
    this.src = src;
    this.key = key;
    this._drawn = false;
    this._sceneLost = false;
    this.frame.src = labUrl(src);
    this.watch.loading();
    this._update();
  }

  /** @returns {void} */
  close() {
    this.watch.close();
    this._deafen();
  }

  /**
   * The next view, as its button would show it; after the last comes the first.
   *
   * @returns {void}
   */
  next() {
    const buttons = [...this.views.querySelectorAll("button")];
    const shown = buttons.findIndex((button) => button.getAttribute("aria-pressed") === "true");
    buttons[(shown + 1) % buttons.length]?.click();
  }

  /** @returns {string | null} */
  _keptView() {
    return tab.get(this.viewKey, null);
  }

  /** @param {CameraView[]} views */
  _drawViews(views) {
    const kept = this._keptView();
    const shown = views.some((view) => view.name === kept) ? kept : views[0]?.name;
    const buttons = views.map((view) => {
      const button = h(
        "button",
        {
          type: "button",
          class: "view",
          "aria-pressed": view.name === shown ? "true" : "false",
          data: { testid: `view-${view.name}` },
        },
        view.label,
      );
      button.addEventListener("click", () => {
        if (!this.socket.send({ type: "view", name: view.name })) return;
        for (const other of buttons) other.setAttribute("aria-pressed", String(other === button));
        tab.set(this.viewKey, view.name);
        this.socket.note("view_switched", { view: view.name });
        button.blur(); // Space and Enter go on to mean the gripper
      });
      return button;
    });
    this.views.hidden = views.length < 2;
    this.views.replaceChildren(h("span", { class: "views-label", "aria-hidden": "true" }, t("View")), ...buttons);
  }

  _update() {
    const missing = this.watch.why ?? (this.watch.there ? null : "loading");
    const stale = this._sceneLost && this._drawn ? "stale" : null; // not missed yet
    const kind = this.socket.state !== "open" ? "lost" : (missing ?? stale);
    this.sign.hidden = kind === null;
    if (kind === null) delete this.sign.dataset.kind;
    if (kind === null || this.sign.dataset.kind === kind) return;
    this.sign.dataset.kind = kind;
    const sign = kind === "lost" ? icon("lost") : kind === "no_webgl" ? icon("warning") : null;
    this.signIcon.replaceChildren(sign ?? h("span", { class: "spinner large" }));
    setText(this.signText, SIGNS[kind]);
  }
}
