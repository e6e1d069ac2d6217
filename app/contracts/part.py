"""What arbiters and goal inferences promise alike: the same answers to the same questions, always."""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, ClassVar

from app.contracts.asking import Answer, Transcript, ask, ask_elsewhere
from app.contracts.candidate import Candidate, candidate
from app.contracts.plugin import TIMES
from app.contracts.situations import CYCLES, LONG_CYCLES, cycles
from app.contracts.trial import drive, rerun, trial_with
from app.contracts.verdict import fixture, mend
from app.trial.reasoning import MAX_MEMORY_BYTES, PartFault
from app.trial.values import CycleStart
from app.worker.time_limit import DECIDE_WITHIN_S
from study.definition.part_fields import model_of, parameter_problems
from study.records import StudyError, TickRow


class PartContract:
    """The checks that both have. A subclass names the part, and what it takes where the defaults are not to be used."""

    kind: ClassVar[str]
    parameters: ClassVar[Mapping[str, Any]] = {}

    @fixture
    def part(self, request: Any) -> Candidate:
        """The part that the class names, beside the file that the class stands in."""
        name = getattr(request.cls, self.kind, "")
        if not name:
            mend(f'{request.cls.__name__} names no part; give it a line such as {self.kind} = "blend.py:Blend"')
        folder = Path(inspect.getfile(request.cls)).resolve().parent
        return usable(candidate(self.kind, name, folder, json.dumps(dict(self.parameters))))

    def test_its_parameters_are_fields_of_a_study_file(self, part: Candidate) -> None:
        """A frozen dataclass, with defaults that its own bounds allow, and nothing beyond them."""
        parameters = part.loaded.Parameters
        try:
            model_of(parameters)
        except StudyError as error:
            mend(f"{part}: its parameters cannot be used: {error}")
        usual = {
            field.name: field.default for field in fields(parameters) if field.init and field.default is not MISSING
        }
        for problem in parameter_problems(parameters, {**part.named.parameters, **usual}):
            field = problem.path[0] if problem.path else "together"
            mend(
                f"{part}: the default {usual.get(str(field))!r} of {field} {problem.sentence}: change it, or the bound"
            )
        for name, beyond in _beyond(parameters):
            if not parameter_problems(parameters, {**part.named.parameters, name: beyond}):
                mend(f"{part}: {name} = {beyond!r} is taken; give {name} a type and bounds that refuse it")

    def test_it_answers_every_question(self, part: Candidate) -> None:
        """No state of the world makes it raise."""
        for answer in part.transcript.answers:
            if answer.raised:
                hint = "; what it is given is read-only, so copy it first" if "read-only" in answer.raised else ""
                mend(f"{part} must answer in every state; it raised {answer.raised}{hint} ({answer.situation})")

    def test_asked_anew_it_answers_the_same(self, part: Candidate) -> None:
        """No randomness, no clock, nothing kept outside of the instance."""
        _compare(
            f"{part} answers differently when it is made anew and asked the same: take no randomness, read no clock, "
            "keep nothing in the class or the module",
            part.transcript.texts,
            part.again.texts,
        )

    def test_another_process_hears_the_same(self, part: Candidate) -> None:
        """Another hash seed, another time of the day: a worker that takes over, or a run on another day."""
        starts = list(enumerate(part.transcript.memories))
        elsewhere = ask_elsewhere(part.named, CYCLES, starts)
        _compare(
            f"{part} answers differently in another process: iterate over no set, read no clock, no environment",
            part.transcript.texts,
            elsewhere,
        )

    def test_its_memory_is_json_and_small(self, part: Candidate) -> None:
        """At any moment of a long trial."""
        for answer in part.transcript.answers:
            if answer.not_json:
                mend(
                    f"{part}: its memory is not JSON ({answer.not_json}): keep None, finite numbers, texts, lists and "
                    "dicts of these alone"
                )
        if part.transcript.cut_short or part.transcript.answers[-1].memory == "null":
            return
        for answer in ask(part.named, cycles(LONG_CYCLES)).answers:
            size = len(answer.memory.encode())
            if size > MAX_MEMORY_BYTES:
                mend(
                    f"{part}: its memory has {size} bytes at {answer.situation.state.tick} ticks; at most "
                    f"{MAX_MEMORY_BYTES}: keep sums or the last few, not everything"
                )

    def test_its_memory_is_all_it_keeps(self, part: Candidate) -> None:
        """Taken up again at any cycle's start, with the memory of then, it goes on as if nothing had happened."""
        starts = list(enumerate(part.transcript.memories))[::-1]
        restored = ask_elsewhere(part.named, CYCLES, starts)[::-1]
        _compare(
            f"{part} goes on differently when it is restored at a cycle's start: it keeps hidden state in the class "
            "or the module; put it into self.memory",
            part.transcript.texts,
            restored,
        )

    def test_it_thinks_within_the_limit(self, part: Candidate, record_property: Any) -> None:
        """Time in which the machine ran something else does not count, and the quickest of three times does."""
        third = ask(part.named, cycles(CYCLES))
        runs = [run.answers for run in (part.transcript, part.again, third)]
        quickest_s = [min(answer.took_s for answer in answers) for answers in zip(*runs, strict=False)]
        slowest_s = max(quickest_s)
        text = f"{part}: the slowest of {len(quickest_s)} answers took {1000 * slowest_s:.1f} ms"
        record_property(TIMES, text)
        if slowest_s > DECIDE_WITHIN_S:
            where = runs[0][quickest_s.index(slowest_s)].situation
            mend(f"{text}; it is given {1000 * DECIDE_WITHIN_S:g} ms: think less, or work ahead in __init__ ({where})")

    def test_a_trial_run_again_gives_the_same_rows(self, part: Candidate) -> None:
        """A whole trial with the kinematic robot."""
        rows, _ = _trial(part)
        _same_rows(part, "run again, a trial", rows, _rerun(part, rows))

    def test_a_trial_resumed_at_any_cycle_gives_the_same_rows(self, part: Candidate) -> None:
        """As a worker does that takes over from one that crashed."""
        rows, starts = _trial(part)
        for start in starts:
            again = _rerun(part, rows, start)
            _same_rows(part, f"resumed at cycle {start.cycle}, a trial", rows[start.first_tick :], again)


def usable(part: Candidate) -> Candidate:
    """The part, if it can be made at all; else the check fails with the one line that says why not."""
    try:
        if part.kind == "robot":
            _ = part.loaded
        else:
            ask(part.named, [()])
    except StudyError as error:
        mend(f"{error}")
    return part


def _compare(what: str, first: Sequence[Sequence[str]], second: Sequence[Sequence[str]]) -> None:
    questions = [
        (cycle, number, *texts)
        for cycle, (ones, others) in enumerate(zip(first, second, strict=False), start=1)
        for number, texts in enumerate(zip(ones, others, strict=False), start=1)
    ]
    for cycle, number, one, other in questions:
        if one != other:
            mend(f"{what} (cycle {cycle}, question {number}: {one[:150]}, then {other[:150]})")


def _trial(part: Candidate) -> tuple[list[TickRow], list[CycleStart]]:
    """A driven trial's rows, and where it can be taken up again."""
    _stop_if_slow(part.transcript, part)
    try:
        results = drive(trial_with(part.named))
    except PartFault as fault:
        mend(f"{fault}; a trial pauses there: this is a fault to mend before anybody is invited")
    starts = [result.cycle_start for result in results if result.cycle_start is not None]
    return [result.row for result in results], [CycleStart(), *starts]


def _rerun(part: Candidate, rows: Sequence[TickRow], start: CycleStart | None = None) -> list[TickRow]:
    try:
        return rerun(trial_with(part.named), rows, start)
    except PartFault as fault:
        mend(f"{fault}; it did not when the trial was run first: keep everything in self.memory")


def _same_rows(part: Candidate, what: str, first: Sequence[TickRow], second: Sequence[TickRow]) -> None:
    for one, other in zip(first, second, strict=False):
        if one != other:
            differs = next(name for name, value in vars(one).items() if value != getattr(other, name))
            mend(
                f"{part}: {what} is not the same from tick {one.tick} on ({differs}: {getattr(one, differs)}, then "
                f"{getattr(other, differs)}): take no randomness, and keep everything in self.memory"
            )
    if len(first) != len(second):
        mend(f"{part}: {what} has {len(second)} ticks instead of {len(first)}")


def _stop_if_slow(transcript: Transcript, part: Candidate) -> None:
    """A trial with a part that takes seconds for a tick takes hours."""
    if transcript.cut_short:
        mend(f"{part} is too slow for a trial: it is given {1000 * DECIDE_WITHIN_S:g} ms for an answer")


def each_answer(part: Candidate) -> list[Answer]:
    """The answers that are ones; what was raised instead is another check's."""
    return [answer for answer in part.transcript.answers if not answer.raised]


def _beyond(parameters: type) -> list[tuple[str, Any]]:
    """(name, a value that must be refused): beyond each bound, no number where there must be one, an unknown name."""
    found: list[tuple[str, Any]] = [("no_such_parameter", 1.0)]
    for name, schema in model_of(parameters).model_json_schema().get("properties", {}).items():
        if schema.get("type") in ("number", "integer"):
            found += [(name, math.nan), (name, math.inf), (name, "text"), (name, True)]
            found += [(name, schema[key] - 1) for key in ("minimum", "exclusiveMinimum") if key in schema]
            found += [(name, schema[key] + 1) for key in ("maximum", "exclusiveMaximum") if key in schema]
    return found
