"""What passes between the lab and a session's worker process: the narrow interface, as plain frozen values.

The lab never touches a robot or a scene, the worker never touches a socket or a database. Values are picklable, so the
same worker could run on another machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from app.autonomy.interface import Explanation
from app.config import Pace
from app.monitoring.log_lines import LogFormat
from app.trial.values import CycleStart, TickResult, TrialSetup, TrialView, UserInput
from sim.interface import GripperState, Vector3
from study.definition.sections import ViewSettings
from study.records import OVERRUN_MS


@dataclass(frozen=True)
class WorkerSpec:
    """Everything a worker is started with.

    `log` holds the inputs of the current cycle that are already on disk, with the digests they led to: the worker
    re-runs them before it reports ready.
    """

    setup: TrialSetup
    start: CycleStart
    log: tuple[tuple[UserInput, str], ...]
    robot: str
    pace: Pace
    scene: bool
    heartbeat_timeout_s: float
    view: ViewSettings = field(default_factory=ViewSettings)
    """What the scene shows of depth."""
    clock_offset_s: float = 0.0
    """What makes the session's time of the monotonic clock, which all processes of this machine share."""
    log_format: LogFormat = "text"
    """What the lines of the process's log are."""


# ---- lab → worker -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Begin:
    """Run ticks from now on (also after a pause)."""


@dataclass(frozen=True)
class Hold:
    """Run no ticks until the next `Begin`; the tick that is running is finished first."""


@dataclass(frozen=True)
class ControlsState:
    """State of the hands, from an input (`pressed` may hold a gripper press) or a heartbeat."""

    seq: int
    direction: tuple[int, int, int] | None
    pressed: Literal["open", "close"] | None = None
    beat: bool = False
    """True for a heartbeat: in lockstep it runs no tick."""


@dataclass(frozen=True)
class Free:
    """Free the arm: the cycle begins again with the next tick, whatever the hands do."""


@dataclass(frozen=True)
class SetView:
    """Switch the camera."""

    name: str


@dataclass(frozen=True)
class Spectate:
    """Whether experimenters look on: their 3-D view is there as long as they do. Answered by `SpectatorPort`."""

    looking: bool


@dataclass(frozen=True)
class Stop:
    """End the process."""


WorkerCommand = Begin | Hold | ControlsState | Free | SetView | Spectate | Stop


# ---- worker → lab -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class WorldInNumbers:
    """What the scene shows, in numbers; positions in the world frame, metres."""

    position_m: Vector3
    held: str | None
    gripper: GripperState
    objects_m: Mapping[str, Vector3]
    bins_m: Mapping[str, Vector3]


@dataclass(frozen=True)
class Alive:
    """A sign of life of a worker that has nothing else to say: it does not hang."""


@dataclass(frozen=True)
class Ready:
    """The world stands and the log is re-run. `mismatch` is the first re-run tick whose digest differed, if any."""

    scene_port: int | None
    view: TrialView
    world: WorldInNumbers
    finished: bool
    mismatch: int | None
    look: Mapping[str, str] = field(default_factory=dict)
    """Which look of the robot the scene shows, for the record; nothing without a scene."""
    look_note: str = ""
    """Why that is not the one that the study says; "" when it is."""


@dataclass(frozen=True)
class Ticked:
    """A tick is over: when it started and how it kept its deadline (`late_ms` is None in lockstep)."""

    result: TickResult
    world: WorldInNumbers
    seq: int
    started_unix_s: float
    late_ms: float | None
    missed: int
    explanation: Explanation = field(default_factory=dict)
    """What the arbiter says of its action; empty where it chose none."""
    freeing: bool = False
    """Whether the arm was to be freed with this tick; one that went back already was not."""

    @property
    def overrun(self) -> bool:
        """Whether the tick is late enough to be logged: by itself, or since deadlines before it were missed."""
        return self.missed > 0 or (self.late_ms or 0.0) > OVERRUN_MS


@dataclass(frozen=True)
class HoldChanged:
    """The page's heartbeat went missing (held) or came back."""

    held: bool


@dataclass(frozen=True)
class SpectatorPort:
    """The experimenters' view has opened or closed: the port of its viser server; None when there is none."""

    port: int | None


@dataclass(frozen=True)
class Asking:
    """A part that does not ship is about to be made or asked; a worker that says nothing for `within_s` hangs in it. An
    empty `part`: it has answered."""

    part: str
    within_s: float


@dataclass(frozen=True)
class PartFailed:
    """The trial's arbiter or inference did what cannot be used (`part`, `reason`). The tick it was asked for did not
    happen; the worker ends."""

    part: str
    reason: str


@dataclass(frozen=True)
class Failed:
    """The worker cannot go on; it ends."""

    reason: str


WorkerReport = Alive | Ready | Ticked | HoldChanged | SpectatorPort | Asking | PartFailed | Failed
