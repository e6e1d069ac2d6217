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
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, field_validator

PROTOCOL_VERSION = 1
MAX_MESSAGE_BYTES = 65_536

Axis = Literal[-1, 0, 1]
WireDirection = tuple[Axis, Axis, Axis]
Gripper = Literal["open", "close"]
Identifier = Annotated[str, Field(min_length=1, max_length=64, pattern=r"^[A-Za-z0-9._:-]+$")]
Sequence = Annotated[int, Field(ge=0, le=2**53, strict=True)]


class Message(BaseModel):
    """Base of all messages: unknown fields are an error, values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Hello(Message):
    """First message on a socket. A second `hello` for the same session takes it over from the first tab."""

    type: Literal["hello"] = "hello"
    protocol: int
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
    client_ms: Annotated[float, Field(strict=True)]
    direction: WireDirection | None
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
    visible: bool = True
    focused: bool = True
    device: Literal["gamepad", "keyboard", "none"] = "none"


class Submit(Message):
    """A step of the study: a form, a button, an answer. Acknowledged by id once it is on disk."""

    type: Literal["submit"] = "submit"
    id: Identifier
    step: Literal[
        "eligibility",
        "leave",
        "consent",
        "decline",
        "demographics",
        "setup",
        "instructions",
        "start",
        "survey",
        "continue",
        "resume",
        "debrief",
        "withdraw",
        "help",
        "alert_shown",
        "alert_heard",
        "alert_answer",
    ]
    data: dict[str, Any] = Field(default_factory=dict)


class Note(Message):
    """Something the page noticed, to be logged as an event: pad unplugged, view switched, page hidden."""

    type: Literal["note"] = "note"
    id: Identifier
    name: Identifier
    data: dict[str, str | int | float | bool | None] = Field(default_factory=dict)


class View(Message):
    """Switch the camera of the scene to a named view."""

    type: Literal["view"] = "view"
    name: Identifier


class Pong(Message):
    """Answer to a ping, for the round-trip time."""

    type: Literal["pong"] = "pong"
    n: Sequence


ClientMessage = Annotated[Hello | Input | Heartbeat | Submit | Note | View | Pong, Field(discriminator="type")]


class Welcome(Message):
    """First message of the lab on a socket."""

    type: Literal["welcome"] = "welcome"
    protocol: int = PROTOCOL_VERSION
    role: Literal["participant", "panel"]
    session: str
    study_title: str
    pace: Literal["real_time", "lockstep"]
    tick_s: float
    heartbeat_ms: int
    placement: Literal["second_device", "same_page_away", "none"]
    show_assistance: bool
    last_seq: int
    """Highest input sequence number the lab has seen; the page goes on from there."""
    demo: bool = False


class Page(Message):
    """What the participant should see now. `content` holds what that state needs (see `app.session.pages`)."""

    type: Literal["page"] = "page"
    state: str
    trial: int | None
    trials: int
    content: dict[str, Any]


class Instruction(Message):
    """The current task in words and ids; the page draws the picture from the ids."""

    type: Literal["instruction"] = "instruction"
    text: str
    kind: Literal["pickup", "dropoff", "practice", "reset"]
    object: str | None
    object_label: str | None
    bin: str | None
    bin_label: str | None


class Tick(Message):
    """A tick is on disk. `seq` acknowledges inputs. `assisting` is null unless the study shows who is driving."""

    type: Literal["tick"] = "tick"
    tick: int
    seq: int
    status: Literal["running", "resetting", "gripper", "finished"]
    instruction: Instruction
    done_tasks: int
    tasks: int
    gripper: Literal["open", "closed", "moving"]
    holding: bool
    blocked: bool
    assisting: bool | None = None
    notice: str | None = None
    """One line about the task that just ended, for the participant."""


class World(Message):
    """What the scene shows, in numbers: positions in the world frame in metres. Sent before each `tick` on request."""

    type: Literal["world"] = "world"
    position_m: tuple[float, float, float]
    held: str | None
    gripper: Literal["open", "closed", "moving"]
    objects_m: dict[str, tuple[float, float, float]]
    """Where the fingers would close around each object."""
    bins_m: dict[str, tuple[float, float, float]]
    """Where the gripper would let go above each bin."""


class Status(Message):
    """The robot is not running ticks, or runs again. `held` = this page's heartbeat is missing."""

    type: Literal["status"] = "status"
    status: Literal["starting", "ready", "running", "paused", "held", "recovering"]
    reason: str | None = None


class Alert(Message):
    """A sensor reading to be logged. `elapsed_s` is trial time since it was raised (after a reload it is not 0)."""

    type: Literal["alert"] = "alert"
    alert: int
    reading: str
    elapsed_s: float
    answer_within_s: float
    away_min_s: float


class AlertClosed(Message):
    """The alert is over. `release_in_s` is how long the panel still covers the view (same_page_away)."""

    type: Literal["alert_closed"] = "alert_closed"
    alert: int
    status: Literal["answered", "expired", "trial_ended"]
    release_in_s: float


class Ack(Message):
    """The submit or note with this id is on disk."""

    type: Literal["ack"] = "ack"
    id: str


class Error(Message):
    """A message was refused; the session goes on. `field` names what was wrong with it."""

    type: Literal["error"] = "error"
    code: Literal["malformed", "invalid", "out_of_order", "illegal", "too_large", "protocol", "internal"]
    field: str | None
    message: str
    id: str | None = None


class Superseded(Message):
    """Another tab took this session over; this socket is about to close."""

    type: Literal["superseded"] = "superseded"


class Notice(Message):
    """A line from the experimenter, or about the session, to be shown to the participant."""

    type: Literal["notice"] = "notice"
    text: str


class Ping(Message):
    """Round-trip probe."""

    type: Literal["ping"] = "ping"
    n: int
    left: int | None = None
    """How many more follow in a measurement; null for a single probe."""


ServerMessage = Annotated[
    Welcome
    | Page
    | Instruction
    | Tick
    | World
    | Status
    | Alert
    | AlertClosed
    | Ack
    | Error
    | Superseded
    | Notice
    | Ping,
    Field(discriminator="type"),
]

CLIENT_MESSAGE: TypeAdapter[ClientMessage] = TypeAdapter(ClientMessage)
SERVER_MESSAGE: TypeAdapter[ServerMessage] = TypeAdapter(ServerMessage)
