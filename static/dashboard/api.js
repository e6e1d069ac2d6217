// The HTTP API as the dashboard uses it. Errors are thrown as sentences with the HTTP status.

import { labUrl } from "../common/root.js";
import { lasting, tab } from "../common/store.js";

const STATUS = {
  401: "The token is missing or wrong.",
  403: "The token is missing or wrong.",
  404: "The lab does not know this session.",
  429: "Too many wrong tokens; wait a minute.",
  409: "That is not possible in the session's present state.",
  500: "The lab failed inside; its console says why.",
};

export class Api {
  constructor() {
    const given = new URLSearchParams(location.hash.slice(1)).get("token");
    if (given) {
      this.setToken(given);
      history.replaceState(null, "", location.pathname + location.search); // out of sight and of screenshots
    } else this.token = tab.get("experimenter") ?? "";
  }

  /** Who sits here: it stands in the events of what is done from this browser. */
  get initials() {
    return lasting.get("initials", "");
  }

  set initials(text) {
    lasting.set("initials", text.trim().slice(0, 20));
  }

  setToken(token) {
    this.token = token;
    if (token) tab.set("experimenter", token);
    else tab.remove("experimenter");
  }

  async sessions() {
    const answer = await (await this._ask("/api/sessions")).json();
    return Array.isArray(answer) ? answer : (answer.sessions ?? []);
  }

  /** [{participant, link, panel_link}] */
  async create({ demo, kind, label, count }) {
    const body = { demo };
    if (kind) body.kind = kind;
    if (label) body.label = label;
    if (count > 1) body.count = count;
    const answer = await (await this._ask("/api/participants", { method: "POST", body })).json();
    return Array.isArray(answer) ? answer : (answer.created ?? [answer]);
  }

  async get(path) {
    return (await this._ask(path)).json();
  }

  async send(path, body) {
    return (await this._ask(path, { method: "POST", body })).json();
  }

  async text(path, body) {
    return (await this._ask(path, { method: "POST", body })).text();
  }

  async act(participant, action, reason) {
    await this._ask(`/api/sessions/${encodeURIComponent(participant)}/${action}`, {
      method: "POST",
      body: { reason: reason || null },
    });
  }

  /** What the experimenter says about a session or to its participant: note, mark, message, help_seen. */
  async say(participant, what, body) {
    await this._ask(`/api/sessions/${encodeURIComponent(participant)}/${what}`, { method: "POST", body });
  }

  /** One of the heatmaps of the paper's Fig. 2 for the last tick. */
  async heatmap(participant, kind) {
    return (await this._ask(`/api/sessions/${encodeURIComponent(participant)}/heatmap?kind=${kind}`)).json();
  }

  /** Lets the browser open what it asks for without a token: 3-D views and the report. */
  async desk() {
    await this._ask("/api/desk", { method: "POST" });
  }

  /** Takes that away again, as far as the lab can be reached. */
  async leave() {
    await this._ask("/api/desk", { method: "DELETE" }).catch(() => {});
    this.setToken("");
  }

  async download() {
    const answer = await this._ask("/api/export");
    const name = /filename="?([^";]+)/.exec(answer.headers.get("content-disposition") ?? "")?.[1] ?? "export.zip";
    const url = URL.createObjectURL(await answer.blob());
    const link = Object.assign(document.createElement("a"), { href: url, download: name });
    document.body.append(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(url), 60_000);
  }

  async _ask(path, { method = "GET", body } = {}) {
    let answer;
    try {
      const headers = { Authorization: `Bearer ${this.token}`, "Salab-Who": encodeURIComponent(this.initials) };
      if (body !== undefined) headers["Content-Type"] = "application/json";
      answer = await fetch(labUrl(path), {
        method,
        headers,
        body: body === undefined ? undefined : JSON.stringify(body),
        cache: "no-store",
      });
    } catch {
      throw Object.assign(new Error("The lab does not answer. Is it still running?"), { status: 0 });
    }
    if (answer.ok) return answer;
    throw Object.assign(new Error(await words(answer)), { status: answer.status });
  }
}

/** The lab's own sentence when it sent one. */
async function words(answer) {
  try {
    const { detail, message, error } = await answer.json();
    if (Array.isArray(detail))
      return detail.map((one) => `${(one.loc ?? []).slice(1).join(".")}: ${one.msg}`).join("; ");
    const text = detail?.message ?? detail ?? message ?? error;
    if (typeof text === "string" && answer.status !== 401 && answer.status !== 403) return text;
  } catch {
    // not JSON: the status has to do
  }
  return STATUS[answer.status] ?? `The lab answered ${answer.status}.`;
}
