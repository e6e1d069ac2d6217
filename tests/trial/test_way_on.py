"""An arm that moves by itself keeps to where it can go on from, and still comes to what is probably wanted."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise, takewhile

import numpy as np
import pytest
from numpy.typing import NDArray

from app.autonomy.actions import DIRECTIONS, Direction
from app.autonomy.belief import Belief
from app.autonomy.interface import Feasible
from app.simulated.variants import Changes, changed_study, preset_changes
from app.trial.engine import TrialEngine
from app.trial.goals import Goals, candidates
from app.trial.reasoning import STAY, PartFault
from app.trial.setup import StudySetup, study_setup
from app.trial.values import TrialSetup
from app.trial.way_on import IN_FRONT_M, MARGIN_M
from app.trial.world import open_study, parse_text
from sim.ik import solve
from sim.interface import Vector3
from sim.kinematic import KinematicRobot
from sim.layouts import scene as layout_scene
from sim.obstacles import Obstacles
from sim.open_ways import Ways
from study.definition.study import plan_session
from study.parts.code import Code, sha256_of
from study.parts.shelf import Named
from tests.support.engine_cases import HANDS_OFF, go_to, rows_of, run
from tests.support.hands_off import HandsOff, farthest_m
from tests.support.lab_server import ROOT

STANDS_WITHIN_M = 0.03
"""Of where it was ten seconds before: an arm that goes to and fro for information stands, too."""
TICKS, LAST_TICKS = 120, 20
EXAMPLE = ROOT / "docs" / "examples" / "02_arbiter_with_memory"


@cache
def setup(layout: str = "arc", keep_way_on: bool = True) -> StudySetup:
    """The study that ships, in any layout; alpha is given, so that nothing is calibrated."""
    changes: Changes = {"": {"layout": layout}, "arbiter": {"keep_way_on": keep_way_on}}
    study = changed_study(open_study(None), changes)
    return study_setup(parse_text(study.source_text.replace('alpha = "calibrated"', "alpha = 250.0"), "tested"))


def open_ways(arm: HandsOff) -> NDArray[np.bool_]:
    """To which goals the arm could go on straight from where it is."""
    back_m = 0.0 if arm.world.held else IN_FRONT_M
    ways = Ways(arm.goals.positions_m - np.array((back_m, 0.0, 0.0)), Obstacles(arm.world, arm.scene))
    return ways.open_from(arm.world.position_world_gripper_m) | ~ways.possible


def can_go_on(arm: HandsOff) -> bool:
    """To the clear favourite, or to any goal with reach all around."""
    is_open, favourite = open_ways(arm), int(arm.belief.probabilities.argmax())
    if arm.belief.probabilities[favourite] > 0.5 and is_open[favourite]:
        return True
    x_m, y_m, z_m = arm.world.position_world_gripper_m
    along = [(x, y, z) for x, y, z in DIRECTIONS if abs(x) + abs(y) + abs(z) == 1]
    ends = [(x_m + MARGIN_M * x, y_m + MARGIN_M * y, z_m + MARGIN_M * z) for x, y, z in along]
    return bool(is_open.any()) and not any(solve(end)[1] for end in ends)


def stranded(layout: str, condition: str, kind: str, keep_way_on: bool, arms: int, seed: int) -> list[Vector3]:
    """Where arms stand that cannot go on, having begun in random places with random beliefs."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(arms):
        arm = HandsOff(setup(layout), condition, keep_way_on)
        arm.begin(rng, kind, objects=int(rng.integers(4, 7)))
        done = list(arm.ticks(TICKS))
        stands = farthest_m([tick.place_m for tick in done[-LAST_TICKS:]]) < STANDS_WITHIN_M
        if stands and not can_go_on(arm):
            found.append(done[-1].place_m)
    return found


@pytest.mark.parametrize("kind", ["pickup", "dropoff"])
def test_an_arm_left_alone_never_comes_to_stand_where_it_cannot_go_on(kind: str) -> None:
    assert stranded("arc", "balanced", kind, True, arms=15, seed=3) == []
    assert len(stranded("arc", "balanced", kind, False, arms=15, seed=3)) >= 2, "it makes no difference"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pickup", "dropoff"])
@pytest.mark.parametrize(
    ("condition", "layout"), [("balanced", "crescent"), ("goal_oriented", "crescent"), ("balanced", "arc")]
)
def test_of_two_hundred_arms_left_alone_none_comes_to_stand_where_it_cannot_go_on(
    condition: str, layout: str, kind: str
) -> None:
    """Thirty-four of each kind and sort."""
    assert stranded(layout, condition, kind, True, arms=34, seed=1) == []


def arm_at(position_m: Vector3, condition: str, probable: str, probability: float) -> HandsOff:
    """Open gripper, six objects, one of them that probable."""
    arm = HandsOff(setup(), condition, True)
    scene = layout_scene(setup().layout, setup().study.objects)
    arm.robot.reset(scene)
    arm.robot.put(position_m, None)
    goals = Goals.at(candidates(arm.world, scene))
    others = (1.0 - probability) / (len(goals.ids) - 1)
    belief = [probability if name == probable else others for name in goals.ids]
    arm.start_with(scene, goals, Belief(goals.ids, np.array(belief)))
    return arm


@pytest.mark.parametrize("name", ["spray_bottle", "paper_towels", "sponge_pack"])
def test_goal_oriented_help_goes_all_the_way_to_a_clear_favourite(name: str) -> None:
    arm = arm_at((0.70, 0.0, 0.88), "goal_oriented", name, 0.7)
    x_m, y_m, z_m = dict(arm.goals.places_m)[name]
    arm.robot.put((x_m - 0.15, y_m, z_m), None)
    assert math.dist(list(arm.ticks(40))[-1].place_m, (x_m, y_m, z_m)) < 0.05


@pytest.mark.parametrize("condition", ["goal_oriented", "balanced"])
def test_without_a_favourite_the_way_to_every_object_stays_open(condition: str) -> None:
    arm = arm_at((0.70, 0.0, 0.88), condition, "wipes_tub", 0.45)
    places_m = [tick.place_m for tick in arm.ticks(60) if open_ways(arm).all()]
    assert len(places_m) == 60
    assert farthest_m(places_m) > 0.02, "it did not move at all"


def test_an_object_that_nobody_can_reach_holds_nothing_up() -> None:
    arm = arm_at((0.70, 0.0, 0.88), "goal_oriented", "spray_bottle", 0.1)
    (name, _), *others = arm.goals.places_m
    arm.start_with(arm.scene, Goals.at(((name, (0.9, 0.9, 0.2)), *others)), arm.belief)
    assert len([tick for tick in arm.ticks(10) if tick.place_m != tick.state.position_m]) == 10


def test_a_way_back_is_gone_without_going_to_and_fro() -> None:
    """From between the bins of the layout that ships: each change of direction costs four fifths of a tick."""
    arm = HandsOff(setup("crescent"), "balanced", True)
    arm.begin(np.random.default_rng(1), "dropoff")
    held = arm.world.held
    arm.robot.put((0.546, 0.149, 0.839), held)
    arm.start_with(arm.scene, arm.goals, Belief(arm.goals.ids, np.array([0.29, 0.71])))
    assert not can_go_on(arm)
    actions = [tick.action for tick in takewhile(lambda _: not can_go_on(arm), arm.ticks(TICKS))]
    turns = sum(now != before for before, now in pairwise(actions))
    assert turns <= 3 and len(actions) < TICKS / 2, actions


def trial(keep_way_on: bool, condition: str = "balanced") -> TrialSetup:
    study = setup(keep_way_on=keep_way_on)
    order = (condition, *(name for name in study.arbiters if name != condition))
    return study.trial_setup("p01", plan_session(study.study, order, seed=5), 1, "trial")


def test_it_is_asked_only_with_the_hands_off_and_only_where_the_study_says_so() -> None:
    """Somebody drives in among the objects; from there on the arm is on its own."""
    after = {}
    for keeps in (False, True):
        engine = TrialEngine(trial(keeps), KinematicRobot())
        engine.open()
        rows = rows_of(go_to(engine, (0.80, 0.17, 0.86), "zyx"))
        assert all(row.source == "user" and not row.blocked for row in rows)
        after[keeps] = rows_of(run(engine, [HANDS_OFF] * 30))
    assert after[True] != after[False]
    assert after[True][-1].p_x < 0.78 < after[False][-1].p_x


class Asked(HandsOff):
    """Notes what the arbiter asks in a tick, and what it is told."""

    told: dict[Direction, bool]
    refused = 0
    """How often it could have been done, but not gone on from."""

    def allowed(self) -> Feasible:
        allowed, feasible = super().allowed(), self.feasible()
        self.told = {}

        def answer(action: Direction) -> bool:
            self.told[action] = allowed(action)
            self.refused += not self.told[action] and feasible(action)
            return self.told[action]

        return answer


@cache
def outside() -> StudySetup:
    """The example of an arbiter with a memory, in the world and with the arm of the study that ships."""
    changes = preset_changes("ahead")
    study = changed_study(open_study(EXAMPLE / "study.toml", trust=True), changes, trust=True)
    return study_setup(study, trust=True)


def test_an_arbiter_from_outside_is_told_what_keeps_the_way_on_and_chooses_nothing_else() -> None:
    arm, rng, moved = Asked(outside(), "yielding", True), np.random.default_rng(1), 0
    for _ in range(8):
        arm.begin(rng, "pickup", objects=4)
        for tick in arm.ticks(25):
            assert tick.action == STAY or arm.told[tick.action]
            moved += tick.action != STAY
    assert moved > 50 and arm.refused > 50


def told_off(keep_way_on: bool) -> tuple[int, str]:
    """After how many ticks one that goes straight on, without asking, is told that it cannot; and how."""
    source = (EXAMPLE / "yielding.py").read_text(encoding="utf-8").replace("return self._last\n", "return (1, 0, 0)\n")
    code = Code("arbiter", "yielding.py:Yielding", sha256_of({"yielding.py": source}), {"yielding.py": source})
    engine = TrialEngine(replace(trial(keep_way_on), arbiter=Named("arbiter", code.name, {}, code)), KinematicRobot())
    engine.open()
    for tick in range(TICKS):
        try:
            engine.tick(HANDS_OFF)
        except PartFault as fault:
            return tick, fault.reason
    raise AssertionError("it was never told")


def test_one_that_does_not_ask_is_told_why_it_may_not() -> None:
    may_not, cannot = told_off(True), told_off(False)
    assert may_not[0] < cannot[0], "told before it is among the objects"
    assert cannot[1] == "chose (1, 0, 0), which the arm cannot do from here"
    assert may_not[1] == f"{cannot[1]}, or after which it could not go on (keep_way_on)"
