"""Freed arms and time limits in the analysis: windows, counts, and whether the results hang on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import optimize

from study.analysis.analysis import analyse
from study.analysis.dataset import load
from study.analysis.effect_sizes import NotFitted
from study.analysis.hazard_model import Hazards, until_done
from study.analysis.measures import TaskMeasures, measure
from study.analysis.report import html_page
from study.analysis.sensitivity import without
from study.analysis.tables import all_tables
from tests.support.analysis_samples import DataSet, data_set, script, scripted_task

CONDITIONS = ("teleoperation", "balanced")


def task(person: str, condition: str, ticks: int, censored: bool = False, number: int = 1) -> TaskMeasures:
    return TaskMeasures(
        participant=person,
        condition=condition,
        position=1 + CONDITIONS.index(condition),
        task=number,
        kind="pickup",
        goal="sponge_pack",
        goals=6,
        outcome="failure" if censored else "success",
        reason="time_limit" if censored else None,
        analysed=True,
        efficiency_ticks=ticks,
        user_actions=1,
        convergence_user_actions=1,
        missing_ticks=0,
        censored=censored,
    )


# ---- attempts -------------------------------------------------------------------------------------------------------


def test_a_windows_ticks_are_of_one_attempt_and_efficiency_counts_both() -> None:
    first = script("uiiii", [0.5] * 5)
    second = script("iiiiiu", [0.5] * 6, first_tick=9, attempt=2)
    rows = [*first, *second]
    measures = measure([scripted_task(rows, attempts=2)], rows)
    assert [(window.first_tick, window.ticks, window.ended_by) for window in measures.windows] == [(9, 5, "user")]
    (found,) = measures.tasks
    assert (found.efficiency_ticks, found.user_actions, found.missing_ticks, found.attempts) == (11, 2, 0, 2)
    whole = measure([scripted_task(rows, attempts=2)], [*script("uiiiii", [0.5] * 6), *second])
    assert [window.ended_by for window in whole.windows] == ["free", "user"]


def test_a_belief_that_starts_afresh_has_converged_in_the_last_attempt_alone() -> None:
    rows = [*script("uu", [0.9, 0.9]), *script("uuu", [1 / 3, 0.5, 0.9], first_tick=6, attempt=2)]
    (found,) = measure([scripted_task(rows, attempts=2)], rows).tasks
    assert found.convergence_user_actions == 4


def test_tasks_whose_attempts_take_turns_are_each_whole() -> None:
    pickup = [*script("uu", [0.5] * 2), *script("uu", [0.5] * 2, first_tick=8, attempt=2)]
    dropoff = [
        replace(row, task=2, kind="dropoff")
        for row in [*script("u", [0.5], first_tick=2), *script("uuu", [0.5] * 3, first_tick=10, attempt=2)]
    ]
    ticks = sorted([*pickup, *dropoff], key=lambda row: row.tick)
    tasks = [
        scripted_task(pickup, attempts=2),
        scripted_task(dropoff, attempts=2, task=2, kind="dropoff", goal="spray_bottle"),
    ]
    assert [found.efficiency_ticks for found in measure(tasks, ticks).tasks] == [4, 4]
    assert [found.missing_ticks for found in measure(tasks, ticks).tasks] == [0, 0]
    fewer = [row for row in ticks if row.tick not in (9, 11)]  # the pickup's last one, and one within the dropoff
    assert [found.missing_ticks for found in measure(tasks, fewer).tasks] == [1, 1]


# ---- censored tasks -------------------------------------------------------------------------------------------------


def likelihood(tasks: Sequence[TaskMeasures], effect: float) -> float:
    """Cox's partial likelihood without ties, as it stands in the books: each end against who was still at it."""
    total = 0.0
    for ended in tasks:
        if not ended.censored:
            at_risk = [
                other
                for other in tasks
                if other.participant == ended.participant and other.efficiency_ticks >= ended.efficiency_ticks
            ]
            total += effect * (ended.condition == "balanced") - math.log(
                sum(math.exp(effect * (other.condition == "balanced")) for other in at_risk)
            )
    return total


def test_a_hazard_ratio_is_that_of_the_greatest_partial_likelihood() -> None:
    rng = np.random.default_rng(3)
    tasks = []
    for person in ("P001", "P002", "P003"):
        lengths = iter(rng.permutation(np.arange(20, 60)).tolist())
        for condition in CONDITIONS:
            for number in range(6):
                ticks = next(lengths) + (8 if condition == "balanced" else 0) * 2 + number / 10
                tasks.append(task(person, condition, min(int(10 * ticks), 600), censored=10 * ticks >= 600))
    found = until_done(tasks, CONDITIONS)
    assert isinstance(found, Hazards)
    assert found.censored > 0
    best = optimize.minimize_scalar(lambda effect: -likelihood(tasks, effect), bounds=(-5, 5), method="bounded")
    ((condition, ratio, p),) = found.ratios
    assert (condition, found.against) == ("balanced", "teleoperation")
    assert math.log(ratio.value) == pytest.approx(best.x, abs=1e-4)
    assert ratio.low < ratio.value < ratio.high < 1.0
    assert p == pytest.approx(found.p)


@pytest.mark.parametrize(
    ("tasks", "why"),
    [
        ([task("P001", "balanced", 5)], "at least two conditions"),
        ([task("P001", "balanced", 5), task("P001", "teleoperation", 9, True)], "no task under teleoperation ended"),
        ([task("P001", "balanced", 5), task("P002", "teleoperation", 9)], "under several conditions"),
    ],
)
def test_what_cannot_be_estimated_is_said(tasks: list[TaskMeasures], why: str) -> None:
    found = until_done(tasks, CONDITIONS)
    assert isinstance(found, NotFitted)
    assert why in found.reason


# ---- in the report --------------------------------------------------------------------------------------------------


def changed(data: DataSet) -> DataSet:
    """One cycle freed twice, one pickup and one dropoff over their time, under balanced."""
    tables = dict(data.tables)
    own = [row for row in tables["tasks"] if row.condition == "balanced"]
    freed = {(own[0].participant, own[0].trial, number) for number in (1, 2)}
    over = {(own[-2].participant, own[-2].trial, own[-2].task), (own[-1].participant, own[-1].trial, own[-1].task)}
    rows = []
    for row in tables["tasks"]:
        key = (row.participant, row.trial, row.task)
        changed_row = replace(row, attempts=3) if key in freed else row
        rows.append(replace(changed_row, outcome="failure", reason="time_limit") if key in over else changed_row)
    return DataSet({**tables, "tasks": rows})


def test_the_report_gives_frees_and_limits_by_condition_and_results_without_them(tmp_path: Path) -> None:
    data = load(changed(data_set()).write(tmp_path / "export"))
    by_condition = {item.condition: item for item in data.quality.ended}
    assert (by_condition["balanced"].freed_cycles, by_condition["balanced"].frees) == (1, 2)
    assert (by_condition["balanced"].pickups_over_time, by_condition["balanced"].dropoffs_over_time) == (1, 1)
    assert by_condition["teleoperation"].frees == by_condition["teleoperation"].pickups_over_time == 0
    analysis = analyse(data)
    assert [(subset.left_out, subset.tasks) for subset in analysis.subsets] == [("freed", 2), ("censored", 2)]
    assert [kind for kind, model in analysis.hazards if isinstance(model, Hazards)] == ["pickup", "all"]
    page = html_page(analysis, ())
    assert "Without pick-and-places in which the arm was freed: 2 tasks left out" in page
    assert "right-censored" in page
    tables = {table.name: table for table in all_tables(analysis)}
    assert {row[0] for row in tables["sensitivity"].rows} == {"freed", "censored"}
    assert len(tables["hazard_ratios"].rows) == 2 * (len(data.conditions) - 1)
    efficiency = {
        (row[0], row[4]): row[5] for row in tables["sensitivity"].rows if row[2:4] == ("efficiency_ticks", "all")
    }
    whole = analysis.comparison("efficiency_ticks", "all")
    assert whole is not None
    assert efficiency["freed", "balanced"] == whole.summaries["balanced"].n - 2
    assert efficiency["censored", "balanced"] == whole.summaries["balanced"].n - 1  # the dropoff was left out already
    assert len(without(data.measures, "censored").tasks) == len(data.measures.tasks) - 2


def test_data_without_either_say_so_and_repeat_nothing(tmp_path: Path) -> None:
    analysis = analyse(load(data_set().write(tmp_path / "export")))
    assert (analysis.subsets, analysis.hazards) == ((), ())
    assert "tasks left out" not in html_page(analysis, ())
