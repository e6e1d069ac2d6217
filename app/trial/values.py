"""What a trial depends on and what a tick of it leaves behind: frozen values, picklable, and their way to text."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from app.autonomy.actions import Direction
from app.autonomy.interface import Models
from app.trial.hints import Hint
from app.trial.verdicts import Verdict
from sim.interface import Pose, SceneSpec, Vector3
from study.parts.shelf import Named
from study.records import TaskRow, TickRow

PhaseKind = Literal["trial", "practice"]
Press = Literal["open", "close"]
"""Of a gripper button."""
STILL: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class UserInput:
    """What the person did for one tick. `direction` None = hands off; `after_pause` = the tick follows a pause;
    `free` = somebody frees the arm, and the cycle begins again with this tick."""

    direction: Direction | None = None
    gripper: Press | None = None
    seq: int | None = None
    after_pause: bool = False
    free: bool = False


NO_INPUT = UserInput()
BOLTZMANN = Named("inference", "boltzmann", {})


@dataclass(frozen=True)
class RobotTiming:
    """How the arm moves and how long things take; defaults as in the study file."""

    speed_m_s: float = 0.04
    gripper_ticks: int = 2
    settle_timeout_ticks: int = 12
    reset_ticks: int = 4


@dataclass(frozen=True)
class TimeLimits:
    """How many ticks a task and a trial may take, all attempts together; 0 = as many as they need."""

    task_ticks: int = 0
    trial_ticks: int = 0


@dataclass(frozen=True)
class CycleSetup:
    """One pick-and-place: its scene (what is still on the table), the instructed object and bin."""

    scene: SceneSpec
    object: str
    bin: str | None
    """None in practice: the object is put down anywhere else."""


@dataclass(frozen=True)
class TrialSetup:
    """Everything a trial depends on besides the inputs."""

    participant: str
    trial: int
    condition: str
    kind: PhaseKind
    cycles: tuple[CycleSetup, ...]
    arbiter: Named
    inference: Named = BOLTZMANN
    models: Models = field(default_factory=Models)
    timing: RobotTiming = field(default_factory=RobotTiming)
    limits: TimeLimits = field(default_factory=TimeLimits)
    keep_way_on: bool = False
    """Whether the arm, with the hands off, keeps to where it can go on from (`app.trial.way_on`)."""


@dataclass(frozen=True)
class TaskSpan:
    """The ticks of one task so far, over all attempts of its cycle: the first, the last, and how many."""

    first_tick: int | None = None
    last_tick: int | None = None
    ticks: int = 0

    def and_then(self, first_tick: int, last_tick: int) -> TaskSpan:
        """With the ticks of one attempt more."""
        first = first_tick if self.first_tick is None else self.first_tick
        return TaskSpan(first, last_tick, self.ticks + last_tick - first_tick + 1)


@dataclass(frozen=True)
class CycleStart:
    """Where to take a trial up again: the cycle (from 1), its first tick, what lies in the bins already, and what the
    arbiter and the inference remember, as JSON; "" before they were first made.

    `attempt` is how often the cycle has been begun; after the first, `first_tick` is the one that freed the arm, and
    `pickup` and `dropoff` hold what the attempts before have taken. `counted_from` is the tick from which the trial's
    time limit counts.
    """

    cycle: int = 1
    first_tick: int = 0
    delivered: tuple[tuple[str, Pose], ...] = ()
    arbiter_memory: str = ""
    inference_memory: str = ""
    attempt: int = 1
    pickup: TaskSpan = TaskSpan()
    dropoff: TaskSpan = TaskSpan()
    counted_from: int = 0

    def again(self, first_tick: int, pickup: TaskSpan, dropoff: TaskSpan) -> CycleStart:
        """Another attempt, from that tick on; the spans are those of the tasks so far."""
        return replace(self, first_tick=first_tick, attempt=self.attempt + 1, pickup=pickup, dropoff=dropoff)

    def repeated(self, cycle: int, first_tick: int) -> CycleStart:
        """Practice once more, in another cycle from that tick on: as if nothing had been before."""
        return CycleStart(cycle, first_tick, counted_from=first_tick)

    def after(self, rows: Sequence[TickRow]) -> CycleStart:
        """Another attempt after this one, whose ticks these rows are."""
        spans = {"pickup": self.pickup, "dropoff": self.dropoff}
        for row in rows:
            if row.kind is not None:
                spans[row.kind] = spans[row.kind].and_then(row.tick, row.tick)
        return self.again(rows[-1].tick + 1 if rows else self.first_tick, **spans)


@dataclass(frozen=True)
class EngineEvent:
    """Something worth a line in the event log."""

    kind: str
    data: Mapping[str, Any]


@dataclass(frozen=True)
class TrialView:
    """What a page may show of the trial. `source` must not reach a participant unless the study says so."""

    phase: Literal["operating", "gripper", "settling", "reset", "finished"]
    kind: Literal["pickup", "dropoff"]
    object: str
    bin: str | None
    done_tasks: int
    tasks: int
    gripper: str
    holding: bool
    blocked: bool
    source: str
    ended: Verdict | None
    """Verdict of the task that ended in this tick."""
    hint: Hint | None = None
    """What to do, when the arm does not move."""
    ending: Literal["task", "trial"] | None = None
    """Whose time limit is near; None = neither."""


@dataclass(frozen=True)
class TickResult:
    """What one tick left behind. `cycle_start` is set on the last tick before a new cycle, and on the first of another
    attempt."""

    row: TickRow
    tasks: tuple[TaskRow, ...]
    events: tuple[EngineEvent, ...]
    view: TrialView
    cycle_start: CycleStart | None
    finished: bool


def inputs_of(row: TickRow) -> UserInput:
    """The input a logged tick took into account, for re-running it."""
    direction = None
    if row.user_x is not None and row.user_y is not None and row.user_z is not None:
        direction = (row.user_x, row.user_y, row.user_z)
    gripper: Press | None = None
    if row.gripper_input == "open":
        gripper = "open"
    elif row.gripper_input == "close":
        gripper = "close"
    return UserInput(direction, gripper, row.input_seq, bool(row.after_pause), row.source == "free")


def cycle_to_json(start: CycleStart) -> str:
    """The start of a cycle as one line of JSON."""
    delivered = [[name, pose.position_world_m, pose.quaternion_wxyz] for name, pose in start.delivered]
    fields = {"cycle": start.cycle, "first_tick": start.first_tick, "delivered": delivered}
    memories = {name: getattr(start, name) for name in _MEMORIES if getattr(start, name) not in ("", "null")}
    again = {name: getattr(start, name) for name in _COUNTS if getattr(start, name) != getattr(CycleStart(), name)}
    spans = {name: vars(getattr(start, name)) for name in _SPANS if getattr(start, name) != TaskSpan()}
    return json.dumps({**fields, **memories, **again, **spans})


def cycle_from_json(text: str) -> CycleStart:
    """The start of `cycle_to_json`."""
    fields: dict[str, Any] = json.loads(text)
    delivered = tuple((name, Pose(tuple(position), tuple(wxyz))) for name, position, wxyz in fields["delivered"])
    memories = {name: fields.get(name, "") for name in _MEMORIES}
    again: dict[str, Any] = {name: fields[name] for name in _COUNTS if name in fields}
    again |= {name: TaskSpan(**fields[name]) for name in _SPANS if name in fields}
    return CycleStart(fields["cycle"], fields["first_tick"], delivered, **memories, **again)


_MEMORIES = ("arbiter_memory", "inference_memory")
_COUNTS = ("attempt", "counted_from")
_SPANS = ("pickup", "dropoff")
