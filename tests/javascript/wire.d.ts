// Written by tests/javascript/message_types.py from the lab's own models: change those, then run it again.

/** Sent on a timer: the page is alive, this is the current state of the hands. Not sent by lockstep clients. */
export interface Heartbeat {
  type: "heartbeat";
  seq: number;
  direction: [-1 | 0 | 1, -1 | 0 | 1, -1 | 0 | 1] | null;
  visible?: boolean;
  focused?: boolean;
  device?: "gamepad" | "keyboard" | "none";
}

/** First message on a socket. A second `hello` for the same session takes it over from the first tab. */
export interface Hello {
  type: "hello";
  protocol: number;
  client: string;
  telemetry?: boolean;
}

/**
 * What the hands do, sent on change. In lockstep, each one runs one tick.
 *
 * `direction` null means no input (hands off); [0, 0, 0] is not sent by the page.
 */
export interface Input {
  type: "input";
  seq: number;
  client_ms: number;
  direction: [-1 | 0 | 1, -1 | 0 | 1, -1 | 0 | 1] | null;
  gripper?: "open" | "close" | null;
}

/** Something the page noticed, to be logged as the event `page.NAME`: pad unplugged, view switched, page hidden. */
export interface Note {
  type: "note";
  id: string;
  name:
   
    | "hidden"
    | "visible"
    | "pad_plugged"
    | "pad_unplugged"
    | "view_switched"
    | "heartbeat_by_timer"
    | "message_dismissed"
    | "panel_later"
    | "panel_heard"
    | "received"
    | "in_step";
  data?: Record<string, unknown>;
}

/** Answer to a ping, for the round-trip time. */
export interface Pong {
  type: "pong";
  n: number;
}

/** A step of the study: a form, a button, an answer. Acknowledged by id once it is on disk. */
export interface Submit {
  type: "submit";
  id: string;
  step:
   
    | "eligibility"
    | "leave"
    | "consent"
    | "decline"
    | "demographics"
    | "setup"
    | "instructions"
    | "start"
    | "free_arm"
    | "survey"
    | "continue"
    | "resume"
    | "debrief"
    | "withdraw"
    | "help"
    | "picture"
    | "alert_shown"
    | "alert_heard"
    | "alert_answer";
  data?: Record<string, unknown>;
}

/** Switch the camera of the scene to a named view. */
export interface View {
  type: "view";
  name: string;
}

export type ClientMessage =
  | Hello
  | Input
  | Heartbeat
  | Submit
  | Note
  | View
  | Pong;

/** The submit or note with this id is on disk. */
export interface Ack {
  type: "ack";
  id: string;
}

/**
 * A stimulus of the second task, such as a sensor reading to be logged. `elapsed_s` is trial time since it was
 * raised (after a reload it is not 0).
 */
export interface Alert {
  type: "alert";
  alert: number;
  reading: string;
  elapsed_s: number;
  answer_within_s: number;
  away_min_s: number;
  prompt: string | null;
  entry: "text" | "number";
  choices: Array<AlertChoice>;
  right_answer: string | null;
}

/** One answer to choose. */
export interface AlertChoice {
  id: string;
  label: string;
  key: string;
}

/** The alert is over. `release_in_s` is how long the panel still covers the view (same_page_away). */
export interface AlertClosed {
  type: "alert_closed";
  alert: number;
  status: "answered" | "expired" | "trial_ended";
  release_in_s: number;
}

/**
 * A message was refused; the session goes on. `field` names what was wrong with it. After `too_many` the socket is
 * closed.
 */
export interface Error {
  type: "error";
  code: "malformed" | "invalid" | "out_of_order" | "illegal" | "too_large" | "too_many" | "protocol" | "internal";
  field: string | null;
  message: string;
  id: string | null;
}

/** What to do when the arm does not move; the page has the words. */
export interface Hint {
  cause: "touches" | "touches_closed" | "touches_holding" | "low" | "high" | "near" | "limit";
  ways: Array<"up" | "back" | "left" | "right" | "forward" | "down" | "open">;
}

/** The current task in words and ids; the page draws the picture from the ids. */
export interface Instruction {
  type: "instruction";
  text: string;
  kind: "pickup" | "dropoff" | "practice" | "reset";
  object: string | null;
  object_label: string | null;
  bin: string | null;
  bin_label: string | null;
}

/** A line from the experimenter, or about the session, to be shown to the participant. */
export interface Notice {
  type: "notice";
  text: string;
}

/** What the participant should see now. `content` holds what that state needs (see `study.flow.pages`). */
export interface Page {
  type: "page";
  state: string;
  trial: number | null;
  trials: number;
  content: Record<string, unknown>;
}

/** The second device, to the participant's page: at its start, and whenever something about it changes. */
export interface Panel {
  type: "panel";
  connected: boolean;
  heard: boolean | null;
}

/** Round-trip probe. */
export interface Ping {
  type: "ping";
  n: number;
  left: number | null;
}

/**
 * Whether the lab can save, whenever that changes. While it cannot, nothing is acknowledged and the robot stands
 * still; what was sent is dealt with when it can.
 */
export interface Saves {
  type: "saves";
  works: boolean;
  text: string | null;
}

/**
 * The robot is not running ticks, or runs again. `held` = this page's heartbeat is missing, or the lab cannot save
 * (see `saves`).
 */
export interface Status {
  type: "status";
  status: "starting" | "ready" | "running" | "paused" | "held" | "recovering";
  reason: string | null;
}

/** What the pages call a stimulus of the second task, such as `letter` and `letters`. */
export interface StimulusWords {
  one: string;
  many: string;
}

/** Another tab took this session over; this socket is about to close. */
export interface Superseded {
  type: "superseded";
}

/** A tick is on disk. `seq` acknowledges inputs. `assisting` is null unless the study shows who is driving. */
export interface Tick {
  type: "tick";
  tick: number;
  seq: number;
  status: "running" | "resetting" | "gripper" | "finished";
  instruction: Instruction;
  done_tasks: number;
  tasks: number;
  gripper: "open" | "closed" | "moving";
  holding: boolean;
  blocked: boolean;
  hint: Hint | null;
  assisting: boolean | null;
  notice: string | null;
  slipped: boolean;
  ending: "task" | "trial" | null;
}

/** First message of the lab on a socket. */
export interface Welcome {
  type: "welcome";
  protocol: number;
  role: "participant" | "panel";
  session: string;
  study_title: string;
  pace: "real_time" | "lockstep";
  tick_s: number;
  heartbeat_ms: number;
  placement: "second_device" | "same_page_away" | "none";
  show_assistance: boolean;
  last_seq: number;
  demo: boolean;
  words_limit: number;
  stimuli: StimulusWords | null;
}

/** What the scene shows, in numbers: positions in the world frame in metres. Sent before each `tick` on request. */
export interface World {
  type: "world";
  position_m: [number, number, number];
  held: string | null;
  gripper: "open" | "closed" | "moving";
  objects_m: Record<string, [number, number, number]>;
  bins_m: Record<string, [number, number, number]>;
}

export type ServerMessage =
  | Welcome
  | Page
  | Instruction
  | Tick
  | World
  | Status
  | Saves
  | Alert
  | AlertClosed
  | Panel
  | Ack
  | Error
  | Superseded
  | Notice
  | Ping;
