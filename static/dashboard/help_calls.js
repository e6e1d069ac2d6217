// Calls for help, above everything else: seen in the page and in the tab's title, heard, and answered from here.

import { h, icon, setText } from "../common/dom.js";
import { problemText } from "../common/problem.js";
import { Sound } from "../readings/sound.js";

/** @import { Toasts } from "../common/shell.js" */
/** @import { Api, Session } from "./api.js" */

const AGAIN_MS = 15_000; // it sounds again until somebody has seen it

export class HelpCalls {
  /** @param {{ api: Api, toasts: Toasts, onSeen: () => void }} wiring */
  constructor({ api, toasts, onSeen }) {
    this.api = api;
    this.toasts = toasts;
    this.onSeen = onSeen;
    this.sound = new Sound();
    this.title = document.title;
    /** @type {Map<string, string>} */
    this.calling = new Map(); // participant to when they called
    this.timer = 0;
    this.list = h("ul", { class: "help-calls", data: { testid: "help-calls" } });
    this.mute = h(
      "button",
      { type: "button", class: "secondary small", hidden: true, data: { testid: "help-sound" } },
      icon("sound"),
      "Calls for help are silent: turn the sound on",
    );
    this.mute.addEventListener("click", () => this.sound.unlock());
    this.sound.addEventListener("state", () => this._silent());
    this.element = h("div", { class: "help-place" }, h("div", { role: "alert" }, this.list), this.mute);
  }

  /**
   * @param {Session[]} sessions
   * @returns {void}
   */
  update(sessions) {
    const asking = sessions.filter((session) => session.help_wanted);
    const now = new Map(asking.map((session) => [session.participant, session.help?.since_utc ?? ""]));
    const words = asking.map((session) => `${session.participant}:${session.help?.words ?? ""}`).join("|");
    const isNew = [...now].some(([participant, since]) => this.calling.get(participant) !== since);
    this.calling = now;
    if (this.list.dataset.words !== words) {
      this.list.dataset.words = words;
      this.list.replaceChildren(...asking.map((session) => this._line(session)));
    }
    document.title = now.size > 0 ? `(${now.size}) Help: ${[...now.keys()].join(", ")} · ${this.title}` : this.title;
    this._silent();
    if (!isNew && now.size > 0) return;
    clearInterval(this.timer);
    if (now.size === 0) return;
    this._ring();
    this.timer = setInterval(() => this._ring(), AGAIN_MS);
  }

  _ring() {
    this.sound.tones(3).then(() => this._silent());
  }

  _silent() {
    this.mute.hidden = this.calling.size === 0 || this.sound.ready;
  }

  /** @param {Session} session */
  _line({ participant, label, help }) {
    const seen = h(
      "button",
      {
        type: "button",
        class: "primary small",
        "aria-label": `I have seen the call of ${participant}`,
        data: { testid: "help-seen" },
      },
      "I have seen it",
    );
    seen.addEventListener("click", async () => {
      try {
        await this.api.say(participant, "help_seen", {});
        this.toasts.show(`${participant}: the call for help is answered. They have been told that you saw it.`);
      } catch (error) {
        this.toasts.show(`${participant}: ${problemText(error)}`, { problem: true });
      }
      this.onSeen();
    });
    const at = help ? new Date(help.since_utc).toLocaleTimeString([], { hour12: false }) : "";
    const said = h("span", { class: "help-words" });
    setText(said, help ? (help.words ? `“${help.words}”` : "They gave no words.") : "");
    return h(
      "li",
      { data: { participant } },
      icon("help"),
      h(
        "span",
        { class: "help-who" },
        h("strong", {}, `${participant}${label ? ` · ${label}` : ""} asks for help`),
        at && h("span", { class: "hint" }, ` since ${at}`),
        said,
      ),
      h("a", { class: "button secondary small", href: `#session=${encodeURIComponent(participant)}` }, "Open"),
      seen,
    );
  }
}
