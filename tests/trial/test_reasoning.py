"""What becomes of an arbiter or an inference that cannot be used: its reason, and nothing has moved."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.trial.engine import TrialEngine
from app.trial.reasoning import Limit, PartFault, TookTooLong
from app.trial.values import CycleStart, TrialSetup, inputs_of
from sim.kinematic import KinematicRobot
from study.parts.code import Code, sha256_of
from study.parts.shelf import Named
from tests.support.engine_cases import FORWARD, HANDS_OFF, Person, StagedRobot, drive, push, run, trial_setup

HEADER = """
from app.autonomy.belief import Belief
from app.autonomy.interface import Arbiter, GoalInference
import numpy as np
class Part(Arbiter):
    def decide(self, state, belief, user, feasible):
        return user or (0, 0, 0)
"""


def code(kind: str, source: str, name: str = "own.py:Own") -> Code:
    files = {name.partition(":")[0]: source}
    return Code(kind, name, sha256_of(files), files)


def arbiter(body: str) -> Named:
    """An arbiter whose `decide` does this, or with this whole body."""
    whole = body if "def " in body else f"    def decide(self, state, belief, user, feasible):\n        {body}\n"
    return Named("arbiter", "own.py:Own", {}, code("arbiter", f"{HEADER}\nclass Own(Part):\n{whole}"))


def inference(body: str) -> Named:
    source = f"{HEADER}\nclass Own(GoalInference):\n    def update(self, state, belief, user):\n        {body}\n"
    return Named("inference", "own.py:Own", {}, code("inference", source))


def setup_with(part: Named) -> TrialSetup:
    setup = trial_setup("teleoperation")
    return replace(setup, arbiter=part) if part.kind == "arbiter" else replace(setup, inference=part)


@contextmanager
def late() -> Iterator[None]:
    """A limit that is over at once."""
    yield
    raise TookTooLong("took longer than 100 ms")


def opened(part: Named, robot: Any = None, limit: Limit = nullcontext) -> TrialEngine:
    engine = TrialEngine(setup_with(part), robot or KinematicRobot(), limit=limit)
    engine.open()
    return engine


ARBITER, INFERENCE = "arbiter 'own.py:Own'", "inference 'own.py:Own'"
FAULTS = [
    (arbiter("raise KeyError('goal')"), ARBITER, "raised KeyError: 'goal'"),
    (arbiter("raise SystemExit(3)"), ARBITER, "raised SystemExit: 3"),
    (arbiter("return belief.probabilities[99]"), ARBITER, "raised IndexError: "),
    (arbiter("return None"), ARBITER, "returned None; it must be three numbers, each -1, 0 or 1"),
    (arbiter("return (float('nan'), 0, 0)"), ARBITER, "returned (nan, 0, 0); it must be three numbers"),
    (arbiter("return (2, 0, 0)"), ARBITER, "returned (2, 0, 0); it must be three numbers"),
    (arbiter("return 'forward'"), ARBITER, "returned 'forward'; it must be three numbers"),
    (arbiter("return (0, 0, -1)"), ARBITER, "chose (0, 0, -1), which the arm cannot do from here"),
    (
        arbiter("    moves_by_itself = False\n    def decide(self, state, *_):\n        return (0, 0, 1)"),
        ARBITER,
        "returned (0, 0, 1) with the hands off; it says that it does not move by itself",
    ),
    (arbiter("self.memory = {1, 2}; return (0, 0, 0)"), ARBITER, "has a memory that is not JSON: Object of type set"),
    (arbiter("self.memory = float('inf'); return (0, 0, 0)"), ARBITER, "has a memory that is not JSON: "),
    (arbiter("self.memory = 'x' * 65535; return (0, 0, 0)"), ARBITER, "has a memory of 65537 bytes; at most 65536"),
    (
        arbiter("state.goals_m[0] = 9.0; return (0, 0, 0)"),
        ARBITER,
        "raised ValueError: assignment destination is",
    ),
    (
        arbiter("belief.probabilities[0] = 1.0; return (0, 0, 0)"),
        ARBITER,
        "raised ValueError: assignment destination is",
    ),
    (arbiter("state.position_m = (0, 0, 0)"), ARBITER, "raised FrozenInstanceError: "),
    (inference("raise ValueError('no\\nmodel')"), INFERENCE, "raised ValueError: no model"),
    (inference("return belief.probabilities"), INFERENCE, "returned array("),
    (inference("return None"), INFERENCE, "returned None; it must return a Belief"),
    (inference("return Belief.uniform(state.goal_ids[1:])"), INFERENCE, "returned a belief over "),
    (inference("return Belief.uniform(state.goal_ids[::-1])"), INFERENCE, "returned a belief over "),
    (
        inference("return Belief(state.goal_ids, belief.probabilities * np.nan)"),
        INFERENCE,
        "raised AutonomyError: belief is ",
    ),
    (inference("self.memory = object(); return belief"), INFERENCE, "has a memory that is not JSON: "),
]


class Boxed(KinematicRobot):
    """One that cannot go down."""

    def feasible(self, displacements_m: Any) -> Any:
        return super().feasible(displacements_m) & (displacements_m[:, 2] >= 0.0)


@pytest.mark.parametrize(("part", "called", "reason"), FAULTS, ids=[reason[:40] for *_, reason in FAULTS])
def test_a_part_that_cannot_be_used_is_told_before_anything_moves(part: Named, called: str, reason: str) -> None:
    robot = Boxed()
    engine = opened(part, robot)
    before = robot.observe()
    with pytest.raises(PartFault) as fault:
        engine.begin(HANDS_OFF)
    assert fault.value.part == called
    assert fault.value.reason.startswith(reason)
    assert "\n" not in str(fault.value)
    assert str(fault.value) == f"{called} {fault.value.reason}"
    assert robot.observe().digest() == before.digest()
    assert engine.next_tick == 0


def test_no_command_reaches_the_robot() -> None:
    robot = StagedRobot()
    engine = opened(arbiter("raise KeyError"), robot)
    with pytest.raises(PartFault):
        engine.begin(push(FORWARD))
    assert robot.commands == []


@pytest.mark.parametrize("part", [arbiter("return user or (0, 0, 0)"), inference("return belief")])
def test_one_that_takes_too_long_is_told(part: Named) -> None:
    """The inference is asked first, whichever it is that the study brought."""
    with pytest.raises(PartFault, match="took longer than 100 ms"):
        opened(part, limit=late).begin(HANDS_OFF)


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("1 / 0", "cannot be loaded: ZeroDivisionError: division by zero"),
        ("class Own: pass", "lacks decide; it must have decide"),
        (
            f"{HEADER}\nclass Own(Part):\n    def __init__(self, *_): raise OSError('no')",
            "cannot be made: OSError",
        ),
        (
            f"{HEADER}\nclass Own(Part):\n    memory = property(lambda self: 1)",
            "raised AttributeError",
        ),
    ],
)
def test_one_that_cannot_be_made_is_told_as_a_fault(source: str, reason: str) -> None:
    part = Named("arbiter", "own.py:Own", {}, code("arbiter", source))
    engine = TrialEngine(setup_with(part), KinematicRobot(), CycleStart(1, 0, (), "1", ""))
    with pytest.raises(PartFault, match=reason):
        engine.open()


def test_code_that_is_not_what_its_hash_says_is_no_part() -> None:
    part = arbiter("return (0, 0, 0)")
    assert part.code is not None
    other = replace(part, code=replace(part.code, sha256="0" * 64))
    with pytest.raises(PartFault, match="its source is not the one its SHA-256 0000"):
        opened(other)


# --- what it may do ------------------------------------------------------------------------------------------------


def test_the_persons_own_action_may_always_be_chosen() -> None:
    (result,) = run(opened(arbiter("return user or (0, 0, 0)"), Boxed()), [push((0, 0, -1))])
    assert (result.row.action_z, result.row.source) == (-1, "user")


def test_nothing_that_a_part_writes_reaches_the_record() -> None:
    """It may write into what is its own: copies."""
    part = arbiter("goals = state.goals_m.copy(); goals[:] = 9.0; return user or (0, 0, 0)")
    (mine,) = run(opened(part), [push(FORWARD)])
    (plain,) = run(opened(arbiter("return user or (0, 0, 0)")), [push(FORWARD)])
    assert mine.row == plain.row


EXPLAINING = "    def explain(self, state, belief, user, action):\n        {}\n"


@pytest.mark.parametrize(
    ("body", "shown"),
    [
        ("return {'share': 1, 'goal': 'front', 'sure': True}", {"share": 1.0, "goal": "front", "sure": "True"}),
        ("return {'far': float('inf')}", {"far": "inf"}),
        ("raise KeyError('x')", {"explanation": "failed: arbiter 'own.py:Own' raised KeyError: 'x'"}),
        ("return 'because'", {"explanation": "failed: arbiter 'own.py:Own' raised AttributeError: "}),
        ("return None", {"explanation": "failed: arbiter 'own.py:Own' raised AttributeError: "}),
    ],
)
def test_an_explanation_that_fails_is_a_line_of_it_and_harms_nothing(body: str, shown: dict[str, Any]) -> None:
    engine = opened(arbiter(EXPLAINING.format(body)))
    assert engine.explain() == {}
    run(engine, [push(FORWARD)])
    told = engine.explain()
    assert list(told) == list(shown)
    for name, value in shown.items():
        assert str(told[name]).startswith(str(value)), told
    assert run(engine, [push(FORWARD)])[0].row.tick == 1


def test_an_explanation_is_cut_to_what_can_be_shown() -> None:
    engine = opened(arbiter(EXPLAINING.format("return {f'{n:03}' * 99: 'x' * 999 for n in range(99)}")))
    run(engine, [push(FORWARD)])
    told = engine.explain()
    assert len(told) == 24
    assert {len(name) for name in told} == {60}
    assert {len(str(value)) for value in told.values()} == {200}


# --- memory -----------------------------------------------------------------------------------------------------------


def counting() -> Named:
    source = Path(__file__).resolve().parents[1].joinpath("support", "parts", "faulty.py").read_text(encoding="utf-8")
    name = "faulty.py:Counting"
    return Named("arbiter", name, {}, code("arbiter", source, name))


def test_a_counting_arbiter_goes_on_with_its_count_at_every_cycle() -> None:
    setup = setup_with(counting())
    engine = TrialEngine(setup, KinematicRobot())
    engine.open()
    person = Person()

    def hands(of: TrialEngine) -> Any:
        return HANDS_OFF if of.next_tick % 4 == 1 else person(of)

    results = drive(engine, hands, at_most=900)
    starts = [result.cycle_start for result in results if result.cycle_start is not None]
    assert len(starts) == len(setup.cycles) - 1
    counts = [int(start.arbiter_memory) for start in starts]
    assert 0 < counts[0] < counts[1]
    assert any(result.row.source == "robot" and result.row.action_z == 1 for result in results)
    for start in starts:
        again = TrialEngine(setup, KinematicRobot(), start)
        again.open()
        rest = [result.row for result in results][start.first_tick :]
        assert [result.row for result in run(again, [inputs_of(row) for row in rest])] == rest
