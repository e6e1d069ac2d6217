"""Asking an arbiter or a goal inference as a trial does, and keeping what it answers: here, or in a process of its own.

Whatever the part does is an answer: one that raises says so. `python -m app.contracts.asking` is the other process.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, index_of
from app.autonomy.belief import Belief
from app.autonomy.interface import Arbiter, GoalInference, Models
from app.contracts.situations import Situation, cycles
from app.trial.parts import make_arbiter, make_inference
from app.trial.reasoning import TookTooLong
from app.worker.time_limit import DECIDE_WITHIN_S, TimeLimit, own_time_s
from study.parts.errors import PartError
from study.parts.shelf import Named

GIVE_UP_AFTER_S = 0.5
"""On one answer."""
SLOW_ANSWERS = 3
"""After so many answers beyond the limit nothing more is asked: it would take hours."""
PROCESS_TIMEOUT_S = 120
OTHER_SURROUNDINGS = {"PYTHONHASHSEED": "1", "TZ": "Pacific/Kiritimati"}
"""Of the other process: sets in another order, and another hour of the day."""


@dataclass(frozen=True)
class Answer:
    """What a part answered: the value, the same as text, what it raised, its memory then, and how long it took.

    `memory` is JSON; `not_json` says why there is none.
    """

    situation: Situation
    value: Any
    text: str
    raised: str = ""
    memory: str = ""
    not_json: str = ""
    took_s: float = 0.0


@dataclass(frozen=True)
class Transcript:
    """The answers of some cycles, in order, and the memory that each cycle began with."""

    cycles: tuple[tuple[Answer, ...], ...]
    memories: tuple[str, ...]
    cut_short: bool = False
    """It was too slow to be asked everything."""

    @property
    def answers(self) -> tuple[Answer, ...]:
        """All answers."""
        return tuple(answer for cycle in self.cycles for answer in cycle)

    @property
    def texts(self) -> list[list[str]]:
        """What was answered and remembered, cycle by cycle."""
        return [[f"{answer.text} {answer.memory}" for answer in cycle] for cycle in self.cycles]


def ask(named: Named, asked: Sequence[Sequence[Situation]], memory: str = "", explain: bool = False) -> Transcript:
    """Every question of those cycles. The part is made anew for each cycle, with the memory of the one before.

    Raises `PartError` when it cannot be made.
    """
    done: list[tuple[Answer, ...]] = []
    memories, slow = [], 0
    for cycle in asked:
        memories.append(memory)
        part = _made(named, memory)
        answers: list[Answer] = []
        for situation in cycle:
            belief = _belief_before(situation, answers)
            answers.append(_answer(part, situation, belief, explain))
            memory = answers[-1].memory or memory
            slow += answers[-1].took_s > DECIDE_WITHIN_S
            if slow >= SLOW_ANSWERS:
                return Transcript((*done, tuple(answers)), tuple(memories), cut_short=True)
        done.append(tuple(answers))
    return Transcript(tuple(done), tuple(memories))


def _made(named: Named, memory: str) -> Arbiter | GoalInference:
    make = make_arbiter if named.kind == "arbiter" else make_inference
    part: Arbiter | GoalInference = make(named, Models())
    if memory:
        part.memory = json.loads(memory)
    return part


def _belief_before(situation: Situation, answers: Sequence[Answer]) -> Belief:
    """What an inference is told: its last answer, as long as the goals are the same."""
    if answers and isinstance(answers[-1].value, Belief):
        last: Belief = answers[-1].value
        if last.goal_ids == situation.state.goal_ids:
            return last
    return situation.prior


def _answer(part: Arbiter | GoalInference, situation: Situation, belief: Belief, explain: bool) -> Answer:
    state, user, raised = situation.state, situation.user, ""
    value: Any = None
    began_s = own_time_s()
    try:
        with TimeLimit(GIVE_UP_AFTER_S):
            if isinstance(part, Arbiter):
                value = part.decide(state, situation.prior, user, situation.feasible)
            else:
                value = part.update(state, belief, user)
    except TookTooLong:
        raised = f"no answer within {GIVE_UP_AFTER_S:g} s"
    except (Exception, SystemExit) as error:
        raised = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
    took_s = own_time_s() - began_s
    if explain and isinstance(part, Arbiter) and not raised:
        part.explain(state, situation.prior, user, value)
    memory, not_json = remembered(part)
    # What a part returns may be changed by it later, so the text is kept.
    return Answer(situation, value, raised or as_text(value), raised, memory, not_json, took_s)


def remembered(part: Arbiter | GoalInference) -> tuple[str, str]:
    """A part's memory as JSON, and why it is none."""
    try:
        return json.dumps(part.memory, allow_nan=False), ""
    except (TypeError, ValueError, RecursionError) as error:
        return "", str(error)


def as_text(value: Any) -> str:
    """An answer for comparing: the same text for the same answer, to the last digit."""
    if isinstance(value, Belief):
        return json.dumps(value.as_dict())
    try:
        return str(DIRECTIONS[index_of(value)])
    except Exception:
        return repr(value)[:80]


def made_direction(value: Any) -> tuple[int, int, int] | None:
    """The action of an arbiter's answer; None if it is none."""
    try:
        return DIRECTIONS[index_of(value)]
    except Exception:
        return None


STAY = DIRECTIONS[NULL_ACTION]


def ask_elsewhere(named: Named, count: int, starts: Sequence[tuple[int, str]]) -> list[list[str]]:
    """`Transcript.texts` of a fresh process that is asked these cycles (their index, the memory they begin with) in
    this order. Raises `PartError` when the process ends without an answer."""
    search = os.pathsep.join(path or os.getcwd() for path in sys.path)
    done = subprocess.run(
        [sys.executable, "-m", "app.contracts.asking"],
        input=pickle.dumps((named, count, list(starts))),
        env={**os.environ, **OTHER_SURROUNDINGS, "PYTHONPATH": search},
        capture_output=True,
        timeout=PROCESS_TIMEOUT_S,
    )
    if done.returncode:
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise PartError(f"{named.kind} {named.name!r} ended another process: {' '.join(last)}")
    texts: list[list[str]] = json.loads(done.stdout)
    return texts


def _elsewhere() -> None:
    named, count, starts = pickle.load(sys.stdin.buffer)
    answer, sys.stdout = sys.stdout, sys.stderr  # a part may print
    questions = cycles(count)
    texts = []
    for index, memory in starts:
        texts += ask(named, questions[index : index + 1], memory).texts
    json.dump(texts, answer)


if __name__ == "__main__":
    _elsewhere()
