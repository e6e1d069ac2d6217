"""The wire between a participant's page (or a bot) and the lab: every message, typed.

The same models check what arrives and document the protocol (`/api/protocol` serves their schemas). A page speaks
`ClientMessage`, the lab speaks `ServerMessage`; both are JSON objects with a `type`. Nothing the lab sends carries the
condition, the belief or a score.

Every `submit` and `note` has an `id` chosen by the client. It is acknowledged when it is on disk; a client resends what
is unacknowledged, and the lab takes the same `id` once. An `input` is acknowledged by `tick.seq`: the last sequence
number that a committed tick took into account.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, create_model, field_validator

from study.flow.answers import MAX_TEXT_CHARACTERS
from study.flow.flow import FLOW, Flow
from study.flow.notes import NOTES, note_types
from study.flow.page import MAX_NOTE_CHARACTERS
from study.flow.steps import step_names

PROTOCOL_VERSION = 1
MAX_MESSAGE_BYTES = 65_536

Axis = Literal[-1, 0, 1]
WireDirection = tuple[Axis, Axis, Axis]
Gripper = Literal["open", "close"]
Identifier = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9._:-]+$")]
if TYPE_CHECKING:
    StepName: TypeAlias = str
    NoteName: TypeAlias = str
else:
    StepName = Literal[step_names()]
    NoteName = Literal[tuple(NOTES)]
Sequence = Annotated[int, Field(ge=0, le=2**53 - 1, strict=True)]


class Message(BaseModel):
    """Base of all messages: unknown fields are an error, values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Hello(Message):
    """First message on a socket. A second `hello` for the same session takes it over from the first tab."""

    type: Literal["hello"] = "hello"
    protocol: Sequence
    """The version the client speaks; any but the lab's is refused."""
    client: Identifier
    """Made by the tab, kept over a reload."""
    telemetry: bool = False
    """Ask for `world` messages: what the scene shows, in numbers, for clients that have no eyes."""


class Input(Message):
    """What the hands do, sent on change. In lockstep, each one runs one tick.

    `direction` null means no input (hands off); [0, 0, 0] is not sent by the page.
    """

    type: Literal["input"] = "input"
    seq: Sequence
    """Counts the inputs of a session upwards; the first of a socket follows `welcome.last_seq`."""
    client_ms: Annotated[float, Field(strict=True)]
    """When it happened by the client's own clock, in milliseconds; recorded, never compared with the lab's."""
    direction: WireDirection | None
    """x, y, z in the world frame; null is hands off."""
    gripper: Gripper | None = None
    """A press of a gripper button since the last message; the next tick acts on it once."""

    @field_validator("client_ms")
    @classmethod
    def _finite(cls, value: float) -> float:
        if not math.isfinite(value):
            raise ValueError("must be a finite number of milliseconds")
        return value


class Heartbeat(Message):
    """Sent on a timer: the page is alive, this is the current state of the hands. Not sent by lockstep clients."""

    type: Literal["heartbeat"] = "heartbeat"
    seq: Sequence
    """Sequence number of the last `input` sent."""
    direction: WireDirection | None
    """The direction held now: x, y, z in the world frame, null for hands off."""
    visible: bool = True
    """Whether the page is shown, not in a hidden tab."""
    focused: bool = True
    """Whether the page has the keyboard's focus."""
    device: Literal["gamepad", "keyboard", "none"] = "none"
    """What the hands are read from."""


class Submit(Message):
    """A step of the study: a form, a button, an answer. Acknowledged by id once it is on disk."""

    type: Literal["submit"] = "submit"
    id: Identifier
    """Chosen by the client, new for each submission, the same when it is resent."""
    step: StepName
    """Which step it is."""
    data: dict[str, Any] = Field(default_factory=dict)
    """What the step asks for; unknown keys are refused."""


class Note(Message):
    """Something the page noticed, to be logged as the event `page.NAME`: pad unplugged, view switched, page hidden."""

    type: Literal["note"] = "note"
    id: Identifier
    """Chosen by the client, new for each note, the same when it is resent."""
    name: NoteName
    """What was noticed."""
    data: dict[str, Any] = Field(default_factory=dict, max_length=MAX_NOTE_CHARACTERS // 10)
    """What the note holds; unknown keys are refused."""


class View(Message):
    """Switch the camera of the scene to a named view."""

    type: Literal["view"] = "view"
    name: Identifier
    """The view's name."""


class Pong(Message):
    """Answer to a ping, for the round-trip time."""

    type: Literal["pong"] = "pong"
    n: Sequence
    """The number of the ping it answers."""


ClientMessage = Annotated[Hello | Input | Heartbeat | Submit | Note | View | Pong, Field(discriminator="type")]


class StimulusWords(BaseModel):
    """What the pages call a stimulus of the second task, such as `letter` and `letters`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    one: str
    """A single one."""
    many: str
    """Several."""


class Welcome(Message):
    """First message of the lab on a socket."""

    type: Literal["welcome"] = "welcome"
    protocol: int = PROTOCOL_VERSION
    """The version the lab speaks."""
    role: Literal["participant", "panel"]
    """Whether this socket is the participant's page or the second device."""
    session: str
    """The id in the page's address, which is not the participant's."""
    study_title: str
    """The study's title, for the header."""
    pace: Literal["real_time", "lockstep"]
    """Whether ticks run by the clock or one for each input."""
    tick_s: float
    """Length of a tick in seconds."""
    heartbeat_ms: int
    """How often the page should send a heartbeat, in milliseconds."""
    placement: Literal["second_device", "same_page_away", "none"]
    """Where alerts are shown: on a second device, over the scene, or nowhere."""
    show_assistance: bool
    """Whether the page shows when the robot assists."""
    last_seq: int
    """Highest input sequence number the lab has seen; the page goes on from there."""
    demo: bool = False
    """Whether this is a demo, which no study counts."""
    words_limit: int = MAX_TEXT_CHARACTERS
    """How many characters free words may have, in answers and in what is said to the experimenter."""
    stimuli: StimulusWords | None = None
    """What the second task calls what it shows; null: readings."""


class Page(Message):
    """What the participant should see now. `content` holds what that state needs (see `study.flow.pages`)."""

    type: Literal["page"] = "page"
    state: str
    """The state of the session, which chooses the view."""
    trial: int | None
    """The trial it belongs to, from 1; null for a page of no trial."""
    trials: int
    """How many trials the session has."""
    content: dict[str, Any]
    """What the view needs, by name."""


class Instruction(Message):
    """The current task in words and ids; the page draws the picture from the ids."""

    type: Literal["instruction"] = "instruction"
    text: str
    """The task as a sentence."""
    kind: Literal["pickup", "dropoff", "practice", "reset"]
    """What is to be done, or that the robot resets or this is practice."""
    object: str | None
    """Id of the object; null where there is none."""
    object_label: str | None
    """The object in words."""
    bin: str | None
    """Id of the bin; null where there is none."""
    bin_label: str | None
    """The bin in words."""


class Hint(BaseModel):
    """What to do when the arm does not move; the page has the words."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    cause: Literal["touches", "touches_closed", "touches_holding", "low", "high", "near", "limit"]
    """Something is in the way, of an open gripper, a closed one or one that holds something; or the gripper is as low,
    as high or as near to the robot as it goes, or the arm reaches no further."""
    ways: tuple[Literal["up", "back", "left", "right", "forward", "down", "open"], ...]
    """What leads out, one after the other: directions as the person sees them, or to open the gripper."""


class Tick(Message):
    """A tick is on disk. `seq` acknowledges inputs. `assisting` is null unless the study shows who is driving."""

    type: Literal["tick"] = "tick"
    tick: int
    """Number of the tick in this practice or trial."""
    seq: int
    """The last `input` that a committed tick took into account."""
    status: Literal["running", "resetting", "gripper", "finished"]
    """What the robot does: obey, drive back to its start, move its fingers, or nothing any more."""
    instruction: Instruction
    """The current task."""
    done_tasks: int
    """Tasks that have ended."""
    tasks: int
    """Tasks there are in all."""
    gripper: Literal["open", "closed", "moving"]
    """What the fingers do."""
    holding: bool
    """Whether an object is in the gripper."""
    blocked: bool
    """Whether the arm could not go where it was sent."""
    hint: Hint | None = None
    """What to do about it; null when it was not blocked."""
    assisting: bool | None = None
    """Whether the robot acted beyond the input; null unless the study shows it."""
    notice: str | None = None
    """One line about the task that just ended, what slipped, or the freed arm, for the participant."""
    slipped: bool = False
    """Whether what was held has slipped out of the gripper, which nobody had opened."""
    ending: Literal["task", "trial"] | None = None
    """Whose time is nearly over, in its last minute at most; null for neither. What follows comes by itself."""


class World(Message):
    """What the scene shows, in numbers: positions in the world frame in metres. Sent before each `tick` on request."""

    type: Literal["world"] = "world"
    position_m: tuple[float, float, float]
    """The gripper."""
    held: str | None
    """Id of the object in the gripper; null for none."""
    gripper: Literal["open", "closed", "moving"]
    """What the fingers do."""
    objects_m: dict[str, tuple[float, float, float]]
    """Where the fingers would close around each object."""
    bins_m: dict[str, tuple[float, float, float]]
    """Where the gripper would let go above each bin."""


class Status(Message):
    """The robot is not running ticks, or runs again. `held` = this page's heartbeat is missing, or the lab cannot save
    (see `saves`)."""

    type: Literal["status"] = "status"
    status: Literal["starting", "ready", "running", "paused", "held", "recovering"]
    """What the robot does now."""
    reason: str | None = None
    """Why, in words for the participant; null for none."""


class Saves(Message):
    """Whether the lab can save, whenever that changes. While it cannot, nothing is acknowledged and the robot stands
    still; what was sent is dealt with when it can."""

    type: Literal["saves"] = "saves"
    works: bool
    """Whether it can."""
    text: str | None = None
    """What to do meanwhile, in words for the participant; null when it can."""


class AlertChoice(BaseModel):
    """One answer to choose."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: str
    """What is submitted when it is chosen."""
    label: str
    """What stands on its button."""
    key: str
    """The key that chooses it: one character."""


class Alert(Message):
    """A stimulus of the second task, such as a sensor reading to be logged. `elapsed_s` is trial time since it was
    raised (after a reload it is not 0)."""

    type: Literal["alert"] = "alert"
    alert: int
    """Number of the alert, to be named in answers."""
    reading: str
    """What is shown: of the readings, the number to be typed in."""
    elapsed_s: float
    """Trial time since it was raised, in seconds."""
    answer_within_s: float
    """Trial time after which it expires, in seconds."""
    away_min_s: float
    """How long the view stays covered at least, in seconds (same_page_away)."""
    prompt: str | None = None
    """What to do with it, in words; null: what readings ask for."""
    entry: Literal["text", "number"] = "text"
    """What is typed: of a number, nothing else is taken."""
    choices: tuple[AlertChoice, ...] = ()
    """The answers to choose from; empty: the answer is typed."""
    right_answer: str | None = None
    """For scripted clients alone: in lockstep, to a page that asked for telemetry. Null for everybody else."""


class AlertClosed(Message):
    """The alert is over. `release_in_s` is how long the panel still covers the view (same_page_away)."""

    type: Literal["alert_closed"] = "alert_closed"
    alert: int
    """Number of the alert."""
    status: Literal["answered", "expired", "trial_ended"]
    """What became of it."""
    release_in_s: float
    """Seconds until the view is free again."""


class Panel(Message):
    """The second device, to the participant's page: at its start, and whenever something about it changes."""

    type: Literal["panel"] = "panel"
    connected: bool
    """Whether its page is there."""
    heard: bool | None
    """Whether its alarm was heard; null before somebody said so."""


class Ack(Message):
    """The submit or note with this id is on disk."""

    type: Literal["ack"] = "ack"
    id: str
    """The `id` of the submit or note."""


class Error(Message):
    """A message was refused; the session goes on. `field` names what was wrong with it. After `too_many` the socket is
    closed."""

    type: Literal["error"] = "error"
    code: Literal["malformed", "invalid", "out_of_order", "illegal", "too_large", "too_many", "protocol", "internal"]
    """What kind of mistake it is."""
    field: str | None
    """The place of the mistake, such as `data.hash`; null for the message as a whole."""
    message: str
    """What is wrong, in words."""
    id: str | None = None
    """The `id` of the refused submit or note; null for other messages."""


class Superseded(Message):
    """Another tab took this session over; this socket is about to close."""

    type: Literal["superseded"] = "superseded"


class Notice(Message):
    """A line from the experimenter, or about the session, to be shown to the participant."""

    type: Literal["notice"] = "notice"
    text: str
    """The line."""


class Ping(Message):
    """Round-trip probe."""

    type: Literal["ping"] = "ping"
    n: int
    """A number to be sent back in `pong`."""
    left: int | None = None
    """How many more follow in a measurement; null for a single probe."""


ServerMessage = Annotated[
    Welcome
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
    | Ping,
    Field(discriminator="type"),
]

CLIENT_MESSAGE: TypeAdapter[ClientMessage] = TypeAdapter(ClientMessage)
SERVER_MESSAGE: TypeAdapter[ServerMessage] = TypeAdapter(ServerMessage)


def submit_type(flow: Flow) -> type[Submit]:
    """`Submit` for a flow: its steps and no others."""
    if flow is FLOW:
        return Submit
    step: Any = Literal[step_names(flow)]
    return create_model("Submit", __base__=Submit, step=(step, ...))


def note_type(flow: Flow) -> type[Note]:
    """`Note` for a flow: the notes of its pages and no others."""
    name: Any = Literal[tuple(note_types(flow))]
    return create_model("Note", __base__=Note, name=(name, ...))


def client_message(flow: Flow) -> TypeAdapter[ClientMessage]:
    """`CLIENT_MESSAGE` for a flow."""
    if flow is FLOW:
        return CLIENT_MESSAGE
    submit: Any = submit_type(flow)
    note: Any = note_type(flow)
    either: Any = Hello | Input | Heartbeat | submit | note | View | Pong
    return TypeAdapter(Annotated[either, Field(discriminator="type")])
