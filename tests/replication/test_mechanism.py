"""By what an arm is moved, on states and rows made by hand."""

from __future__ import annotations

import json
import math
from dataclasses import fields
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from app.autonomy.arbiters.balanced import Balanced
from app.autonomy.arbiters.weighing import WeightsOfInformation
from app.autonomy.information import expected_information_gain
from app.autonomy.interface import Models
from app.autonomy.transition import TransitionModel
from app.replication.mechanism import Mechanism, moves_of, share_by_place
from app.replication.mechanism_text import picture, table
from app.simulated.variants import changed_study, preset_changes
from app.trial.setup import study_setup
from app.trial.world import open_study, parse_text
from study.records import TickRow
from tests.support.hands_off import HandsOff

GOALS = np.array([[0.8, 0.3, 0.9], [0.8, -0.2, 0.9], [0.9, 0.0, 0.85]])
BELIEF = np.array([0.5, 0.3, 0.2])
PLACE, REST = np.array([0.7, 0.0, 0.9]), np.zeros(3)


def arbiter(information: Any = "next", kind: Any = "replan", delay: float = 0.8) -> Balanced:
    return Balanced(
        WeightsOfInformation(300.0, information=information), Models(6.0, TransitionModel(kind, 0.03, delay))
    )


def test_share_by_place_is_the_range_at_rest_by_the_whole_range() -> None:
    of = arbiter()
    model = of.models.transition
    whole = np.ptp(expected_information_gain(PLACE, REST, GOALS, BELIEF, model, 6.0))
    places_m = PLACE + model.displacements(REST)
    # Staying at a place looks at it at rest: the printed equation gives what one of each place is worth.
    at_rest = [expected_information_gain(place_m, REST, GOALS, BELIEF, model, 6.0)[13] for place_m in places_m]
    assert share_by_place(PLACE, REST, GOALS, BELIEF, of) == pytest.approx(np.ptp(at_rest) / whole, rel=1e-9)
    assert share_by_place(PLACE, REST, GOALS, BELIEF, arbiter("at_rest")) == 1.0
    assert share_by_place(PLACE, REST, GOALS, np.array([1.0, 0.0, 0.0]), of) is None


def test_a_large_delay_makes_it_momentum_and_a_small_one_place() -> None:
    late, soon = (share_by_place(PLACE, REST, GOALS, BELIEF, arbiter(delay=delay)) for delay in (0.8, 0.0))
    assert late is not None and soon is not None
    assert late < 0.15 < soon


def row(tick: int, y_m: float, source: str = "robot", entropy: float = 0.8, cycle: int = 1) -> TickRow:
    known = {
        "participant": "p", "condition": "balanced", "trial": 1, "tick": tick, "cycle": cycle, "trial_s": tick / 2,
        "p_x": 0.7, "p_y": y_m, "p_z": 0.9, "m_x": 0.0, "m_y": 0.0, "m_z": 0.0, "source": source, "blocked": 0,
        "gripper": "open", "after_pause": 0, "entropy": entropy, "digest": "",
        "goals": json.dumps(dict(zip("abc", GOALS.tolist(), strict=True))),
        "belief": json.dumps(dict(zip("abc", BELIEF.tolist(), strict=True))),
    }  # fmt: skip
    left_out = {field.name: None for field in fields(TickRow) if field.name not in known}
    return TickRow(**{**left_out, **known, "attempt": 1})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("places_m", "moves", "reversals"),
    [
        ((0.0, 0.01, 0.02, 0.03), 2, 0),
        ((0.0, 0.01, 0.0, 0.01), 2, 2),
        ((0.0, 0.01, 0.01, 0.0), 0, 0),  # it stood in between
        ((0.0, 0.01, 0.0), 1, 1),
    ],
)
def test_a_reversal_is_a_move_against_the_one_before(places_m: tuple[float, ...], moves: int, reversals: int) -> None:
    found = moves_of({"ticks": [row(tick, y_m) for tick, y_m in enumerate(places_m)]}, "balanced", arbiter())
    assert (found.moves, found.reversed) == (moves, reversals)
    assert found.looked == 1 and 0.0 < found.share < 1.0


def test_what_a_person_does_and_what_is_sure_is_not_counted() -> None:
    places_m = (0.0, 0.01, 0.0, 0.01)
    for changed in ({"source": "user"}, {"entropy": 0.2}):
        rows = [row(tick, y_m, **changed) for tick, y_m in enumerate(places_m)]
        assert moves_of({"ticks": rows}, "balanced", arbiter()).moves == 0
    apart = [row(tick, y_m, cycle=1 + tick // 2) for tick, y_m in enumerate(places_m)]
    assert moves_of({"ticks": apart}, "balanced", arbiter()).moves == 0
    assert moves_of({"ticks": apart}, "teleoperation", arbiter()).looked == 0


def turns_back(preset: str) -> float:
    """How often an arm that nobody drives goes against its last move; alpha is given, so that nothing is calibrated."""
    study = changed_study(open_study(None), preset_changes(preset))
    text = study.source_text.replace('alpha = "calibrated"', "alpha = 245.0")
    arm, rng, products = (
        HandsOff(study_setup(parse_text(text, "tested")), "balanced", True),
        np.random.default_rng(2),
        [],
    )
    for _ in range(4):
        arm.begin(rng, "pickup")
        places_m = np.array([tick.place_m for tick in arm.ticks(50)])
        ways_m = np.diff(places_m, axis=0)
        products += np.einsum("ni,ni->n", ways_m[1:], ways_m[:-1]).tolist()
    return float(np.mean(np.array(products) < 0.0))


def test_a_steady_arm_seldom_turns_back() -> None:
    assert turns_back("steady") < 0.15 < turns_back("shipped")


def variant(name: str, share: float, signs: float, gain: float = 0.01) -> Mechanism:
    return Mechanism(name, 250.0, "next", share, 0.3, (160.0, 90.0, 120.0), (0.005, 0.007, gain), signs)


def test_the_picture_has_a_labelled_mark_for_each_variant_and_points_two_out() -> None:
    found = [variant("fitted", 0.04, 12.0), variant("close <by>", 0.05, 12.0), variant("unknown", math.nan, 3.0)]
    drawn = ElementTree.fromstring(picture(found, {"fitted"}))
    labels = [
        (text.text, text.get("y")) for text in drawn.findall(".//{*}text") if text.text in ("fitted", "close <by>")
    ]
    assert len(labels) == len(set(labels)) == 4, "labels lie on one another"
    assert len(list(drawn.findall(".//{*}circle"))) == 4
    assert {c.get("r") for c in drawn.findall(".//{*}circle")} == {"7", "4.5"}
    assert "unknown" not in picture(found, ())


def test_a_mark_at_the_end_of_the_picture_is_whole() -> None:
    drawn = ElementTree.fromstring(picture([variant("at_rest", 1.0, 13.0)], {"at_rest"}))
    width = float(drawn.attrib["viewBox"].split()[2])
    assert all(float(mark.attrib["cx"]) + 12.0 < width for mark in drawn.findall(".//{*}circle"))


def test_the_table_ends_with_the_paper_and_says_nothing_of_what_is_not_known() -> None:
    lines = table([variant("fitted", 0.04, 12.0, math.nan)]).splitlines()
    assert "4%" in lines[1] and "5.0/7.0/-" in lines[1] and "nan" not in lines[1]
    assert lines[-1].startswith("paper") and "148/105/122" in lines[-1]
