"""What can be said of a participant's way through the study: states, events, the session, and what the lab has to do.

Values only. What leads from where to where follows from the pages (`study.flow.pages`), and `study.flow.flow` does it.
Four states have a robot (`NEEDS`), five are ends (`TERMINAL`), and `paused` remembers where to go on (`resume_to`) and
why it stands still (`causes`); it ends when no cause is left.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias, Union, get_args

from study.records import StudyError

State: TypeAlias = str
"""Where a session is: the name of a page (`study.flow.page.FlowPage.state`)."""
EventName: TypeAlias = str
"""What can happen to a session: a name that pages lead on with, or one of those that are the same everywhere."""
Cause = Literal["connection", "experimenter", "fault", "picture"]
Outcome = Literal["done", "declined", "withdrawn", "aborted", "screened_out", "lapsed"]
WorkerKind = Literal["practice", "trial"]

CAUSES: tuple[Cause, ...] = get_args(Cause)
PAUSED: State = "paused"
TERMINAL: frozenset[State] = frozenset({"done", "withdrawn", "aborted", "screened_out", "lapsed"})
FREES_CELL: frozenset[State] = TERMINAL - {"done"}
"""Ends at which the cell of the counterbalancing is given out again."""


class IllegalEvent(StudyError):
    """An event that has no meaning in the session's state."""

    def __init__(self, session: Session, event: EventName, allowed: tuple[EventName, ...]) -> None:
        self.state = session.state
        self.event = event
        self.allowed = allowed
        choices = ", ".join(allowed) or "none, the session is over"
        super().__init__(f"event {event!r} is not allowed in state {session.state!r}; allowed: {choices}")


@dataclass(frozen=True)
class Event:
    """Something that happened. `reason` is kept with `screened_out`, `place_lapsed`, `withdraw`, `abort`,
    `part_failed`, `picture_lost` and `experimenter_pause`."""

    name: EventName
    reason: str | None = None


@dataclass(frozen=True)
class StartWorker:
    """Bring a worker up for this phase of this trial, robot visible, no ticks yet."""

    kind: WorkerKind
    trial: int


@dataclass(frozen=True)
class BeginTicks:
    """The participant pressed Start: run ticks from the first one."""


@dataclass(frozen=True)
class PauseTicks:
    """Run no more ticks; the world stays as it is."""


@dataclass(frozen=True)
class ResumeTicks:
    """Go on with the tick after the last one."""


@dataclass(frozen=True)
class StopWorker:
    """The phase is over: end the worker."""


@dataclass(frozen=True)
class Finish:
    """The session is over and its record can be closed."""

    outcome: Outcome


Effect = Union[StartWorker, BeginTicks, PauseTicks, ResumeTicks, StopWorker, Finish]  # noqa: UP007 - run time on 3.10


@dataclass(frozen=True)
class Session:
    """Where one participant is. `trial` counts from 1 to `trials` and is 1 before the first.

    `since_s` is the `now_s` at which the state was entered, by the clock of whoever advances it.
    """

    participant: str
    trials: int
    state: State = "consent"
    trial: int = 1
    resume_to: State | None = None
    causes: frozenset[Cause] = frozenset()
    skips: frozenset[State] = frozenset()
    outcome: Outcome | None = None
    reason: str | None = None
    since_s: float = 0.0

    @property
    def is_over(self) -> bool:
        """Whether nothing can happen any more."""
        return self.state in TERMINAL

    @property
    def place(self) -> State:
        """The state, or while paused the one that will be resumed."""
        return self.resume_to if self.state == PAUSED and self.resume_to else self.state

    @property
    def worker(self) -> tuple[WorkerKind, int] | None:
        """The worker this session needs now, as (kind, trial); a paused one is kept."""
        kind = NEEDS.get(self.place, (None, False))[0]
        return (kind, self.trial) if kind else None

    @property
    def is_ticking(self) -> bool:
        """Whether ticks run now."""
        return NEEDS.get(self.state, (None, False))[1]


NEEDS: Mapping[State, tuple[WorkerKind | None, bool]] = {
    "practice_ready": ("practice", False),
    "practice": ("practice", True),
    "trial_ready": ("trial", False),
    "trial": ("trial", True),
}
"""The worker a state needs and whether it ticks. States that are not here need none."""
DRIVEN: tuple[State, ...] = tuple(state for state, (_, ticks) in NEEDS.items() if ticks)
"""Places in which somebody drives the robot, or would if it were not paused."""

PAUSE_EVENTS: tuple[EventName, ...] = (
    "connection_lost",
    "picture_lost",
    "picture_back",
    "part_failed",
    "resume",
    "experimenter_pause",
    "experimenter_resume",
)
"""What begins and ends pauses, in the order in which it is told."""
CLEARS: Mapping[EventName, frozenset[Cause]] = {
    "resume": frozenset({"connection", "fault"}),
    "experimenter_resume": frozenset({"experimenter", "fault", "picture"}),
    "picture_back": frozenset({"picture"}),
}
"""What ends a pause, and the causes it takes away. A fault is nobody's doing: whoever is there may try again. A picture
that is there again ends its own pause; where nobody tells of it, the experimenter does."""
OF_THE_ROBOT: frozenset[Cause] = frozenset({"connection", "fault", "picture"})
"""Causes that end where no robot is needed: a form can be shown whenever the page is back."""


@dataclass(frozen=True)
class Ending:
    """An end before its time: the state the session is in then, and its outcome."""

    state: State
    outcome: Outcome


LAPSE = Ending("lapsed", "lapsed")
"""What becomes of somebody who left before they agreed to take part, and did not come back in time. Nothing of a study
has happened by then: whoever does come back begins anew, if there is a place."""
ENDS_ANYWHERE: Mapping[EventName, Ending] = {
    "withdraw": Ending("withdrawn", "withdrawn"),
    "abort": Ending("aborted", "aborted"),
}
"""What ends a session wherever it is."""
ANYWHERE: tuple[EventName, ...] = ("connection_lost", "picture_lost", "experimenter_pause", *ENDS_ANYWHERE)
"""Allowed in every state that is not terminal. A lost connection, or a lost picture of the robot, pauses what ticks and
changes nothing elsewhere.
`part_failed`, of an arbiter or an inference that cannot be used, or of a disk that did not do, pauses wherever there is
a robot."""


def to_json(session: Session) -> str:
    """The session as one line of JSON, for the store."""
    fields = {**vars(session), "causes": sorted(session.causes), "skips": sorted(session.skips)}
    return json.dumps(fields, sort_keys=True)
