// Written by tests/javascript/message_types.py from the lab's own models: change those, then run it again.

/** Who to enrol. */
export interface InviteRequest {
  demo?: boolean;
  kind?: "study" | "pilot" | "demo";
  pace?: "real_time" | "lockstep" | null;
  label?: string | null;
  count?: number;
}

/** A new participant's links. They cannot be shown again: only hashes of their tokens are stored. */
export interface InvitationReply {
  participant: string;
  link: string;
  panel_link: string;
  second_device: boolean;
  demo: boolean;
  kind: string;
}

/** The first new participant, and all of them. */
export interface InviteReply {
  participant: string;
  link: string;
  panel_link: string;
  second_device: boolean;
  demo: boolean;
  kind: string;
  created: Array<InvitationReply>;
}

/** One session at a glance. */
export interface SessionReply {
  participant: string;
  label: string | null;
  demo: boolean;
  kind: string;
  state: string;
  place: string;
  causes: Array<string>;
  pause_reason: string | null;
  trial: number;
  trials: number;
  condition: string;
  order: Array<string>;
  pace: string;
  connected: boolean;
  panel_connected: boolean;
  panel_missing: boolean;
  held: boolean;
  not_saving: string;
  robot_problem: string;
  help_wanted: boolean;
  done_tasks: number | null;
  tasks: number | null;
  round_trip_ms: number | null;
  overruns: number;
  frees: number;
  device: string | null;
  created_utc: string;
  allowed: Array<string>;
  why_not: Record<string, string>;
  problem: string | null;
}

/** A participant's call for help. */
export interface HelpReply {
  words: string;
  since_utc: string;
}

/** One session at a glance, with what can be done about it now. */
export interface LiveReply {
  participant: string;
  label: string | null;
  demo: boolean;
  kind: string;
  state: string;
  place: string;
  causes: Array<string>;
  pause_reason: string | null;
  trial: number;
  trials: number;
  condition: string;
  order: Array<string>;
  pace: string;
  connected: boolean;
  panel_connected: boolean;
  panel_missing: boolean;
  held: boolean;
  not_saving: string;
  robot_problem: string;
  help_wanted: boolean;
  done_tasks: number | null;
  tasks: number | null;
  round_trip_ms: number | null;
  overruns: number;
  frees: number;
  device: string | null;
  created_utc: string;
  allowed: Array<string>;
  why_not: Record<string, string>;
  problem: string | null;
  trial_s: number | null;
  signals_per_s: number;
  driving_share: number | null;
  visible: boolean | null;
  focused: boolean | null;
  sound: boolean | null;
  picture: boolean | null;
  help: HelpReply | null;
  instruction: string | null;
  scene: string;
}

/** A candidate goal of a tick: position in the world frame, metres, and its probability. */
export interface Goal {
  id: string;
  label: string;
  position_m: [number, number, number] | null;
  probability: number;
  instructed: boolean;
}

/** One tick as the experimenter sees it. */
export interface TickExplanation {
  phase: string;
  trial: number;
  tick: number;
  trial_s: number;
  task: number | null;
  kind: string | null;
  source: string;
  departure: number | null;
  position_m: [number, number, number];
  action: [number, number, number] | null;
  user: [number, number, number] | null;
  gripper: string;
  held: string | null;
  blocked: boolean;
  blocked_reason: string | null;
  late_ms: number | null;
  entropy: number;
  goals: Array<Goal>;
  explanation: Record<string, number | string>;
}

/** One of the two heatmaps of paper Fig. 2, for a live tick. `values` has a row for each x, a column for each y. */
export interface Plane {
  kind: "information" | "reward";
  tick: number;
  z_m: number;
  x_m: Array<number>;
  y_m: Array<number>;
  values: Array<Array<number>>;
  unit: string;
  caption: string;
  goals: Array<Goal>;
  gripper_m: [number, number, number];
  table_m: [number, number, number, number];
}

/** Who holds a cell, and how far it is filled. */
export interface CellReply {
  participant: string;
  cell: "waiting" | "under_way" | "done";
}

/** What was stored when somebody ended, against what their pages were told is saved. */
export interface CertificateReply {
  state: "complete" | "less" | "more" | "unconfirmed";
  ticks: number;
  messages: number;
  links: number;
  head: string;
}

/** One order of the conditions. The next participant gets the order marked `next`. */
export interface GridReply {
  order: Array<string>;
  next: boolean;
  cells: Array<CellReply>;
  counts: Record<string, number>;
}

/** The open link of this study, and how many of its places are taken. */
export interface RecruitmentReply {
  open: boolean;
  quota: number;
  held: number;
  link: string;
}

/** One participant. `why_not` says for every act why it is not possible, "" where it is. */
export interface RosterLine {
  participant: string;
  label: string | null;
  ids: Record<string, string>;
  kind: string;
  state: string;
  order: Array<string>;
  rejected: boolean;
  erased_utc: string | null;
  created_utc: string | null;
  why_not: Record<string, string>;
  problem: string | null;
  certificate: CertificateReply | null;
}

/** One page of the roster, newest first, beside the whole grid. */
export interface RosterReply {
  title: string;
  withdrawal: "keep" | "erase";
  words_limit: number;
  recruitment: RecruitmentReply;
  grid: Array<GridReply>;
  counts: Record<string, number>;
  total: number;
  offset: number;
  lines: Array<RosterLine>;
}

/** What became of it. */
export interface EraseReply {
  participant: string;
  overwritten: boolean | null;
}

/** A link that carries a token; it cannot be shown again. */
export interface LinkReply {
  participant: string;
  link: string;
  panel_link: string;
}

/** That nearly as many people take part as the lab takes at once, or more. */
export interface CrowdingReply {
  level: string;
  text: string;
}

/** That the lab cannot save: nothing is acknowledged, robots stand still, and it tries again by itself. */
export interface TroubleReply {
  kind: string;
  text: string;
  since_utc: string;
  rescue: string | null;
}

/** One part of the lab. */
export interface CheckReply {
  name: "store" | "data_folder" | "workers" | "room" | "scene";
  reason: string;
}

/** Whether the lab is well, and which study it runs. */
export interface HealthReply {
  status: "ok" | "failing";
  study: string;
  robot: string;
  robot_note: string;
  look: string;
  people: number;
  capacity: number | null;
  capacity_note: string;
  detail: string;
  checks: Array<CheckReply>;
}

/** Anything else that happened, in order. */
export interface EventRow {
  participant: string;
  trial: number | null;
  tick: number | null;
  utc: string;
  kind: string;
  source: string;
  data: string;
}

/** The mean score of a questionnaire under one condition, over `n` trials. */
export interface ScoreLine {
  instrument: string;
  condition: string;
  n: number;
  mean: number;
}

/** What there is of data. Pilot and demo participants are not counted. */
export interface SummaryReply {
  trials: Record<string, number>;
  alerts: Record<string, number>;
  scores: Array<ScoreLine>;
}

/** One ended trial. An experimenter's `override` counts instead of the automatic `quality`. */
export interface VerdictLine {
  participant: string;
  trial: number;
  condition: string;
  outcome: string;
  quality: string | null;
  broken: Array<string>;
  override: string | null;
  reason: string | null;
  round_trip_ms: number | null;
  hidden_s: number | null;
  missed_ticks: number;
  focus_losses: number | null;
  pad_losses: number | null;
  unanswered_alerts: number | null;
}

/** One page of the trials, newest participant first, beside how many there are. */
export interface QualityReply {
  good: number;
  suspect: number;
  total: number;
  offset: number;
  lines: Array<VerdictLine>;
}

/** A figure of the report, at `/dashboard/report/figures/NAME.svg` and `.png`. */
export interface FigureLine {
  name: string;
  title: string;
}

/** The report of the data so far: `state` none, making, made or cannot, and how far it is or why it cannot be. */
export interface ReportReply {
  state: string;
  text: string;
  step: number;
  of: number;
  made_utc: string | null;
  participants: number;
  trials: number;
  figures: Array<FigureLine>;
}

/** The archive of all data: `state` none, making, made or cannot, and how far it is or why it cannot be. */
export interface ExportReply {
  state: "none" | "making" | "made" | "cannot";
  text: string;
  step: number;
  of: number;
  made_utc: string | null;
  include_pilot: boolean;
  excel_safe: boolean;
  bytes: number;
  rows: number;
}

/** What the page shows: begin or go on, or why not. `page` is where the study is, once somebody is let in. */
export interface JoinReply {
  state: "begin" | "back" | "bad_link" | "closed" | "full" | "elsewhere" | "busy";
  title: string;
  lines: Array<string>;
  link: string | null;
  page: string | null;
  again_s: number | null;
}
