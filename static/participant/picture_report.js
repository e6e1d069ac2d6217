// Tells the lab whether the robot is to be seen on this screen, so that no round runs on an empty picture.

/** @import { LabSocket } from "../wire/socket.js" */
/** @import { DrivingPage, PausedPage } from "./drive.js" */
/** @import { PictureWatch } from "./picture_watch.js" */

export class PictureReport {
  /** @param {{ socket: LabSocket, watch: PictureWatch }} wiring */
  constructor({ socket, watch }) {
    this.socket = socket;
    this.watch = watch;
    /** @type {"there" | "lost" | null} */
    this._told = null; // over this connection
    /** @type {DrivingPage | PausedPage | null} */
    this._toldOn = null;
    /** @type {DrivingPage | PausedPage | null} */
    this._page = null;
    this._runs = false;
    this._deafen = socket.on("welcome", () => {
      this._told = null;
    });
    this._seen = () => this._page && this.tell(this._page, this._runs);
    document.addEventListener("visibilitychange", this._seen);
  }

  /**
   * Says what there is to say; called whenever something may have changed.
   *
   * @param {DrivingPage | PausedPage} page what is shown
   * @param {boolean} runs whether ticks run
   * @returns {void}
   */
  tell(page, runs) {
    this._page = page;
    this._runs = runs;
    if (!this.socket.open) return;
    const { there, why } = this.watch;
    if (there) {
      // Whoever looks at another page when it comes back is not surprised by a robot that moves.
      if (this._told === "there" || (isMissed(page) && document.hidden)) return;
      this._told = "there";
      this.socket.submit("picture", { there: true }).catch(() => {});
    } else if (runs || why) {
      const isNew = runs && this._toldOn !== page; // somebody let it go on without a picture
      if (this._told === "lost" && !isNew) return;
      this._told = "lost";
      this._toldOn = page;
      this.socket.submit("picture", { there: false, why: why ?? "not_loaded" }).catch(() => {});
    }
  }

  /** @returns {void} */
  close() {
    this._deafen();
    document.removeEventListener("visibilitychange", this._seen);
  }
}

/**
 * Whether it is paused because the robot could not be seen.
 *
 * @param {DrivingPage | PausedPage} page
 * @returns {boolean}
 */
function isMissed(page) {
  return page.state === "paused" && (page.content.causes ?? []).includes("picture");
}
