"""What a trial depends on and what a tick of it leaves behind: frozen values, picklable, and their way to text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from app.autonomy.actions import Direction
from app.autonomy.interface import Models
from app.trial.hints import Hint
from app.trial.verdicts import Verdict
from sim.interface import Pose, SceneSpec, Vector3
from study.parts.shelf import Named
from study.records import TaskRow, TickRow

PhaseKind = Literal["trial", "practice"]
STILL: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class UserInput:
    """What the person did for one tick. `direction` None = hands off; `after_pause` = the tick follows a pause."""

    direction: Direction | None = None
    gripper: Literal["open", "close"] | None = None
    seq: int | None = None
    after_pause: bool = False


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


@dataclass(frozen=True)
class CycleStart:
    """Where to take a trial up again: the cycle (from 1), its first tick, what lies in the bins already, and what the
    arbiter and the inference remember, as JSON; "" before they were first made."""

    cycle: int = 1
    first_tick: int = 0
    delivered: tuple[tuple[str, Pose], ...] = ()
    arbiter_memory: str = ""
    inference_memory: str = ""


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


@dataclass(frozen=True)
class TickResult:
    """What one tick left behind. `cycle_start` is set on the last tick before a new cycle."""

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
    gripper: Literal["open", "close"] | None = None
    if row.gripper_input == "open":
        gripper = "open"
    elif row.gripper_input == "close":
        gripper = "close"
    return UserInput(direction, gripper, row.input_seq, bool(row.after_pause))


def cycle_to_json(start: CycleStart) -> str:
    """The start of a cycle as one line of JSON."""
    delivered = [[name, pose.position_world_m, pose.quaternion_wxyz] for name, pose in start.delivered]
    fields = {"cycle": start.cycle, "first_tick": start.first_tick, "delivered": delivered}
    memories = {name: getattr(start, name) for name in _MEMORIES if getattr(start, name) not in ("", "null")}
    return json.dumps({**fields, **memories})


def cycle_from_json(text: str) -> CycleStart:
    """The start of `cycle_to_json`."""
    fields: dict[str, Any] = json.loads(text)
    delivered = tuple((name, Pose(tuple(position), tuple(wxyz))) for name, position, wxyz in fields["delivered"])
    memories = {name: fields.get(name, "") for name in _MEMORIES}
    return CycleStart(fields["cycle"], fields["first_tick"], delivered, **memories)


_MEMORIES = ("arbiter_memory", "inference_memory")
