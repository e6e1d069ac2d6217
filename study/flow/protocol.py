"""A participant's way through the study: which states there are, what leads from one to the next, and what must happen.

`RULES` is the whole table. `advance` looks an event up in it and returns the new session and the effects the lab has
to carry out; nothing here waits, starts or stores anything. Effects are not written in the table: they follow from
what each state needs (`NEEDS`), by comparing before and after.

    eligibility → consent → demographics → setup → instructions
            → (practice_ready → practice → trial_ready → trial → survey → break) for each trial, no break after the last
            → debrief → done

`paused` remembers where to go on (`resume_to`) and why it stands still (`causes`); it ends when no cause is left.
Two things that only the experimenter does lead aside (`INTERVENTIONS`): back from a trial that has not begun to its
practice, and out of a trial that cannot be completed.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, Union, cast, get_args

from study.records import StudyError

State = Literal[
    "eligibility",
    "consent",
    "demographics",
    "setup",
    "instructions",
    "practice_ready",
    "practice",
    "trial_ready",
    "trial",
    "survey",
    "break",
    "debrief",
    "done",
    "paused",
    "withdrawn",
    "aborted",
    "screened_out",
]
EventName = Literal[
    "eligible",
    "screened_out",
    "consent_given",
    "consent_declined",
    "demographics_done",
    "setup_done",
    "instructions_done",
    "start",
    "practice_done",
    "trial_done",
    "survey_done",
    "continue",
    "debrief_done",
    "connection_lost",
    "part_failed",
    "resume",
    "experimenter_pause",
    "experimenter_resume",
    "repeat_practice",
    "abort_trial",
    "withdraw",
    "abort",
]
Cause = Literal["connection", "experimenter", "fault"]
Outcome = Literal["done", "declined", "withdrawn", "aborted", "screened_out"]
WorkerKind = Literal["practice", "trial"]

STATES: tuple[State, ...] = get_args(State)
EVENTS: tuple[EventName, ...] = get_args(EventName)
TERMINAL: frozenset[State] = frozenset({"done", "withdrawn", "aborted", "screened_out"})
FREES_CELL: frozenset[State] = TERMINAL - {"done"}
"""Ends at which the cell of the counterbalancing is given out again."""
SKIPPABLE: frozenset[State] = frozenset({"eligibility", "demographics", "practice_ready", "survey"})
"""States a study may leave out; leaving out `practice_ready` leaves out `practice`."""


class IllegalEvent(StudyError):
    """An event that has no meaning in the session's state."""

    def __init__(self, session: Session, event: EventName) -> None:
        self.state = session.state
        self.event = event
        self.allowed = allowed(session)
        choices = ", ".join(self.allowed) or "none, the session is over"
        super().__init__(f"event {event!r} is not allowed in state {session.state!r}; allowed: {choices}")


@dataclass(frozen=True)
class Event:
    """Something that happened. `reason` is kept with `screened_out`, `withdraw`, `abort`, `part_failed` and
    `experimenter_pause`."""

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

    `since_s` is the `now_s` at which the state was entered, by the clock of whoever calls `advance`.
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
        return self.resume_to if self.state == "paused" and self.resume_to else self.state

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

RULES: Mapping[tuple[State, EventName], State] = {
    ("eligibility", "eligible"): "consent",
    ("eligibility", "screened_out"): "screened_out",
    ("consent", "consent_given"): "demographics",
    ("consent", "consent_declined"): "withdrawn",
    ("demographics", "demographics_done"): "setup",
    ("setup", "setup_done"): "instructions",
    ("instructions", "instructions_done"): "practice_ready",
    ("practice_ready", "start"): "practice",
    ("practice", "practice_done"): "trial_ready",
    ("trial_ready", "start"): "trial",
    ("trial", "trial_done"): "survey",
    ("survey", "survey_done"): "break",  # debrief after the last trial, see `_arrive`
    ("break", "continue"): "practice_ready",  # of the next trial
    ("debrief", "debrief_done"): "done",
}
"""What leads on. Pausing, withdrawing and aborting are the same from everywhere, see `ANYWHERE`."""

INTERVENTIONS: Mapping[tuple[State, EventName], State] = {
    ("trial_ready", "repeat_practice"): "practice_ready",
    ("trial", "abort_trial"): "survey",
}
"""Where the experimenter leads aside, also from a pause, which then stays one."""

PAUSED_RULES: frozenset[EventName] = frozenset({"practice_done", "trial_done"})
"""A tick may be the last one while a pause is on its way: the session then goes on to the next state, still paused."""

ANYWHERE: tuple[EventName, ...] = ("connection_lost", "experimenter_pause", "withdraw", "abort")
"""Allowed in every state that is not terminal. A lost connection pauses what ticks and changes nothing elsewhere.
`part_failed`, of an arbiter or an inference that cannot be used, pauses wherever there is a worker."""

_SKIP_TO: Mapping[State, State] = {
    "eligibility": "consent",
    "demographics": "setup",
    "practice_ready": "trial_ready",
    "survey": "break",
}
_ENDS: Mapping[EventName, tuple[State, Outcome]] = {
    "screened_out": ("screened_out", "screened_out"),
    "consent_declined": ("withdrawn", "declined"),
    "withdraw": ("withdrawn", "withdrawn"),
    "abort": ("aborted", "aborted"),
}
"""What ends a session before its time: the state it is in then, and the outcome."""
_CLEARS: Mapping[EventName, frozenset[Cause]] = {
    "resume": frozenset({"connection", "fault"}),
    "experimenter_resume": frozenset({"experimenter", "fault"}),
}
"""A fault is nobody's doing: whoever is there may try again."""


def new_session(participant: str, trials: int, skips: Iterable[str] = ()) -> Session:
    """A session at its beginning; `skips` names the states the study leaves out (`Study.skips`)."""
    chosen = frozenset(skips)
    if trials < 1:
        raise StudyError(f"trials is {trials}, must be at least 1")
    if not chosen <= SKIPPABLE:
        raise StudyError(f"cannot skip {sorted(chosen - SKIPPABLE)}; skippable are {sorted(SKIPPABLE)}")
    first: State = "consent" if "eligibility" in chosen else "eligibility"
    return Session(participant=participant, trials=trials, state=first, skips=cast("frozenset[State]", chosen))


def allowed(session: Session) -> tuple[EventName, ...]:
    """The events that `advance` takes now, in a fixed order."""
    if session.is_over:
        return ()
    names = {event for state, event in RULES if state == session.state}
    for (state, event), target in INTERVENTIONS.items():
        # A study without practice has none to repeat: past what it leaves out one would come back to the same place.
        if state == session.place and _not_left_out(session, target) != state:
            names.add(event)
    if session.state == "paused":
        names |= {event for event in PAUSED_RULES if (session.place, event) in RULES}
        names |= {event for event, causes in _CLEARS.items() if causes & session.causes}
    if session.worker:
        names.add("part_failed")
    names.update(ANYWHERE)
    return tuple(event for event in EVENTS if event in names)


def advance(session: Session, event: Event | EventName, now_s: float) -> tuple[Session, tuple[Effect, ...]]:
    """The session after an event and what has to happen, in order. Raises `IllegalEvent` and changes nothing then."""
    happened = event if isinstance(event, Event) else Event(event)
    if happened.name not in allowed(session):
        raise IllegalEvent(session, happened.name)
    after = _after(session, happened)
    if after.state != session.state:
        after = replace(after, since_s=now_s)
    return after, _effects(session, after)


def restore(session: Session, now_s: float) -> tuple[Session, tuple[Effect, ...]]:
    """A stored session in a lab that has just started: nobody is connected and no worker runs.

    What was ticking is paused for its connection. The effects bring back the worker the session needs; the lab
    re-runs that worker's current cycle from the log.
    """
    if session.is_ticking:
        session, _ = advance(session, "connection_lost", now_s)
    return session, (StartWorker(*session.worker),) if session.worker else ()


def _not_left_out(session: Session, target: State) -> State:
    """The first state from `target` on that the study does not leave out."""
    while target in session.skips:
        target = _SKIP_TO[target]
    return target


def _after(session: Session, event: Event) -> Session:
    name = event.name
    if name in _ENDS:
        end, outcome = _ENDS[name]
        return replace(session, state=end, resume_to=None, causes=frozenset(), outcome=outcome, reason=event.reason)
    if name == "experimenter_pause":
        return replace(_paused(session, "experimenter"), reason=event.reason)
    if name == "connection_lost":
        return _paused(session, "connection") if session.place in ("practice", "trial") else session
    if name == "part_failed":
        return replace(_paused(session, "fault"), reason=event.reason)
    if name in _CLEARS:
        causes = session.causes - _CLEARS[name]
        if causes:
            return replace(session, causes=causes)
        return replace(session, state=session.place, resume_to=None, causes=causes, reason=None)
    step = (session.place, name)
    target = INTERVENTIONS[step] if step in INTERVENTIONS else RULES[step]
    return _arrive(session, target, leaving=session.place)


def _paused(session: Session, cause: Cause) -> Session:
    return replace(session, state="paused", resume_to=session.place, causes=session.causes | {cause})


def _arrive(session: Session, target: State, leaving: State) -> Session:
    """The session at `target`, past what the study leaves out; a pause stays a pause."""
    trial = session.trial + 1 if leaving == "break" else session.trial
    target = _not_left_out(session, target)
    if target == "break" and trial == session.trials:
        target = "debrief"
    if session.state == "paused":
        # Only what needs a robot waits for a connection or an arbiter: a form can be shown whenever the page is back.
        causes = session.causes if NEEDS.get(target, (None, False))[0] else session.causes - {"connection", "fault"}
        if causes:
            return replace(session, resume_to=target, trial=trial, causes=causes)
    outcome: Outcome | None = "done" if target == "done" else None
    return replace(session, state=target, resume_to=None, trial=trial, causes=frozenset(), outcome=outcome, reason=None)


def _effects(before: Session, after: Session) -> tuple[Effect, ...]:
    effects: list[Effect] = []
    same_worker = before.worker == after.worker
    if before.is_ticking and not after.is_ticking and same_worker:
        effects.append(PauseTicks())
    if before.worker and not same_worker:
        effects.append(StopWorker())
    if after.worker and not same_worker:
        effects.append(StartWorker(*after.worker))
    if after.is_ticking and not before.is_ticking:
        effects.append(ResumeTicks() if before.state == "paused" else BeginTicks())
    if after.outcome and not before.outcome:
        effects.append(Finish(after.outcome))
    return tuple(effects)


def to_json(session: Session) -> str:
    """The session as one line of JSON, for the store."""
    fields = {**vars(session), "causes": sorted(session.causes), "skips": sorted(session.skips)}
    return json.dumps(fields, sort_keys=True)


def from_json(text: str) -> Session:
    """The session of `to_json`; raises `StudyError` naming the field that cannot be."""
    try:
        fields: dict[str, Any] = json.loads(text)
        session = Session(**{**fields, "causes": frozenset(fields["causes"]), "skips": frozenset(fields["skips"])})
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise StudyError(f"not a stored session: {error}; stored is {text[:200]!r}") from None
    checks: tuple[tuple[str, object, bool], ...] = (
        ("state", session.state, session.state in STATES),
        ("trial", session.trial, 1 <= session.trial <= session.trials),
        ("causes", sorted(session.causes), session.causes <= set(get_args(Cause))),
        ("skips", sorted(session.skips), session.skips <= SKIPPABLE),
        ("resume_to", session.resume_to, (session.resume_to is None) == (session.state != "paused")),
        ("resume_to", session.resume_to, session.resume_to in (None, *STATES)),
        ("causes", sorted(session.causes), bool(session.causes) == (session.state == "paused")),
        ("outcome", session.outcome, (session.outcome is None) == (session.state not in TERMINAL)),
    )
    for field, value, fits in checks:
        if not fits:
            raise StudyError(f"stored session of {session.participant!r}: {field} = {value!r} cannot be")
    return session
