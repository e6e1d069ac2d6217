"""Calibration: on pure teleoperation alone, and what ships fits what the paper reports of it."""

from __future__ import annotations

import json
from functools import cache

import pytest

from app.errors import LabError
from app.replication.fit import (
    ANCHORS,
    PARAMETERS,
    VARIANTS,
    Fit,
    anchor_values,
    as_json,
    fit,
    measure_teleoperation,
    report,
)
from app.replication.paper import reported
from app.simulated.study import Plan, make_plan
from app.simulated.traits import OFF, TRAITS
from app.simulated.variants import changed_study, fitted, fitted_population
from app.trial.world import open_study
from study.analysis.measures import Measures

pytestmark = pytest.mark.slow


@cache
def shipped() -> Measures:
    """People that the calibration has not seen."""
    return measure_teleoperation(make_plan(4242, "kinematic", "fitted"), 12)


def test_only_pure_teleoperation_is_run() -> None:
    assert {task.condition for task in shipped().tasks} == {"teleoperation"}
    assert {task.position for task in shipped().tasks} == {1, 2, 3}


def test_what_ships_gives_the_paper_s_teleoperation() -> None:
    """For people it was not fitted on: ticks and window rate within a fifth, user actions until convergence within
    three standard errors of the paper's mean of 36 pickups. The replication's report shows the other anchors."""
    found = anchor_values(shipped())
    ours = {(anchor.measure, anchor.kind): value for anchor, value in found if anchor.statistic == "mean"}
    for measure, kind in (("efficiency_ticks", "pickup"), ("efficiency_ticks", "all"), ("window_rate", "all")):
        assert ours[measure, kind] == pytest.approx(reported(measure, kind).means["teleoperation"], rel=0.2), kind
    paper = reported("convergence_user_actions", "pickup")
    error = paper.sds["teleoperation"] / 36**0.5
    assert abs(ours["convergence_user_actions", "pickup"] - paper.means["teleoperation"]) < 3.0 * error


def test_what_ships_is_what_the_fit_found() -> None:
    data = fitted()
    best = min(data["found"]["variants"].items(), key=lambda item: item[1]["misfit"])
    numbers = best[1]["values"]
    assert data["study"]["robot"]["speed_m_s"] == numbers["speed_m_s"]
    assert data["study"]["arbiter"]["rationality_per_m"] == numbers["rationality_per_m"]
    assert data["study"]["arbiter"]["transition"] == VARIANTS[best[0]]["transition"]
    assert {name: numbers[name] for name in numbers if name in TRAITS}.items() <= data["participants"].items()
    assert fitted_population().means == {**OFF, **data["participants"]}


def test_the_other_transition_is_told_with_its_misfit_from_one_run_with_the_one_that_ships() -> None:
    """And how far another run of the fit comes from what ships."""
    found = fitted()["found"]
    again, first = found["again"]["variants"], found["variants"]["replan"]
    assert again["mix"]["misfit"] > 3.0 * again["replan"]["misfit"]
    told = [(of["measure"], of["kind"], of["statistic"]) for of in again["mix"]["anchors"]]
    assert told == [(anchor.measure, anchor.kind, anchor.statistic) for anchor in ANCHORS]
    for name in ("speed_m_s", "rationality_per_m"):
        assert again["replan"]["values"][name] == pytest.approx(first["values"][name], rel=0.1)


def test_traits_are_called_fitted_that_are() -> None:
    assert {name for name, trait in TRAITS.items() if trait.fitted} == {item.name for item in PARAMETERS} & set(TRAITS)


def test_a_fit_comes_nearer_and_keeps_its_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    small = changed_study(open_study(None), {"": {"pickups_per_trial": 1}})

    def of_small(variant: str, values: dict[str, float], seed: int) -> Plan:
        from app.replication.fit import means_of, study_changes
        from app.simulated.traits import Population

        study = changed_study(small, study_changes(variant, values))
        return Plan(study.source_text, seed, population=Population(means_of(values)))

    monkeypatch.setattr("app.replication.fit.plan_of", of_small)
    evaluations = []
    found = fit("replan", participants=3, seed=1, rounds=1, say=lambda: evaluations.append(1))
    first = fit("replan", participants=3, seed=1, rounds=1)
    assert found == first  # the same people, the same result
    assert found.evaluations == len(evaluations) >= 1 + len(PARAMETERS) + 1
    assert all(item.low <= found.values[item.name] <= item.high for item in PARAMETERS)
    start = {item.name: item.start for item in PARAMETERS}
    at_start = anchor_values(measure_teleoperation(of_small("replan", start, 1), 3))
    misfit_at_start = sum(((value / anchor.value - 1.0) / anchor.share) ** 2 for anchor, value in at_start)
    assert found.misfit <= misfit_at_start


def test_the_better_variant_ships_and_the_other_is_told() -> None:
    values = {item.name: item.start for item in PARAMETERS}
    anchors = tuple((anchor, anchor.value) for anchor in ANCHORS)
    fits = [Fit("mix", values, anchors, 9.0, 5, 100, 40), Fit("replan", values, anchors, 2.0, 5, 100, 40)]
    data = json.loads(as_json(fits, 24, 1))
    assert data["study"]["arbiter"]["transition"] == "replan"
    assert set(data["found"]["variants"]) == {"mix", "replan"}
    assert "147.7" in report(fits[0])


def test_an_unknown_variant_is_told_the_known_ones() -> None:
    with pytest.raises(LabError, match="variants are replan, mix"):
        fit("teleport", participants=1, seed=1)
