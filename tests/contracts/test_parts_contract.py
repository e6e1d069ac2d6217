"""The contract of arbiters and inferences: the shipped parts keep it, and each way to break it is told in its line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.contracts.arbiter import ArbiterContract
from app.contracts.candidate import Candidate
from app.contracts.inference import InferenceContract
from app.contracts.part import usable
from app.contracts.verdict import Failed
from app.trial.parts import ARBITERS, INFERENCES


class TestTeleoperation(ArbiterContract):
    arbiter = "teleoperation"


class TestGoalOriented(ArbiterContract):
    arbiter = "goal_oriented"


class TestBalanced(ArbiterContract):
    arbiter = "balanced"
    parameters = {"alpha": 375.0}  # noqa: RUF012 - as an author writes it


class TestBoltzmann(InferenceContract):
    inference = "boltzmann"


def test_every_part_that_ships_is_held_to_it() -> None:
    held = {suite.arbiter for suite in ArbiterContract.__subclasses__()}
    assert set(ARBITERS.shipped) <= held
    assert {suite.inference for suite in InferenceContract.__subclasses__()} >= set(INFERENCES.shipped)


# --- parts that keep it, with what an author may want -------------------------------------------------------------

HEADER = """
import random, time, os
from dataclasses import dataclass, field
from typing import Annotated, Literal
import numpy as np
from annotated_types import Ge, Gt, Le
from app.autonomy.actions import DIRECTIONS
from app.autonomy.belief import Belief
from app.autonomy.interface import Arbiter, GoalInference

STAY = (0, 0, 0)

def first(feasible):
    return next(action for action in DIRECTIONS if feasible(action))
"""


def arbiter(body: str, before: str = "", attributes: str = "") -> str:
    """The source of an arbiter whose `decide` does this."""
    lines = "".join(f"        {line}\n" for line in body.splitlines())
    return (
        f"{HEADER}\n{before}\n\nclass Bad(Arbiter):\n    {attributes or 'pass'}\n"
        f"    def decide(self, state, belief, user, feasible):\n{lines}"
    )


def inference(body: str, before: str = "", attributes: str = "") -> str:
    """The source of an inference whose `update` does this."""
    lines = "".join(f"        {line}\n" for line in body.splitlines())
    return (
        f"{HEADER}\n{before}\n\nclass Bad(GoalInference):\n    {attributes or 'pass'}\n"
        f"    def update(self, state, belief, user):\n{lines}"
    )


def candidate(folder: Path, source: str, kind: str = "arbiter", **given: Any) -> Candidate:
    (folder / "bad.py").write_text(source, encoding="utf-8")
    return Candidate(kind, "bad.py:Bad", folder, given)


def checks(contract: type) -> list[str]:
    return [name for name in dir(contract) if name.startswith("test_")]


def keep(contract: Any, part: Candidate) -> list[tuple[str, Any]]:
    """Do every check of a part; what they leave in the report."""
    told: list[tuple[str, Any]] = []
    for name in checks(contract):
        more = {"record_property": lambda *item: told.append(item)} if name.endswith("within_the_limit") else {}
        getattr(contract(), name)(part, **more)
    return told


PARAMETERS = """
@dataclass(frozen=True)
class Parameters:
    share: Annotated[float, Gt(0.0), Le(1.0)]
    ticks: Annotated[int, Ge(1)]
    manner: Literal["bold", "shy"]
    kept: bool = True
"""
REMEMBERS = """
self.memory = {"asked": self.memory["asked"] + 1, "last": list(user or STAY)}
if user is not None:
    return user
return first(feasible) if self.memory["asked"] % 2 else STAY
"""


def test_one_with_required_parameters_and_a_memory_keeps_it(tmp_path: Path) -> None:
    source = arbiter(REMEMBERS, PARAMETERS, 'Parameters = Parameters\n    memory = {"asked": 0}')
    part = candidate(tmp_path, source)
    ((name, told),) = keep(ArbiterContract, part)
    assert name == "salab_slowest_answer"
    assert told.startswith("arbiter 'bad.py:Bad': the slowest of 240 answers took ")
    assert part.named.parameters == {"share": 0.5, "ticks": 2, "manner": "bold", "kept": True}


def test_an_inference_with_a_memory_keeps_it(tmp_path: Path) -> None:
    source = inference(
        "self.memory += 1\nkept = 0.9 * belief.probabilities + 0.1 / len(state.goal_ids)\n"
        "return Belief(state.goal_ids, kept / kept.sum()) if user else belief",
        attributes="memory = 0",
    )
    keep(InferenceContract, candidate(tmp_path, source, "inference"))


def test_what_it_takes_may_be_given(tmp_path: Path) -> None:
    part = candidate(tmp_path, arbiter("return STAY", PARAMETERS, "Parameters = Parameters"), share=0.25)
    assert part.named.parameters["share"] == 0.25


# --- parts that break it ------------------------------------------------------------------------------------------

OWN = "return user or STAY"
BROKEN = {
    "raises": ("answers_every_question", arbiter("return DIRECTIONS[len(state.goal_ids) * 5]"), "raised IndexError"),
    "writes into the goals": (
        "answers_every_question",
        arbiter("state.goals_m[0] = 0.0\nreturn user or STAY"),
        "raised ValueError: assignment destination is read-only; what it is given is read-only, so copy it first",
    ),
    "writes into the belief": (
        "answers_every_question",
        arbiter("belief.probabilities[0] = 1.0\nreturn user or STAY"),
        "read-only, so copy it first",
    ),
    "hangs": ("answers_every_question", arbiter("while True: pass"), "it raised no answer within 0.5 s"),
    "NaN": (
        "answers_with_directions",
        arbiter("return (float('nan'), 0, 0)"),
        r"returned \(nan, 0, 0\); decide must return three numbers, each -1, 0 or 1",
    ),
    "None": ("answers_with_directions", arbiter("return user"), "returned None; decide must return"),
    "impossible": (
        "chooses_only_what_can_be_done",
        arbiter("return (1, 1, 1)"),
        r"chose \(1, 1, 1\), which the arm cannot do: ask feasible\(action\) first",
    ),
    "moves and says it does not": (
        "stays_with_the_hands_off_unless_it_moves_by_itself",
        arbiter("return user or first(feasible)", attributes="moves_by_itself = False"),
        "with the hands off, but moves_by_itself is False",
    ),
    "says neither": (
        "stays_with_the_hands_off_unless_it_moves_by_itself",
        arbiter(OWN, attributes="moves_by_itself = 'seldom'"),
        "moves_by_itself is 'seldom'; it must be True or False",
    ),
    "random": (
        "asked_anew_it_answers_the_same",
        arbiter("return random.choice([a for a in DIRECTIONS if feasible(a)])"),
        r"answers differently when it is made anew .* take no randomness",
    ),
    "reads the clock": (
        "asked_anew_it_answers_the_same",
        arbiter("self.memory = time.time()\nreturn user or STAY"),
        "read no clock",
    ),
    "iterates over a set": (
        "another_process_hears_the_same",
        arbiter("self.memory = list({f'goal {n}' for n in range(30)})\nreturn user or STAY"),
        "answers differently in another process: iterate over no set",
    ),
    "reads the environment": (
        "another_process_hears_the_same",
        arbiter("return (1, 0, 0) if os.environ.get('TZ') else STAY"),
        "no environment",
    ),
    "keeps hidden state": (
        "its_memory_is_all_it_keeps",
        arbiter("SEEN.append(1)\nreturn (1, 0, 0) if len(SEEN) > 100 else STAY", "SEEN = []"),
        r"restored at a cycle's start: it keeps hidden state in the class or the module; put it into self\.memory",
    ),
    "remembers what is no JSON": (
        "its_memory_is_json_and_small",
        arbiter("self.memory = {(1, 2): 3}\nreturn STAY"),
        r"its memory is not JSON \(keys must be str",
    ),
    "remembers NaN": ("its_memory_is_json_and_small", arbiter("self.memory = float('nan')\nreturn STAY"), "not JSON"),
    "remembers everything": (
        "its_memory_is_json_and_small",
        arbiter(
            "self.memory = [*self.memory, list(state.position_m), [float(x) for x in belief.probabilities]]\n"
            "return STAY",
            attributes="memory = ()",
        ),
        r"its memory has \d+ bytes at \d+ ticks; at most 65536: keep sums or the last few",
    ),
    "is slow": (
        "thinks_within_the_limit",
        arbiter("began = time.process_time()\nwhile time.process_time() - began < 0.15: pass\nreturn STAY"),
        r"the slowest of \d+ answers took \d+\.\d ms; it is given 100 ms",
    ),
    "sleeps": (
        "thinks_within_the_limit",
        arbiter("time.sleep(0.15)\nreturn STAY"),
        "it is given 100 ms: think less",
    ),
    "slow in a trial": (
        "a_trial_run_again_gives_the_same_rows",
        arbiter("time.sleep(0.15)\nreturn STAY"),
        "too slow for a trial",
    ),
    "a loose bound": (
        "its_parameters_are_fields_of_a_study_file",
        arbiter(
            OWN,
            "@dataclass(frozen=True)\nclass Parameters:\n    share: Annotated[float, Ge(0.0)] = -1.0",
            "Parameters = Parameters",
        ),
        r"the default -1\.0 of share must be a number at least 0\.0: change it, or the bound",
    ),
}
EXPLAINING = {
    "a list": ("return {'belief': [1, 2]}", "explain gives belief the value .* it must be a number or a text"),
    "no dict": ("return 'because'", "explain returned 'because'; it must return names and values"),
    "a long name": ("return {'x' * 61: 1.0}", "names are texts of 1 to 60"),
    "too much": ("return {str(n): n for n in range(25)}", "explain returned 25 values; at most 24 are shown"),
    "an error": ("return {'share': 1 / 0}", "explain raised ZeroDivisionError: division by zero"),
}
MEDDLING = {
    "memory": ("self.memory = 1\n        return {}", "explain changes the memory"),
    "later answers": (
        "self.told = True\n        return {}",
        r"explain changes a later answer, \(0, 0, 0\) to \(1, 0, 0\)",
    ),
}


@pytest.mark.parametrize(("check", "source", "told"), BROKEN.values(), ids=list(BROKEN))
def test_an_arbiter_that_breaks_it_is_told_what_to_mend(tmp_path: Path, check: str, source: str, told: str) -> None:
    part = candidate(tmp_path, source)
    (name,) = [name for name in checks(ArbiterContract) if name.endswith(check)]
    more = {"record_property": lambda *_: None} if name.endswith("within_the_limit") else {}
    with pytest.raises(Failed, match=told) as failed:
        getattr(ArbiterContract(), name)(part, **more)
    assert "\n" not in str(failed.value)
    assert str(failed.value).startswith("arbiter 'bad.py:Bad'")


def explaining(body: str) -> str:
    decide = "return (1, 0, 0) if getattr(self, 'told', False) else STAY"
    return arbiter(decide) + f"    def explain(self, state, belief, user, action):\n        {body}\n"


@pytest.mark.parametrize(("body", "told"), EXPLAINING.values(), ids=list(EXPLAINING))
def test_an_explanation_that_cannot_be_shown_is_told(tmp_path: Path, body: str, told: str) -> None:
    with pytest.raises(Failed, match=told):
        ArbiterContract().test_it_explains_in_short_names_and_numbers_or_texts(candidate(tmp_path, explaining(body)))


@pytest.mark.parametrize(("body", "told"), MEDDLING.values(), ids=list(MEDDLING))
def test_an_explanation_that_changes_something_is_told(tmp_path: Path, body: str, told: str) -> None:
    with pytest.raises(Failed, match=told):
        ArbiterContract().test_explaining_changes_nothing(candidate(tmp_path, explaining(body)))


TRIALS = {
    "random": (
        arbiter("return user or random.choice([a for a in DIRECTIONS if feasible(a)])"),
        "test_a_trial_run_again_gives_the_same_rows",
        r"run again, a trial is not the same from tick \d+ on .*: take no randomness",
    ),
    "hidden state": (
        arbiter(
            "SEEN[0] = SEEN[0] + 1 if state.tick else 0\nmoves = [a for a in DIRECTIONS if feasible(a)]\n"
            "return user or moves[SEEN[0] // 50 % len(moves)]",
            "SEEN = [0]",
        ),
        "test_a_trial_resumed_at_any_cycle_gives_the_same_rows",
        r"resumed at cycle \d, a trial is not the same from tick \d+ on .*keep everything in self\.memory",
    ),
    "raises late": (
        arbiter("return user or DIRECTIONS[13 + (state.tick > 40) * 20]"),
        "test_a_trial_run_again_gives_the_same_rows",
        r"arbiter 'bad\.py:Bad' raised IndexError: .*; a trial pauses there",
    ),
}


@pytest.mark.parametrize(("source", "check", "told"), TRIALS.values(), ids=list(TRIALS))
def test_a_whole_trial_finds_it_too(tmp_path: Path, source: str, check: str, told: str) -> None:
    with pytest.raises(Failed, match=told):
        getattr(ArbiterContract(), check)(candidate(tmp_path, source))


BELIEFS = {
    "other goals": (
        "return Belief(tuple(reversed(state.goal_ids)), belief.probabilities)",
        "returned a belief over .*; the goals are .*, in this order: take state.goal_ids",
    ),
    "numbers": ("return belief.probabilities", r"returned array\(.*; update must return a Belief"),
    "a sum of 2": ("return Belief(state.goal_ids, 2 * belief.probabilities)", "must answer in every state; it raised"),
    "NaN": ("return Belief(state.goal_ids, belief.probabilities * np.nan)", "must answer in every state; it raised"),
}


@pytest.mark.parametrize(("body", "told"), BELIEFS.values(), ids=list(BELIEFS))
def test_a_belief_that_is_none_is_told(tmp_path: Path, body: str, told: str) -> None:
    part = candidate(tmp_path, inference(body), "inference")
    check: Callable[..., None] = InferenceContract.test_it_answers_every_question
    if "every state" not in told:
        check = InferenceContract.test_it_answers_with_a_belief_over_the_same_goals
    with pytest.raises(Failed, match=told):
        check(InferenceContract(), part)


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("class Bad: pass", "arbiter 'bad.py:Bad' lacks decide; it must have decide"),
        ("import nowhere", "cannot be loaded: ModuleNotFoundError: No module named 'nowhere'"),
        ("class Other: pass", "bad.py has no Bad"),
        (arbiter(OWN, PARAMETERS.replace("frozen=True", ""), "Parameters = Parameters"), "must be a frozen dataclass"),
        (arbiter(OWN, PARAMETERS, "Parameters = Parameters"), "share, which must be a number above 0.0 .*--parameters"),
        (arbiter(OWN) + "    def __init__(self, *_): raise OSError('no model')\n", "cannot be made: OSError: no model"),
    ],
)
def test_one_that_cannot_be_made_is_one_line(tmp_path: Path, source: str, told: str) -> None:
    given: dict[str, Any] = {"share": 2.0} if "share" in told else {}
    with pytest.raises(Failed, match=told) as failed:
        usable(candidate(tmp_path, source, **given))
    assert "\n" not in str(failed.value)


def test_the_transcript_of_a_part_that_is_too_slow_is_cut_short(tmp_path: Path) -> None:
    part = candidate(tmp_path, arbiter("time.sleep(0.12)\nreturn STAY"))
    assert part.transcript.cut_short and len(part.transcript.answers) == 3
    assert json.loads(json.dumps(part.transcript.texts)) == [["(0, 0, 0) null"] * 3]
