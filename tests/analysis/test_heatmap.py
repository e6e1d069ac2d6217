"""The paper's Fig. 2 as a product: what it draws is what the arbiter evaluates, and it says what it shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.autonomy.actions import DIRECTIONS, NULL_ACTION
from app.autonomy.belief import belief_entropy
from app.autonomy.information import expected_information_gain
from app.autonomy.looking import Looking, Place, look
from app.autonomy.transition import TransitionModel
from app.errors import LabError
from app.report.figure2 import MOMENTA, fig2_heatmap
from study.analysis.figures import heatmap_figure
from study.analysis.heatmap import COLUMNS, Heatmap, nearness, share_of_range

FITTED = {
    "alpha": 431.0,
    "rationality_per_m": 6.31,
    "transition": {"kind": "replan", "step_m": 0.03, "planning_delay": 0.8},
}


@pytest.fixture(scope="module")
def fitted() -> Heatmap:
    return fig2_heatmap({}, FITTED)


def place(heatmap: Heatmap, x_m: float, y_m: float) -> tuple[int, int]:
    return int(np.abs(heatmap.x_m - x_m).argmin()), int(np.abs(heatmap.y_m - y_m).argmin())


def test_both_maps_rise_toward_the_likely_goals_and_the_goals_one_more(fitted: Heatmap) -> None:
    """What the paper's text says, as far as the equations give it; the rest of the sentence is in the caption."""
    for heatmap in (fig2_heatmap({}, {"rationality_per_m": 5.0}), fitted):
        assert heatmap.information.shape == heatmap.reward.shape == (len(heatmap.x_m), len(heatmap.y_m))
        assert sum(goal.probability for goal in heatmap.goals) == pytest.approx(1.0)
        assert [goal.name for goal in heatmap.goals if goal.probability > 0.3] == ["A", "D"]
        information, reward = nearness(heatmap, heatmap.information), nearness(heatmap, heatmap.reward)
        assert information.likely > information.everywhere
        assert reward.likely > reward.everywhere
        assert reward.likely - reward.other > information.likely - information.other
        assert reward.best_near > information.best_near


def test_information_is_what_the_arbiter_evaluates_there(fitted: Heatmap) -> None:
    """A place's value is the largest of eq. 11 at x' = T(x, u) over the moves within the plane that end at it."""
    heatmap = fitted
    row, column = place(heatmap, 0.75, 0.10)
    z_m = float(np.mean([0.73 + height for height in (0.12, 0.12, 0.12, 0.11, 0.11, 0.10)]))
    goals_m = np.array([(goal.x_m, goal.y_m, z_m) for goal in heatmap.goals])
    belief = np.array([goal.probability for goal in heatmap.goals])
    model = TransitionModel("replan", 0.03, 0.8)
    here_m = np.array([heatmap.x_m[row], heatmap.y_m[column], z_m])
    found = {}
    for index, direction in enumerate(DIRECTIONS):
        if direction[2] == 0:
            before_m = here_m - model.displacements((0.0, 0.0, 0.0))[index]
            gains = expected_information_gain(before_m, (0.0, 0.0, 0.0), goals_m, belief, model, 6.31)
            found[direction] = float(gains[index])
    assert heatmap.information[row, column] == pytest.approx(max(found.values()), rel=1e-9)
    at_rest = fig2_heatmap({}, FITTED, momentum="rest").information[row, column]
    assert at_rest == pytest.approx(found[0, 0, 0], rel=1e-9)
    assert at_rest < heatmap.information[row, column]


@pytest.mark.parametrize(("information", "momentum"), [("at_rest", "rest"), ("averaged", "averaged")])
def test_an_arbiter_that_looks_otherwise_is_drawn_as_it_looks(information: Place, momentum: str) -> None:
    heatmap = fig2_heatmap({}, {**FITTED, "information": information})
    assert MOMENTA[momentum] in heatmap.caption
    row, column = place(heatmap, 0.75, 0.10)
    here_m = np.array([heatmap.x_m[row], heatmap.y_m[column], 0.73 + 0.68 / 6.0])
    goals_m = np.array([(goal.x_m, goal.y_m, here_m[2]) for goal in heatmap.goals])
    belief = np.array([goal.probability for goal in heatmap.goals])
    model = TransitionModel("replan", 0.03, 0.8)
    looked = look(Looking(information), here_m, np.zeros(3), goals_m, belief, model, 6.31)[NULL_ACTION]
    assert heatmap.information[row, column] == pytest.approx(looked, rel=1e-9)


def test_both_colours_are_shares_of_the_maps_own_range_where_the_arm_can_be(fitted: Heatmap) -> None:
    heatmap = fitted
    for values in (heatmap.information, heatmap.reward):
        shares = share_of_range(values)
        assert (np.nanmin(shares), np.nanmax(shares)) == (0.0, 1.0)
    row, column = place(heatmap, 0.52, 0.0)
    assert np.isnan(heatmap.information[row, column]), "straight ahead the arm cannot fold so far"
    assert (share_of_range(np.full((2, 2), 3.0)) == 0.0).all(), "a flat map has no range"
    drawn = heatmap_figure(heatmap)
    for stated in ("A .34", "F .08", "share of the map's own range", "in the score"):
        assert stated in drawn.svg
    assert "So A does not favour likely goals over the others (+0.01), B favours likely goals" in drawn.caption


def test_the_table_holds_what_is_drawn(fitted: Heatmap) -> None:
    heatmap = fitted
    lines = heatmap_figure(heatmap).table.splitlines()
    assert lines[0].split(",") == list(COLUMNS)
    assert len(lines) - 1 == int(np.isfinite(heatmap.reward).sum())
    values = dict(zip(COLUMNS, map(float, lines[1].split(",")), strict=True))
    row, column = place(heatmap, values["x_m"], values["y_m"])
    assert values["reward_m"] == pytest.approx(heatmap.reward[row, column], rel=1e-5)
    f1 = belief_entropy(np.array([goal.probability for goal in heatmap.goals]))
    assert values["weighted_information_m"] == pytest.approx(431.0 * f1 * values["information"], rel=1e-4)
    assert values["weighted_reward_m"] == pytest.approx(values["reward_m"] / f1, rel=1e-4)


def test_a_belief_or_momentum_that_cannot_be_is_told_with_its_bounds() -> None:
    with pytest.raises(LabError, match=r"likely is 0.6; each of two likely ones of 6 goals has from 0.167 to 0.5"):
        fig2_heatmap({}, FITTED, likely=0.6)
    with pytest.raises(LabError, match="'last'; choices are best, rest, averaged"):
        fig2_heatmap({}, FITTED, momentum="last")
    even = fig2_heatmap({}, FITTED, likely=1 / 6)
    assert "All goals are equally likely." in even.sentence()


def test_the_command_writes_picture_and_table_and_says_what_they_show(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["figure2", "--preset", "fitted", "--out", str(tmp_path / "new" / "maps.svg")]) == 0
    assert sorted(file.name for file in (tmp_path / "new").iterdir()) == ["maps.csv", "maps.png", "maps.svg"]
    said = capsys.readouterr().out
    for stated in ("κ = 6.31 per metre", "“replan”", "The paper's text:", "maps.csv"):
        assert stated in said
    assert main(["figure2", "--condition", "balance", "--out", str(tmp_path / "x")]) == 1
    told = capsys.readouterr().err
    assert "no condition 'balance'; conditions are " in told and "balanced" in told
