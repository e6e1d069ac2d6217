// The HTTP API as the dashboard uses it. Errors are thrown as sentences with the HTTP status.

import { labUrl } from "../common/root.js";
import { lasting, tab } from "../common/store.js";

/** @import { EventRow, HealthReply, InvitationReply, InviteReply, InviteRequest, LiveReply, Plane, SessionReply } from "../../tests/javascript/api.d.ts" */
/** @typedef {SessionReply & Partial<LiveReply>} Session a session at a glance; asked for, without what only the socket tells */
/** @typedef {Omit<EventRow, "data"> & { data: Record<string, unknown> }} SessionEvent */

/** @type {Record<number, string>} */
const STATUS = {
  401: "The token is missing or wrong.",
  403: "The token is missing or wrong.",
  404: "The lab does not know this session.",
  429: "Too many wrong tokens; wait a minute.",
  409: "That is not possible in the session's present state.",
  500: "The lab failed inside; its console says why.",
};

/** Why the lab did not do it, with the HTTP status; 0 when it did not answer. */
export class ApiError extends Error {
  /**
   * @param {string} text
   * @param {number} status
   */
  constructor(text, status) {
    super(text);
    this.status = status;
  }
}

/**
 * Whether the lab wants the token first.
 *
 * @param {unknown} thrown
 * @returns {boolean}
 */
export function isRefused(thrown) {
  return thrown instanceof ApiError && (thrown.status === 401 || thrown.status === 403);
}

export class Api {
  constructor() {
    this.token = tab.get("experimenter", "");
    const given = new URLSearchParams(location.hash.slice(1)).get("token");
    if (given) {
      this.setToken(given);
      history.replaceState(null, "", location.pathname + location.search); // out of sight and of screenshots
    }
  }

  /**
   * Who sits here: it stands in the events of what is done from this browser.
   *
   * @returns {string}
   */
  get initials() {
    return lasting.get("initials", "");
  }

  set initials(text) {
    lasting.set("initials", text.trim().slice(0, 20));
  }

  /**
   * @param {string} token "" for none
   * @returns {void}
   */
  setToken(token) {
    this.token = token;
    if (token) tab.set("experimenter", token);
    else tab.remove("experimenter");
  }

  /** @returns {Promise<HealthReply>} */
  async health() {
    return this.get("/api/health");
  }

  /** @returns {Promise<Session[]>} */
  async sessions() {
    return this.get("/api/sessions");
  }

  /**
   * @param {Required<Pick<InviteRequest, "demo" | "kind" | "count">> & { label: string }} invitation
   * @returns {Promise<InvitationReply[]>}
   */
  async create({ demo, kind, label, count }) {
    const given = { ...(kind === "pilot" && { kind }), ...(label && { label }), ...(count > 1 && { count }) };
    /** @type {InviteReply} */
    const { created } = await this.send("/api/participants", { demo, ...given });
    return created;
  }

  /**
   * @template Reply
   * @param {string} path
   * @returns {Promise<Reply>}
   */
  async get(path) {
    return (await this._ask(path)).json();
  }

  /**
   * @template Reply
   * @param {string} path
   * @param {object} body
   * @returns {Promise<Reply>}
   */
  async send(path, body) {
    return (await this._ask(path, { method: "POST", body })).json();
  }

  /**
   * @param {string} path
   * @param {object} body
   * @returns {Promise<string>}
   */
  async text(path, body) {
    return (await this._ask(path, { method: "POST", body })).text();
  }

  /**
   * @param {string} participant
   * @param {string} action
   * @param {string} reason
   * @returns {Promise<void>}
   */
  async act(participant, action, reason) {
    await this._ask(`/api/sessions/${encodeURIComponent(participant)}/${action}`, {
      method: "POST",
      body: { reason: reason || null },
    });
  }

  /**
   * What the experimenter says about a session or to its participant: note, mark, message, help_seen.
   *
   * @param {string} participant
   * @param {string} what
   * @param {object} body
   * @returns {Promise<void>}
   */
  async say(participant, what, body) {
    await this._ask(`/api/sessions/${encodeURIComponent(participant)}/${what}`, { method: "POST", body });
  }

  /**
   * One of the heatmaps of the paper's Fig. 2 for the last tick.
   *
   * @param {string} participant
   * @param {Plane["kind"]} kind
   * @returns {Promise<Plane>}
   */
  async heatmap(participant, kind) {
    return this.get(`/api/sessions/${encodeURIComponent(participant)}/heatmap?kind=${kind}`);
  }

  /**
   * Lets the browser open what it asks for without a token: 3-D views and the report.
   *
   * @returns {Promise<void>}
   */
  async desk() {
    await this._ask("/api/desk", { method: "POST" });
  }

  /**
   * Takes that away again, as far as the lab can be reached.
   *
   * @returns {Promise<void>}
   */
  async leave() {
    await this._ask("/api/desk", { method: "DELETE" }).catch(() => {});
    this.setToken("");
  }

  /**
   * @param {string} path
   * @returns {Promise<void>}
   */
  async remove(path) {
    await this._ask(path, { method: "DELETE" });
  }

  /**
   * @param {string} path of a file
   * @returns {Promise<void>}
   */
  async download(path) {
    const answer = await this._ask(path);
    const name = /filename="?([^";]+)/.exec(answer.headers.get("content-disposition") ?? "")?.[1] ?? "export.zip";
    const url = URL.createObjectURL(await answer.blob());
    const link = Object.assign(document.createElement("a"), { href: url, download: name });
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(url), 60_000);
  }

  /**
   * @param {string} path
   * @param {{ method?: string, body?: object }} [request]
   * @returns {Promise<Response>}
   */
  async _ask(path, { method = "GET", body } = {}) {
    const who = { Authorization: `Bearer ${this.token}`, "Salab-Who": encodeURIComponent(this.initials) };
    const headers = body === undefined ? who : { ...who, "Content-Type": "application/json" };
    const content = body === undefined ? null : JSON.stringify(body);
    let answer;
    try {
      answer = await fetch(labUrl(path), { method, headers, body: content, cache: "no-store" });
    } catch {
      throw new ApiError("The lab does not answer. Is it still running?", 0);
    }
    if (answer.ok) return answer;
    throw new ApiError(await words(answer), answer.status);
  }
}

/**
 * The lab's own sentence when it sent one.
 *
 * @param {Response} answer
 * @returns {Promise<string>}
 */
async function words(answer) {
  try {
    /** @type {{ detail?: string | { loc: string[], msg: string }[] }} */
    const { detail } = await answer.json();
    if (Array.isArray(detail)) return detail.map(({ loc, msg }) => `${loc.slice(1).join(".")}: ${msg}`).join("; ");
    if (typeof detail === "string" && answer.status !== 401 && answer.status !== 403) return detail;
  } catch {
    // not JSON: the status has to do
  }
  return STATUS[answer.status] ?? `The lab answered ${answer.status}.`;
}
