// The roster: how the counterbalancing is filled, who is enrolled, and what may be done to whom. One page at a time.

import { copyButton } from "../common/copy.js";
import { freshId, h, icon, setText } from "../common/dom.js";
import { problemText } from "../common/problem.js";
import { setWordsLimit } from "../common/words_limit.js";
import { isRefused } from "./api.js";
import { erase, newLink, reject, withdraw } from "./roster_dialogs.js";
import { gridTable, legend } from "./roster_grid.js";

/** @import { CertificateReply, RecruitmentReply, RosterLine, RosterReply } from "../../tests/javascript/api.d.ts" */
/** @import { IconName } from "../common/dom.js" */
/** @import { Toasts } from "../common/shell.js" */
/** @import { Api } from "./api.js" */
/** @typedef {(api: Api, line: RosterLine, consentSays: RosterReply["withdrawal"]) => Promise<string | null>} Work */
/** @typedef {[act: string, label: string, work: Work]} Action */

const PAGE = 25;
const EVERY_MS = 5000;
const SHOW = [
  ["all", "Everybody"],
  ["study", "Participants"],
  ["pilot", "Pilots"],
  ["demo", "Demos"],
  ["waiting", "Not begun"],
  ["under_way", "Under way"],
  ["done", "Complete"],
  ["rejected", "Rejected"],
  ["withdrawn", "Withdrawn"],
  ["aborted", "Aborted"],
  ["screened_out", "Screened out"],
  ["lapsed", "Place lapsed"],
  ["unreadable", "Cannot be read"],
  ["erased", "Erased"],
];
const COUNTED = {
  waiting: "not begun",
  under_way: "under way",
  done: "complete",
  rejected: "rejected",
  withdrawn: "withdrawn",
  aborted: "aborted",
  screened_out: "screened out",
  lapsed: "lapsed",
  unreadable: "cannot be read",
  pilot: "pilots",
  demo: "demos",
  erased: "erased",
};
const CERTIFIED = {
  complete: "all that their pages were told is saved is stored",
  less: "more is stored than their pages were told",
  more: "their pages were told of more than is stored: see salab verify",
  unconfirmed: "stored; no page has reported what it was told",
};
/** @type {Record<string, IconName>} */
const SIGNS = {
  done: "check",
  rejected: "warning",
  withdrawn: "hand",
  aborted: "warning",
  screened_out: "hand",
  lapsed: "hourglass",
  unreadable: "warning",
  erased: "hourglass",
};
/** @type {Record<string, string>} */
const KINDS = { study: "the study", pilot: "a pilot", demo: "a demo", erased: "–" };
/** @type {Action[]} */
const ACTIONS = [
  ["new_link", "New link", newLink],
  ["reject", "Reject", reject],
  ["withdraw", "Withdraw", withdraw],
  ["erase", "Erase", erase],
];

export class Roster {
  /** @param {{ api: Api, toasts: Toasts, onActed: () => void }} wiring */
  constructor({ api, toasts, onActed }) {
    this.api = api;
    this.toasts = toasts;
    this.onActed = onActed;
    this.offset = 0;
    this.drawn = "";
    this.asked = 0;
    this.timer = 0;
    /** @type {RosterReply["withdrawal"]} */
    this.withdrawal = "keep";
    const searchId = freshId("search");
    const showId = freshId("show");
    this.search = h("input", {
      id: searchId,
      type: "text",
      maxlength: 200,
      autocomplete: "off",
      data: { testid: "roster-search" },
    });
    this.show = h(
      "select",
      { id: showId, data: { testid: "roster-show" } },
      SHOW.map(([value, label]) => h("option", { value }, label)),
    );
    for (const control of [this.search, this.show]) control.addEventListener("input", () => this._turn(0));
    this.grid = h("div", {
      class: "table-scroll order-scroll",
      tabindex: "0",
      role: "region",
      "aria-label": "Counterbalancing",
    });
    this.counts = h("p", { class: "hint", data: { testid: "roster-counts" } });
    this.body = h("tbody", {});
    this.problem = h("p", { class: "field-error", role: "alert", hidden: true, data: { testid: "roster-problem" } });
    this.range = h("span", { role: "status", data: { testid: "roster-range" } });
    this.earlier = h("button", { type: "button", class: "secondary small", data: { testid: "roster-newer" } }, "Newer");
    this.later = h("button", { type: "button", class: "secondary small", data: { testid: "roster-older" } }, "Older");
    this.earlier.addEventListener("click", () => this._turn(this.offset - PAGE));
    this.later.addEventListener("click", () => this._turn(this.offset + PAGE));
    const columns = ["Participant", "Enrolled for", "State", "Order", "Created", "Actions"].map((name) =>
      h("th", { scope: "col" }, name),
    );
    this.places = h("p", { class: "hint", data: { testid: "recruitment-places" } });
    this.recruitment = h("div", { hidden: true, data: { testid: "recruitment" } });
    this.element = h(
      "section",
      { class: "board-card", "aria-labelledby": "roster-title", data: { testid: "roster" } },
      h("h2", { id: "roster-title" }, "Roster"),
      this.problem,
      this.counts,
      this.recruitment,
      h("h3", {}, "Counterbalancing"),
      legend(),
      this.grid,
      h(
        "div",
        { class: "create" },
        h("div", { class: "field grow" }, h("label", { for: searchId }, "Find by id or note"), this.search),
        h("div", { class: "field" }, h("label", { for: showId }, "Show"), this.show),
      ),
      h(
        "div",
        { class: "table-scroll" },
        h(
          "table",
          { class: "sessions", data: { testid: "roster-table" } },
          h("caption", { class: "visually-hidden" }, "Everybody enrolled, newest first"),
          h("thead", {}, h("tr", {}, columns)),
          this.body,
        ),
      ),
      h("div", { class: "actions" }, this.earlier, this.later, this.range),
    );
  }

  /** @returns {void} */
  start() {
    this.stop();
    this.refresh();
    this.timer = setInterval(() => document.hidden || this.refresh(), EVERY_MS);
  }

  /** @returns {void} */
  stop() {
    clearInterval(this.timer);
  }

  /** @returns {Promise<void>} */
  async refresh() {
    this.asked += 1;
    const asked = this.asked;
    const query = new URLSearchParams({
      offset: `${this.offset}`,
      limit: `${PAGE}`,
      show: this.show.value,
      search: this.search.value,
    });
    try {
      /** @type {RosterReply} */
      const roster = await this.api.get(`/api/roster?${query}`);
      if (asked !== this.asked) return; // a newer question is on its way
      this.problem.hidden = true;
      if (roster.lines.length === 0 && this.offset > 0) this._turn(0);
      else this._draw(roster);
    } catch (error) {
      if (isRefused(error)) return; // the page asks for the token
      this.problem.hidden = false;
      setText(this.problem, `The roster is not up to date: ${problemText(error)}`);
    }
  }

  /** @param {number} offset */
  _turn(offset) {
    this.offset = Math.max(0, offset);
    this.refresh();
  }

  /** @param {RosterReply} roster */
  _draw(roster) {
    const text = JSON.stringify(roster);
    if (text === this.drawn) return; // the same elements stay, and with them focus and selection
    this.drawn = text;
    const focus = document.activeElement;
    const isHere = focus instanceof HTMLElement && this.body.contains(focus);
    const place = isHere
      ? { participant: focus.closest("tr")?.dataset.participant, button: focus.dataset.testid }
      : null;
    this.withdrawal = roster.withdrawal;
    setWordsLimit(roster.words_limit);
    setText(
      this.counts,
      Object.entries(COUNTED)
        .filter(([key]) => key !== "unreadable" || (roster.counts[key] ?? 0) > 0)
        .map(([key, words]) => `${roster.counts[key]} ${words}`)
        .join(" · "),
    );
    this._recruit(roster.recruitment);
    this.grid.replaceChildren(gridTable(roster.grid));
    this.body.replaceChildren(...roster.lines.map((line) => this._line(line)));
    const last = roster.offset + roster.lines.length;
    setText(this.range, roster.total === 0 ? "Nobody" : `${roster.offset + 1}–${last} of ${roster.total}`);
    this.earlier.disabled = roster.offset === 0;
    this.later.disabled = last >= roster.total;
    if (place?.participant && place.button) {
      const selector = `tr[data-participant="${CSS.escape(place.participant)}"] [data-testid="${place.button}"]`;
      /** @type {HTMLElement | null} */ (this.body.querySelector(selector))?.focus();
    }
  }

  /**
   * The open link to give out. The same elements stay while only the count changes: a press on Copy survives.
   *
   * @param {RecruitmentReply} recruitment
   */
  _recruit({ open, quota, held, link }) {
    this.recruitment.hidden = !open;
    if (!open) return;
    if (this.recruitment.dataset.link !== link) {
      this.recruitment.dataset.link = link;
      this.recruitment.replaceChildren(
        h("h3", {}, "Open link"),
        this.places,
        h(
          "div",
          { class: "link-row spaced" },
          h("span", {}, "For the recruiter"),
          h("input", {
            type: "text",
            readonly: true,
            value: link,
            "aria-label": "Open link",
            data: { testid: "open-link" },
          }),
          h(
            "span",
            { class: "buttons" },
            copyButton(() => link, "Copy", "copy-open-link"),
          ),
        ),
      );
    }
    setText(
      this.places,
      `${held} of ${quota} places are taken${held >= quota ? ": whoever comes now is told that the study is full" : ""}. Whoever is rejected, withdrawn, aborted or screened out gives a place back, and so does whoever stays away before consent, if the study file says after how long.`,
    );
  }

  /**
   * @param {RosterLine} line
   * @returns {HTMLTableRowElement}
   */
  _line(line) {
    const state = line.problem ? "cannot be read" : line.rejected ? "rejected" : line.state.replaceAll("_", " ");
    const name = [line.participant, line.label && `· ${line.label}`].filter(Boolean).join(" ");
    const ids = Object.entries(line.ids)
      .filter(([, value]) => value !== line.label)
      .map(([key, value]) => h("span", {}, `${key} ${value}`));
    const kind = KINDS[line.kind];
    const sign = SIGNS[line.rejected ? "rejected" : line.state];
    return h(
      "tr",
      { data: { participant: line.participant, testid: "roster-row", kind: line.kind } },
      h("th", { scope: "row" }, name, ids.length > 0 && h("small", { class: "ids" }, ids)),
      h("td", {}, kind === "the study" || kind === "–" ? kind : h("span", { class: "badge" }, kind)),
      h(
        "td",
        { data: { column: "state" } },
        h("span", { class: "mark-line" }, sign && icon(sign), state),
        line.problem && h("small", { class: "ids" }, line.problem),
        line.certificate && h("small", { class: "ids", data: { testid: "certificate" } }, certified(line.certificate)),
      ),
      h("td", {}, line.order.join(" → ") || "–"),
      h("td", {}, day(line.erased_utc ?? line.created_utc)),
      h(
        "td",
        {},
        line.kind === "erased"
          ? ""
          : h(
              "div",
              { class: "buttons" },
              ACTIONS.map((action) => this._button(line, action)),
            ),
      ),
    );
  }

  /**
   * @param {RosterLine} line
   * @param {Action} action
   * @returns {HTMLButtonElement}
   */
  _button(line, [act, label, work]) {
    const why = line.why_not[act];
    const button = h(
      "button",
      {
        type: "button",
        class: "secondary small",
        "aria-label": `${label}: ${line.participant}`,
        "aria-disabled": String(why !== ""),
        title: why,
        "aria-description": why,
        data: { testid: `roster-${act}` },
      },
      label,
    );
    button.addEventListener("click", async () => {
      if (why) return this.toasts.show(`${line.participant}: ${why}`);
      try {
        const done = await work(this.api, line, this.withdrawal);
        if (done) this.toasts.show(done);
      } catch (error) {
        this.toasts.show(`${line.participant}: ${problemText(error)}`, { problem: true });
      }
      this.onActed();
      await this.refresh();
    });
    return button;
  }
}

/**
 * @param {string | null} utc
 * @returns {string}
 */
function day(utc) {
  return utc ? new Date(utc).toLocaleString([], { dateStyle: "medium", timeStyle: "short" }) : "–";
}

/**
 * @param {CertificateReply} certificate
 * @returns {string}
 */
function certified({ state, ticks, messages, head }) {
  return `${CERTIFIED[state]} (${ticks} ticks, ${messages} messages, chain ${head.slice(0, 8)})`;
}
