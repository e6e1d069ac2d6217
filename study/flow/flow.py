"""What leads where: the flow of a study, made of its pages.

`Flow(PAGES)` is the whole table: pages lead on in their order, those of a trial come round for each, and what a study
leaves out is passed by. `advance` takes an event and returns the new session and the effects the lab has to carry out;
nothing here waits, starts or stores anything. Effects are not written in the pages: they follow from what each state
needs (`NEEDS`), by comparing before and after.

    FLOW                                    the flow that the lab runs
    FLOW.with_page(PAGE, after="practice")  the same with a page of one's own
"""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

from study.definition.study import Study
from study.flow.page import FlowPage, Outcome, Step, StepContext, StepData, Text
from study.flow.pages import PAGES
from study.flow.protocol import (
    ANYWHERE,
    CAUSES,
    CLEARS,
    ENDS_ANYWHERE,
    NEEDS,
    OF_THE_ROBOT,
    PAUSE_EVENTS,
    PAUSED,
    TERMINAL,
    BeginTicks,
    Cause,
    Effect,
    Ending,
    Event,
    EventName,
    Finish,
    IllegalEvent,
    PauseTicks,
    ResumeTicks,
    Session,
    StartWorker,
    State,
    StopWorker,
)
from study.flow.protocol import Outcome as EndOutcome
from study.records import StudyError

DONE: State = "done"
NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")


_STORED_TYPES: Mapping[str, Any] = {
    **dict.fromkeys(("participant", "state"), str),
    **dict.fromkeys(("trials", "trial"), int),
    **dict.fromkeys(("resume_to", "outcome", "reason"), (str, type(None))),
    "since_s": (int, float),
}
"""What the fields of a stored session are."""


class NoSuchPage(StudyError):
    """A stored session stands on a page that the flow has not."""


class ReasonData(StepData):
    """Free words, if any."""

    reason: Text | None = None
    """Kept apart from the record and never exported."""


class HelpData(StepData):
    """Free words, if any."""

    text: Text | None = None
    """Kept apart from the record and never exported."""


class PictureData(StepData):
    """Whether the robot is to be seen on the participant's screen."""

    there: bool
    """Whether it is drawn."""
    why: Literal["no_webgl", "context_lost", "not_loaded", "connection"] | None = None
    """Why not: the browser draws no 3-D graphics, has stopped to, the picture did not load, its connection was lost."""


def _withdraw(context: StepContext, data: ReasonData) -> Outcome:
    return Outcome(Event("withdraw"), words=data.reason)


def _help(context: StepContext, data: HelpData) -> Outcome:
    return Outcome(words=data.text)


def _picture(context: StepContext, data: PictureData) -> Outcome:
    if not data.there:
        return Outcome(Event("picture_lost", data.why), log=data.model_dump())
    is_missed = "picture" in context.session.causes
    return Outcome(Event("picture_back") if is_missed else None, log=data.model_dump())


STEPS_ANYWHERE: Mapping[str, Step[Any]] = {
    "withdraw": Step(ReasonData, _withdraw),
    "help": Step(HelpData, _help),
    "picture": Step(PictureData, _picture),
}
"""What can be handed in from every page."""


@dataclass(frozen=True, eq=False)
class Flow:
    """A participant's way through a study. Raises `StudyError` for pages that make none."""

    pages: tuple[FlowPage, ...]

    def __post_init__(self) -> None:
        problem = next(_problems(self.pages), None)
        if problem:
            raise StudyError(problem)

    def with_page(self, page: FlowPage, after: State) -> Flow:
        """The flow with another page behind the one of that state."""
        place = self.pages.index(self.page(after)) + 1
        return Flow((*self.pages[:place], page, *self.pages[place:]))

    # ---- what there is ----------------------------------------------------------------------------------------------

    @cached_property
    def _page_of(self) -> Mapping[State, FlowPage]:
        return {page.state: page for page in self.pages}

    def page(self, state: State) -> FlowPage:
        """The page of a state; `StudyError` names the ones there are."""
        if state not in self._page_of:
            raise StudyError(f"no page {state!r} in this flow; there are {', '.join(self.states)}")
        return self._page_of[state]

    @cached_property
    def states(self) -> tuple[State, ...]:
        """Every state, in the order of the pages."""
        return tuple(page.state for page in self.pages)

    @cached_property
    def line(self) -> tuple[FlowPage, ...]:
        """The pages that lead from one to the next, and the last one."""
        return _line(self.pages)

    @cached_property
    def skippable(self) -> frozenset[State]:
        """States that a study may leave out, by the page that decides it."""
        return frozenset(page.state for page in self.pages if page.left_out)

    def skips(self, study: Study) -> frozenset[State]:
        """Those that this study leaves out."""
        return frozenset(page.state for page in self.pages if page.left_out and page.left_out(study))

    @cached_property
    def rules(self) -> Mapping[tuple[State, EventName], State]:
        """What leads on, as a table. Pausing, withdrawing and aborting are the same from everywhere (`ANYWHERE`)."""
        found: dict[tuple[State, EventName], State] = {}
        for page in self.line[:-1]:
            found[page.state, page.leads_on or ""] = self._following(page.state)
            found.update({(page.state, event): ending.state for event, ending in page.ends.items()})
        return found

    @cached_property
    def interventions(self) -> Mapping[tuple[State, EventName], State]:
        """Where the experimenter leads aside, also from a pause, which then stays one."""
        return {
            (page.state, event): target or self._following(page.state)
            for page in self.line
            for event, target in page.aside.items()
        }

    @cached_property
    def _ends(self) -> Mapping[EventName, Ending]:
        """What ends a session before its time."""
        return {event: ending for page in self.pages for event, ending in page.ends.items()} | dict(ENDS_ANYWHERE)

    @cached_property
    def events(self) -> tuple[EventName, ...]:
        """Everything that can happen, in the order in which it is told."""
        of_pages = [event for _, event in self.rules]
        aside = [event for _, event in self.interventions]
        return tuple(dict.fromkeys((*of_pages, *PAUSE_EVENTS, *aside, *ENDS_ANYWHERE)))

    @cached_property
    def steps(self) -> Mapping[str, Step[Any]]:
        """Every step by its name, but those about alerts, which belong to the distractor."""
        found = {name: step for page in self.pages for name, step in page.steps.items()}
        return {**found, **STEPS_ANYWHERE}

    # ---- what happens -----------------------------------------------------------------------------------------------

    def new_session(self, participant: str, trials: int, skips: Iterable[State] = ()) -> Session:
        """A session at its beginning; `skips` names the states the study leaves out (`Flow.skips`)."""
        chosen = frozenset(skips)
        if trials < 1:
            raise StudyError(f"trials is {trials}, must be at least 1")
        if not chosen <= self.skippable:
            raise StudyError(f"cannot skip {sorted(chosen - self.skippable)}; skippable are {sorted(self.skippable)}")
        session = Session(participant=participant, trials=trials, state=self.line[0].state, skips=chosen)
        state, trial = self._not_left_out(session, session.state)
        return replace(session, state=state, trial=trial)

    def allowed(self, session: Session) -> tuple[EventName, ...]:
        """The events that `advance` takes now, in a fixed order."""
        if session.is_over:
            return ()
        names = {event for state, event in self.rules if state == session.state}
        for (state, event), target in self.interventions.items():
            # A study without practice has none to repeat: past what it leaves out one comes back to the same place.
            if state == session.place and self._not_left_out(session, target)[0] != state:
                names.add(event)
        if session.state == PAUSED:
            if NEEDS.get(session.place, (None, False))[1]:
                # A tick may be the last one while a pause is on its way: on to the next state, still paused.
                names.add(self.page(session.place).leads_on or "")
            names |= {event for event, causes in CLEARS.items() if causes & session.causes}
        if session.worker:
            names.add("part_failed")
        names.update(ANYWHERE)
        return tuple(event for event in self.events if event in names)

    def advance(self, session: Session, event: Event | EventName, now_s: float) -> tuple[Session, tuple[Effect, ...]]:
        """The session after an event and what has to happen, in order. Raises `IllegalEvent` and changes nothing
        then."""
        happened = event if isinstance(event, Event) else Event(event)
        allowed = self.allowed(session)
        if happened.name not in allowed:
            raise IllegalEvent(session, happened.name, allowed)
        after = self._after(session, happened)
        if after.state != session.state:
            after = replace(after, since_s=now_s)
        return after, _effects(session, after)

    def restore(self, session: Session, now_s: float) -> tuple[Session, tuple[Effect, ...]]:
        """A stored session in a lab that has just started: nobody is connected and no worker runs.

        What was ticking is paused for its connection. The effects bring back the worker the session needs; the lab
        re-runs that worker's current cycle from the log.
        """
        if session.is_ticking:
            session, _ = self.advance(session, "connection_lost", now_s)
        return session, (StartWorker(*session.worker),) if session.worker else ()

    def from_json(self, text: str) -> Session:
        """The session of `study.flow.protocol.to_json`; raises `StudyError` naming the field that cannot be, and
        `NoSuchPage` where it stands on a page that this flow has not."""
        try:
            fields: dict[str, Any] = json.loads(text)
            session = Session(**{**fields, "causes": frozenset(fields["causes"]), "skips": frozenset(fields["skips"])})
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise StudyError(f"not a stored session: {error}; stored is {text[:200]!r}") from None
        for field, types in _STORED_TYPES.items():
            value = getattr(session, field)
            if not isinstance(value, types) or isinstance(value, bool):
                raise StudyError(f"a stored session: {field} = {str(value)[:60]!r} cannot be")
        if not all(isinstance(one, str) for one in (*session.causes, *session.skips)):
            raise StudyError("a stored session: causes and skips must be names")
        checks: tuple[tuple[str, object, bool], ...] = (
            ("state", session.state, session.state in self.states),
            ("trial", session.trial, 1 <= session.trial <= session.trials),
            ("causes", sorted(session.causes), session.causes <= set(CAUSES)),
            ("skips", sorted(session.skips), session.skips <= self.skippable),
            ("resume_to", session.resume_to, (session.resume_to is None) == (session.state != PAUSED)),
            ("resume_to", session.resume_to, session.resume_to in (None, *self.states)),
            ("causes", sorted(session.causes), bool(session.causes) == (session.state == PAUSED)),
            ("outcome", session.outcome, (session.outcome is None) == (session.state not in TERMINAL)),
        )
        for field, value, fits in checks:
            if not fits:
                problem = f"stored session of {session.participant!r}: {field} = {value!r} cannot be"
                if field in ("state", "resume_to") and value is not None and value not in self.states:
                    raise NoSuchPage(f"{problem}; pages are {', '.join(self.states)}")
                raise StudyError(problem)
        return session

    # ---- the way ----------------------------------------------------------------------------------------------------

    def _next(self, state: State, trial: int, trials: int) -> tuple[State, int]:
        """The state behind this one, and its trial: the last page of a trial leads to the first one of the next."""
        place = next(number for number, page in enumerate(self.line) if page.state == state)
        here, behind = self.line[place], self.line[place + 1]
        if here.per_trial and not behind.per_trial and trial < trials:
            return next(page.state for page in self.line if page.per_trial), trial + 1
        return behind.state, trial

    def _following(self, state: State) -> State:
        """The state behind this one, while there are trials left."""
        return self._next(state, 1, 2)[0]

    def _not_left_out(self, session: Session, target: State) -> tuple[State, int]:
        """The first state from `target` on that is not left out, and its trial."""
        trial = session.trial
        while self._is_left_out(self.page(target), session, trial):
            target, trial = self._next(target, trial, session.trials)
        return target, trial

    @staticmethod
    def _is_left_out(page: FlowPage, session: Session, trial: int) -> bool:
        is_skipped = (page.left_out_with or page.state) in session.skips
        return is_skipped or (page.between_trials and trial == session.trials)

    def _after(self, session: Session, event: Event) -> Session:
        name = event.name
        if name in self._ends:
            end = self._ends[name]
            over = replace(session, state=end.state, outcome=end.outcome, reason=event.reason)
            return replace(over, resume_to=None, causes=frozenset())
        if name == "experimenter_pause":
            return replace(_paused(session, "experimenter"), reason=event.reason)
        if name == "connection_lost":
            return _paused(session, "connection") if session.place in ("practice", "trial") else session
        if name == "picture_lost":
            is_seen = session.place in ("practice", "trial")
            return replace(_paused(session, "picture"), reason=event.reason) if is_seen else session
        if name == "part_failed":
            return replace(_paused(session, "fault"), reason=event.reason)
        if name in CLEARS:
            causes = session.causes - CLEARS[name]
            if causes:
                return replace(session, causes=causes)
            return replace(session, state=session.place, resume_to=None, causes=causes, reason=None)
        step = (session.place, name)
        if step in self.interventions:
            return self._arrive(session, self.interventions[step])
        target, trial = self._next(session.place, session.trial, session.trials)
        return self._arrive(replace(session, trial=trial), target)

    def _arrive(self, session: Session, target: State) -> Session:
        """The session at `target`, past what is left out; a pause stays a pause."""
        target, trial = self._not_left_out(session, target)
        if session.state == PAUSED:
            causes = session.causes if target in NEEDS else session.causes - OF_THE_ROBOT
            if causes:
                return replace(session, resume_to=target, trial=trial, causes=causes)
        outcome: EndOutcome | None = "done" if target == DONE else None
        arrived = replace(session, state=target, trial=trial, outcome=outcome)
        return replace(arrived, resume_to=None, causes=frozenset(), reason=None)


def _paused(session: Session, cause: Cause) -> Session:
    return replace(session, state=PAUSED, resume_to=session.place, causes=session.causes | {cause})


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
        effects.append(ResumeTicks() if before.state == PAUSED else BeginTicks())
    if after.outcome and not before.outcome:
        effects.append(Finish(after.outcome))
    return tuple(effects)


# ---- pages that make no flow ----------------------------------------------------------------------------------------


def _line(pages: tuple[FlowPage, ...]) -> tuple[FlowPage, ...]:
    return tuple(page for page in pages if page.leads_on or page.state == DONE)


def _problems(pages: tuple[FlowPage, ...]) -> Iterator[str]:
    """What is wrong with the pages, worst first."""
    states = [page.state for page in pages]
    line = [page.state for page in _line(pages)]
    for state in states:
        if not NAME.fullmatch(state):
            yield f"page {state!r}: a state is small letters, digits and _, at most 40, and begins with a letter"
        if states.count(state) > 1:
            yield f"page {state!r} stands in the flow {states.count(state)} times"
    for state in (*NEEDS, DONE, PAUSED, *sorted(TERMINAL)):
        if state not in states:
            yield f"the flow has no page {state!r}; every flow has {', '.join((*NEEDS, PAUSED, *sorted(TERMINAL)))}"
    if line[-1:] != [DONE]:
        yield f"the flow must lead to 'done'; its last page is {line[-1:]}"
    if [state for state in line if state in NEEDS] != list(NEEDS):
        yield f"pages with a robot must stand in this order: {', '.join(NEEDS)}"
    for page in pages:
        yield from _page_problems(page, pages)
    rounds = [page.per_trial for page in _line(pages)]
    if sum(before != now for before, now in itertools.pairwise(rounds)) != 2 or rounds[0]:
        of_trials = [page.state for page in _line(pages) if page.per_trial]
        yield f"pages of a trial must stand together, after the first and before the last page; they are {of_trials}"


def _page_problems(page: FlowPage, pages: tuple[FlowPage, ...]) -> Iterator[str]:
    states = [other.state for other in pages]
    named = f"page {page.state!r}"
    everywhere = {*ANYWHERE, *PAUSE_EVENTS}
    for event in (page.leads_on, *page.ends, *page.aside):
        if event in everywhere:
            yield f"{named}: event {event!r} means the same from every page; choose another name"
        elif event is not None and not NAME.fullmatch(event):
            yield f"{named}: event {event!r}: an event is small letters, digits and _, at most 40"
    for other in pages:
        if page.leads_on is not None and page.leads_on in other.ends:
            yield f"{named}: event {page.leads_on!r} leads on here and ends the session in {other.state}"
    for event in page.aside:
        if any(event == other.leads_on for other in pages):
            yield f"{named}: event {event!r} leads aside here and on elsewhere"
    for target in (*page.aside.values(), page.left_out_with, *(ending.state for ending in page.ends.values())):
        if target is not None and target not in states:
            yield f"{named} names the page {target!r}; there are {', '.join(states)}"
    if page.left_out_with and not any(one.state == page.left_out_with and one.left_out for one in pages):
        yield f"{named} is left out with {page.left_out_with!r}, which no study can leave out"
    for name, step in page.steps.items():
        before = pages[: pages.index(page)]
        takers = [other.state for other in before if other.steps.get(name, step) != step]
        if takers or name in STEPS_ANYWHERE or name.startswith("alert_"):
            others = ", ".join(takers) or "the lab itself"
            yield f"{named}: step {name!r} is another one in {others}; choose another name"
        if not NAME.fullmatch(name):
            yield f"{named}: step {name!r}: a step is small letters, digits and _, at most 40"
    for name, data in page.notes.items():
        namesakes = [other.state for other in pages[: pages.index(page)] if other.notes.get(name, data) is not data]
        if namesakes:
            yield f"{named}: note {name!r} is another one in {', '.join(namesakes)}; choose another name"
        if not NAME.fullmatch(name):
            yield f"{named}: note {name!r}: a note is small letters, digits and _, at most 40"


FLOW = Flow(PAGES)
"""The flow of the lab as it ships."""
