"""What the store hands out, and its error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from study.flow.protocol import Session
from study.flow.roster import EnrolmentKind
from study.records import AlertRow, EventRow, StudyError, SurveyAnswerRow, TaskRow, TickRow, TrialRow


class StoreError(StudyError):
    """The database cannot be opened or refuses a write; one line that says which file and why.

    `exit_status` is how a command ends that meets it.
    """

    exit_status = 1


@dataclass(frozen=True)
class StoredSession:
    """A participant as the lab knows them."""

    participant: str
    public_id: str
    session: Session
    order: tuple[str, ...]
    kind: EnrolmentKind
    pace: str
    study_hash: str
    seed: int
    created_utc: str
    rejected: bool

    @property
    def demo(self) -> bool:
        """Whether this is a visitor who tries the study, not somebody of whom data are wanted."""
        return self.kind == "demo"


@dataclass(frozen=True)
class UnreadableSession:
    """A participant of whom the lab knows nothing but this: what is stored of their session cannot be read."""

    participant: str
    kind: str
    created_utc: str
    reason: str
    """Why, as a sentence without its full stop."""
    lacks_page: bool = False
    """They stand on a page that this flow has not: run the lab with the pages they were enrolled with."""


class SessionUnreadable(StoreError):
    """What is stored of one participant's session cannot be read; the text says why."""


@dataclass(frozen=True)
class Cycle:
    """The start of a pick-and-place cycle: what a new worker needs before it re-runs the cycle's ticks."""

    participant: str
    trial: int
    practice: bool
    cycle: int
    start: str
    """JSON, made and read by the worker."""


@dataclass(frozen=True)
class Submission:
    """A message of a page that asks to be dealt with once: whose, its id, and what a resend is answered with."""

    participant: str
    message_id: str
    response: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Identity:
    """Words that may identify somebody, which no export holds: whose, what kind, and the words."""

    participant: str
    kind: str
    text: str


@dataclass(frozen=True)
class ConsentGiven:
    """When somebody agreed to take part, and the SHA-256 of the text they agreed to."""

    utc: str
    sha256: str


@dataclass(frozen=True)
class Batch:
    """What is written together: all of it is on disk, or nothing.

    Trials, tasks, alerts and cycles take the place of an earlier row of the same key; ticks, answers and events are
    only ever added. `consent` and `finished_utc` go with `session`. When `submission` was answered before, nothing at
    all is written.
    """

    session: Session | None = None
    consent: ConsentGiven | None = None
    finished_utc: str | None = None
    ticks: tuple[TickRow, ...] = ()
    practice_ticks: tuple[TickRow, ...] = ()
    trials: tuple[TrialRow, ...] = ()
    tasks: tuple[TaskRow, ...] = ()
    alerts: tuple[AlertRow, ...] = ()
    answers: tuple[SurveyAnswerRow, ...] = ()
    events: tuple[EventRow, ...] = ()
    cycles: tuple[Cycle, ...] = ()
    submission: Submission | None = None
    identities: tuple[Identity, ...] = ()
