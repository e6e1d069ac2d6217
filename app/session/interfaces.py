"""What a live session is given and what it talks to: values and interfaces, no behaviour."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from app.clock import SteadyClock
from app.config import LabConfig, Pace
from app.monitoring.metrics import Metrics
from app.processes import VitalSigns
from app.trial.labels import Labels
from app.wire import Message
from app.worker.messages import WorkerCommand, WorkerReport, WorkerSpec
from study.definition.study import SessionPlan, Study
from study.flow.distractors.interface import Distractor
from study.flow.distractors.state import DistractorState
from study.flow.flow import FLOW, Flow
from study.flow.protocol import WorkerKind
from study.records import EventRow, TrialRow, utc_text
from study.store import AsyncStore

Role = Literal["participant", "panel"]
Freer = Literal["participant", "experimenter"]
"""Who can free the arm."""


class Client(Protocol):
    """A connected page or bot, as the session sees it."""

    role: Role
    name: str
    """Made by the tab."""
    telemetry: bool
    """Whether it asked for what the scene shows in numbers."""

    @property
    def waiting(self) -> int:
        """How many messages have not been sent yet."""

    def deliver(self, message: Message) -> None:
        """Queue a message for the page; never blocks."""

    def end(self) -> None:
        """Close the connection after what is queued has been sent."""


class WorkerHandle(Protocol):
    """A live worker, as the session sees it."""

    def send(self, command: WorkerCommand) -> None:
        """Hand over a command."""

    async def stop(self) -> None:
        """End it and wait for it."""

    def kill(self) -> None:
        """End it at once; its exit is reported."""

    def vital_signs(self) -> VitalSigns | None:
        """What the machine says of its process; None where it says nothing."""


@dataclass(frozen=True)
class Enrolment:
    """What is fixed about a participant from the start."""

    participant: str
    public_id: str
    plan: SessionPlan
    pace: Pace
    demo: bool
    ids: Mapping[str, str] = field(default_factory=dict)
    """The ids of the open link they came over, by parameter."""


@dataclass(frozen=True)
class HelpCall:
    """A participant's call for help: what they typed, if anything, and when."""

    words: str
    since_utc: str


@dataclass(frozen=True)
class Resumed:
    """Where a stored session stood: its distractor, the last tick of the phase, the last input's number."""

    distractor: DistractorState
    tick: int | None = None
    last_seq: int = 0
    overruns: int = 0
    frees: int = 0
    freed_by: Freer | None = None
    """Who has asked to free the arm, if no tick has done it."""
    sound: bool | None = None
    help_wanted: HelpCall | None = None
    events: tuple[EventRow, ...] = ()
    """The last ones."""
    last_unix_s: float = 0.0
    """The last time in the record."""


@dataclass
class Vitals:
    """What the experimenter sees of a session besides its state."""

    round_trip_ms: float | None = None
    visible: bool | None = None
    focused: bool | None = None
    device: str | None = None
    overruns: int = 0
    frees: int = 0
    """How often the arm was freed in this practice or trial."""
    help: HelpCall | None = None
    """The participant's call that nobody has answered."""
    sound: bool | None = None
    """Whether the participant heard the test sound; None before they were asked."""
    panel_heard: bool | None = None
    """Whether the second device's alarm was heard, as somebody said there; None before."""
    picture: bool | None = None
    """Whether their page draws the robot; None before it said so."""


@dataclass(frozen=True)
class LabServices:
    """What a live session needs of the lab it lives in."""

    store: AsyncStore
    study: Study
    distractor: Distractor[Any]
    """The study's second task."""
    config: LabConfig
    labels: Labels
    start_worker: Callable[[WorkerSpec, Callable[[WorkerReport], None], Callable[[], None]], Awaitable[WorkerHandle]]
    """(spec, on report, on exit) -> a started worker. Raises when this machine cannot start one now."""
    make_spec: Callable[[WorkerKind, int], Awaitable[WorkerSpec | None]]
    """(kind, trial) -> a worker's spec, with the log of the current cycle."""
    trial_row: Callable[[int], TrialRow]
    """trial -> its row as it begins."""
    panel_link: Callable[[], Awaitable[str]]
    """A link for the second device."""
    clock: SteadyClock
    """The session's own: its times never go back."""
    ran_on: Mapping[str, str] = field(default_factory=dict)
    """Which robot runs the trials and which machine it is, for the record."""
    changed: Callable[[str], None] = lambda participant: None
    """Told whenever something about the session may have changed."""
    flow: Flow = FLOW
    """The participant's pages."""
    metrics: Metrics = field(default_factory=Metrics)
    """What is counted and measured."""
    may_begin: Callable[[], bool] = lambda: True
    """Whether a worker may begin: not while what all of them need is being made ready."""
    start_allowance_s: float = 0.0
    """How much longer than usual a worker may take to its first sign of life, in seconds."""

    def now_unix_s(self) -> float:
        """The time by the session's clock."""
        return self.clock.now_unix_s()

    def now_utc(self) -> str:
        """The time as it is recorded."""
        return utc_text(self.now_unix_s())
