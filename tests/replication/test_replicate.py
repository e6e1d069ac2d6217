"""Many studies against the paper's comparisons: each share counted by itself, nothing run twice, misses said."""

from __future__ import annotations

import csv
import json
import math
import pickle
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.errors import LabError
from app.replication.ceiling import ceiling
from app.replication.comparisons import Contrast, compared, goal_gains, joint, means, shares
from app.replication.formats import name_of
from app.replication.long_tasks import (
    LONG_TICKS,
    TaskLength,
    lengths_of,
    lengths_of_person,
    met,
    sentence,
    summed_up,
    without_limits,
)
from app.replication.paper import CIRCULAR, CLAIMS, DIFFERENCES, REPORTED, Claim, reported
from app.replication.replicate import (
    Replication,
    Varied,
    as_experiment,
    check_place,
    compare_all,
    replicate,
    studies_of,
    variations,
    varied,
)
from app.replication.rule import rule
from app.replication.spreadsheets import TABLES, write
from app.replication.studies import Archive, Studies, Values, run_studies, run_study, study_seed, unpacked
from app.replication.text import goals_sentence, report, table
from app.simulated.participant import simulate_trials
from app.simulated.study import Plan, make_plan, setup_of
from app.simulated.traits import TRAITS
from app.simulated.variants import Changes, changed_study, fitted_population, preset_changes
from app.trial.robots import make_robot
from app.trial.world import open_study, parse_text
from study.analysis.observations import Observation
from tests.support.study_values import as_the_paper_found

pytestmark = pytest.mark.slow


def _one_pickup(changes: Changes) -> Changes:
    return {**changes, "": {**changes.get("", {}), "pickups_per_trial": 1}}


def small_plan() -> Plan:
    study = changed_study(open_study(None), _one_pickup(preset_changes("fitted")))
    return Plan(study.source_text, 3, population=fitted_population())


# ---- the paper's numbers --------------------------------------------------------------------------------------------


def test_signs_are_those_of_the_paper_s_means() -> None:
    for claim in CLAIMS:
        of = reported(claim.measure, claim.kind).means
        assert claim.sign == (of[claim.first] > of[claim.second]) - (of[claim.first] < of[claim.second]), claim
        assert (claim.margin > 0.0) == (claim.verdict == "same"), claim
    assert {(claim.measure, claim.kind) for claim in CLAIMS} == {(item.measure, item.kind) for item in REPORTED}


# ---- shares ---------------------------------------------------------------------------------------------------------


def claim_of(measure: str, kind: str, first: str, second: str) -> Claim:
    return next(c for c in CLAIMS if (c.measure, c.kind, c.first, c.second) == (measure, kind, first, second))


def test_shares_are_counted_by_themselves() -> None:
    claim = claim_of("efficiency_ticks", "all", "balanced", "teleoperation")  # paper: fewer ticks
    studies = [
        {claim: Contrast(-20.0, 0.01, False)},  # sign and significant
        {claim: Contrast(-10.0, 0.20, False)},  # sign only
        {claim: Contrast(+30.0, 0.01, False)},  # the other way
        {},  # could not be compared: counts against it
    ]
    share = shares(studies, [claim])[0]
    assert (share.same_sign, share.significant, share.opposite) == (0.5, 0.25, 0.25)
    assert share.mean == pytest.approx(0.0)
    assert not ceiling().rows[claim].met_by(share)


def test_no_difference_is_counted_within_and_shown() -> None:
    claim = claim_of("window_rate", "all", "balanced", "teleoperation")
    studies = [
        {claim: Contrast(0.001, 0.5, True)},
        {claim: Contrast(0.002, 0.5, False)},
        {claim: Contrast(0.004, 0.5, False)},
        {claim: Contrast(-0.004, 0.01, False)},
    ]
    share = shares(studies, [claim])[0]
    assert (share.within, share.equivalent, share.significant) == (0.5, 0.25, 0.25)
    assert math.isnan(share.same_sign)
    assert not ceiling().rows[claim].met_by(share)


def test_large_studies_with_the_paper_s_means_agree_with_it() -> None:
    rng = np.random.default_rng(1)
    found = shares([compared(as_the_paper_found(rng, 240))])
    for share in found:
        if share.claim.verdict == "different" and share.claim.measure not in CIRCULAR:
            assert (share.same_sign, share.significant) == (1.0, 1.0), share.claim
    rates = [share for share in found if share.claim.measure == "window_rate"]
    assert all(share.equivalent == 1.0 for share in rates)


def test_without_effects_about_one_in_twenty_is_significant() -> None:
    rng = np.random.default_rng(2)
    claims = [claim for claim in CLAIMS if (claim.measure, claim.kind) == ("efficiency_ticks", "all")]
    found = shares([compared(as_the_paper_found(rng, 12, effect=0.0), claims) for _ in range(60)], claims)
    assert np.mean([share.significant + share.opposite for share in found]) < 0.1


def test_all_at_once_is_counted_study_by_study() -> None:
    right = {claim: Contrast(1.0 * claim.sign, 0.01, False) for claim in DIFFERENCES}
    first, second = DIFFERENCES[:2]
    studies = [
        right,
        {**right, first: Contrast(1.0 * first.sign, 0.20, False)},  # a sign, but not significant
        {**right, second: Contrast(-1.0 * second.sign, 0.01, False)},  # significant the other way
        {claim: item for claim, item in right.items() if claim != first},  # could not be tested
    ]
    found = joint(studies)
    assert (found.comparisons, found.studies) == (13, 4)
    assert (found.signs, found.significant) == (0.5, 0.25)
    assert found.mean_signs == pytest.approx((13 + 13 + 12 + 12) / 4)
    assert found.mean_significant == pytest.approx((13 + 12 + 12 + 12) / 4)


# ---- how long tasks take --------------------------------------------------------------------------------------------


def test_tasks_are_counted_by_condition_and_kind() -> None:
    tasks = [
        TaskLength("balanced", "pickup", LONG_TICKS, 30, 3),
        TaskLength("balanced", "pickup", LONG_TICKS + 1, 0, 0),
    ]
    tasks += [TaskLength("teleoperation", "dropoff", 400, 0, 0)]
    teleoperated, balanced = sorted(summed_up(tasks), key=lambda row: row.kind)
    assert (balanced.tasks, balanced.long, balanced.longest) == (2, 0.5, LONG_TICKS + 1)
    assert balanced.blocked == pytest.approx(30 / (2 * LONG_TICKS + 1))
    assert balanced.folded == pytest.approx(3 / (2 * LONG_TICKS + 1))
    assert teleoperated.beyond_paper == 1.0, "the paper's mean plus three SD are 353 ticks"
    assert not met(summed_up(tasks))
    assert "MISSED" in sentence(summed_up(tasks))
    assert met(summed_up(tasks[:1]))
    assert "nothing can be said" in sentence(summed_up(tasks[2:]))
    assert "takes 400 ticks; the aim, none beyond the paper's mean plus three SD (353), is MISSED" in sentence(
        summed_up(tasks)
    )


def test_who_reached_a_time_limit_is_simulated_without() -> None:
    """A limit of 25 s ends pickups; without it they take what they take, and all others are as before."""
    plan = small_plan()
    limited = changed_study(parse_text(plan.study_text, "limited"), {"": {"task_limit_s": 25.0}})
    robot = partial(make_robot, "kinematic")
    case = replace(plan, study_text=limited.source_text).case(0)
    record = simulate_trials(case, robot)
    assert any(task.reason == "time_limit" for task in record["tasks"])
    ended = lengths_of(record["ticks"])
    found = lengths_of_person(case, record, robot)
    assert found == lengths_of(simulate_trials(without_limits(case), robot)["ticks"])
    assert max(task.control_ticks for task in found) > 50 >= max(task.control_ticks for task in ended)
    unlimited = lengths_of(simulate_trials(plan.case(0), robot)["ticks"])
    assert found == unlimited, "the shipped study's limits are reached by nobody here, so that they change nothing"


def test_means_stand_beside_the_paper_s() -> None:
    rng = np.random.default_rng(3)
    rows = means([as_the_paper_found(rng, 60) for _ in range(5)])
    row = next(r for r in rows if (r.measure, r.kind, r.condition) == ("efficiency_ticks", "all", "balanced"))
    assert (row.paper_mean, row.paper_sd) == (117.2, 53.61)
    assert row.mean == pytest.approx(117.2, rel=0.05)
    assert row.interval[0] < row.mean < row.interval[1]
    assert row.within_sd


def test_gain_by_goals_tells_rising_from_falling() -> None:
    rng = np.random.default_rng(4)
    values = as_the_paper_found(rng, 24)
    key = ("belief_gain", "all")
    tilted = tuple(
        type(one)(**{**vars(one), "value": 0.01 * one.goals * (1 if one.condition == "balanced" else -1)})
        for one in values.observations[key]
    )
    rows = {row.condition: row for row in goal_gains([Values({**values.observations, key: tilted})])}
    assert rows["balanced"].rising == 1.0
    assert rows["goal_oriented"].rising == 0.0
    assert rows["balanced"].by_goals[6] == pytest.approx(0.06)


# ---- running --------------------------------------------------------------------------------------------------------


def test_a_study_s_values_are_those_of_its_people() -> None:
    values = run_study(small_plan(), 2, 0)
    assert values.counts["participants"] == 2
    assert values.counts["tasks"] == 2 * 3 * 2
    assert {one.participant for one in values.observations["efficiency_ticks", "all"]} == {"S001", "S002"}
    assert len(values.observations["sus_modified", "all"]) == 6


def test_studies_differ_and_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = run_studies(small_plan(), 2, 2, 1, tmp_path / "studies")
    assert first[0] != first[1]
    assert len({study_seed(3, study) for study in range(100)}) == 100
    monkeypatch.setattr("app.replication.studies.run_study", None)  # nothing is run again
    assert run_studies(small_plan(), 2, 2, 1, tmp_path / "studies") == first


def test_studies_are_held_packed_and_come_out_as_they_were() -> None:
    plan = small_plan()
    values = [run_study(plan, 1, number) for number in range(2)]
    held = Studies.of(values)
    assert list(held) == values
    assert list(held[1:]) == values[1:]
    assert [unpacked(one) for one in held.packed] == values
    assert all(len(one) < 0.3 * len(pickle.dumps(study)) for one, study in zip(held.packed, values, strict=True))


def test_two_processes_find_the_same() -> None:
    assert run_studies(small_plan(), 2, 1, 2, None) == run_studies(small_plan(), 2, 1, 1, None)


def test_studies_of_another_run_are_not_mixed_in(tmp_path: Path) -> None:
    Archive(tmp_path, {"seed": 1}).open()
    with pytest.raises(LabError, match="studies with another seed"):
        Archive(tmp_path, {"seed": 2}).open()


# ---- one thing at a time --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("preset", ["fitted", "shipped"])
def test_each_variation_changes_one_thing_and_can_be_run(preset: str) -> None:
    plan = make_plan(1, "kinematic", preset)
    texts = {plan.study_text}
    base = plan.study_text.split("\n")
    for variation in variations(plan):
        changed = varied(plan, variation)
        lines = [line for line in changed.study_text.split("\n") if line not in base]
        people = dict(changed.population.means) != dict(plan.population.means)
        assert (len(lines) == 1) != (people or changed.population.spread_scale != 1.0), variation.name
        texts.add(changed.study_text)
    assert len(texts) > 12


def test_alpha_is_varied_around_its_calibration() -> None:
    plan = make_plan(1, "kinematic", "fitted")
    half = next(item for item in variations(plan) if item.name == "alpha x 3")
    alpha = setup_of(plan.study_text).arbiter("balanced").parameters.alpha
    tripled = setup_of(varied(plan, half).study_text).arbiter("balanced").parameters.alpha
    assert tripled == pytest.approx(3 * alpha, rel=1e-4)


# ---- the report -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def result() -> Replication:
    rng = np.random.default_rng(5)
    studies = tuple(as_the_paper_found(rng) for _ in range(3))
    plan = make_plan(1, "kinematic", "fitted")
    nothing = compare_all([as_the_paper_found(rng, effect=0.0) for _ in range(3)], 1)
    other = next(item for item in variations(plan) if item.name == "alpha / 3")
    tested = compare_all(studies, 1)
    base = shares(tested)
    return Replication(
        plan=plan,
        preset="fitted",
        participants=12,
        studies=studies,
        shares=base,
        means=means(studies),
        goals=goal_gains(studies),
        joint=joint(tested),
        lengths=summed_up([TaskLength("balanced", "pickup", ticks, 3, 1) for ticks in (100, 200, 301)]),
        varied=(Varied(other, 3, base, shares(nothing)),),
        experiments=(as_experiment(Varied(other, 3, base, shares(nothing))),),
        vary=3,
    )


def test_the_report_holds_every_comparison_and_parameter(result: Replication) -> None:
    text = report(result)
    for item in result.shares:
        assert f"{item.claim.kind}: " in text
    for trait in TRAITS:
        assert trait in text
    for word in ("alpha / 3", "circular", "margin", "seed 1", "Calibration", "not blind", rule().sha256):
        assert word in text
    assert "nan" not in text.lower().replace("finance", "")
    assert len(table(result).splitlines()) == 1 + len(CLAIMS)


def test_what_could_not_be_compared_is_said(result: Replication) -> None:
    """Nobody under balanced: sentences in the report, and blanks, never a NaN, in the tables."""

    def without(of: tuple[Observation, ...]) -> tuple[Observation, ...]:
        return tuple(one for one in of if one.condition != "balanced")

    lacking = [
        replace(s, observations={key: without(of) for key, of in s.observations.items()}) for s in result.studies
    ]
    tested = compare_all(lacking, 1)
    empty = replace(
        result,
        studies=tuple(lacking),
        shares=shares(tested),
        means=means(lacking),
        goals=goal_gains(lacking),
        joint=joint(tested),
        lengths=summed_up([]),
        varied=(),
        experiments=(),
    )
    text = report(empty)
    assert "gain pickup: balanced - goal could not be tested in 3 of 3 studies" in text
    assert "no values under balanced" in text
    assert "nothing can be said of its length" in text
    assert "too few numbers of goals" in text
    assert re.search(r"\bnan\b", text) is None


def test_misses_are_told_with_what_was_tried(result: Replication) -> None:
    text = report(result).split("## Why comparisons miss their aim")[1].split("## One thing at a time")[0]
    rows = ceiling().rows
    for item in result.shares:
        assert (f"- **{name_of(item.claim)}** " in text) is not rows[item.claim].met_by(item)
    assert "alpha / 3 p<.05 " in text
    without = report(replace(result, vary=0, varied=(), experiments=()))
    assert "Without --vary no experiment was made" in without


def test_more_studies_are_run_for_reasons_than_for_the_rest() -> None:
    every = variations(make_plan(1, "kinematic", "fitted"))
    assert {item.name for item in every if item.reason} == {"alpha / 3", "alpha x 3", "equal people"}
    assert [studies_of(item, 5, 200) for item in every if item.reason] == [20, 20, 20]
    assert {studies_of(item, 5, 200) for item in every if not item.reason} == {5}
    assert {studies_of(item, 2, 3) for item in every} == {2, 3}


def test_the_trend_with_goals_is_told_of_the_means(result: Replication) -> None:
    def told(by_goals: dict[int, float]) -> str:
        return goals_sentence(replace(result, goals=tuple(replace(row, by_goals=by_goals) for row in result.goals)))

    falling = told({2: 0.015, 4: 0.009, 5: 0.006, 6: 0.005})
    assert "fall with every further goal, from 0.0150 at 2 to 0.0050 at 6" in falling
    assert "neither falling nor rising throughout" in told({2: 0.005, 4: 0.009, 6: 0.005})


def test_what_a_variation_moves_is_said(result: Replication) -> None:
    """Without effects, efficiency loses its significance; the report names the variation that did it."""
    text = report(result)
    line = next(line for line in text.splitlines() if line.startswith("- **efficiency all: goal - teleop**"))
    assert "alpha / 3: " in line
    assert "p<.05" in line


def test_tables_are_written(result: Replication, tmp_path: Path) -> None:
    write(result, tmp_path)
    with (tmp_path / "comparisons.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(CLAIMS)
    assert all(0.0 <= float(row["significant"]) <= 1.0 for row in rows)
    with (tmp_path / "columns.csv").open() as file:
        described = {(row["file"], row["column"]) for row in csv.DictReader(file) if row["description"]}
    for name in TABLES:
        with (tmp_path / name).open() as file:
            assert {(name, column) for column in next(csv.reader(file))} <= described
    with (tmp_path / "lengths.csv").open() as file:
        assert [row["longest"] for row in csv.DictReader(file)] == ["301"]
    with (tmp_path / "means.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 3 * len(REPORTED)


def test_the_whole_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["replicate", "--studies", "1", "--participants", "2", "--vary", "0", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "gain pickup: balanced - goal" in printed
    assert rule().sha256 in printed
    assert "1 simulated studies of 2 participants" in (out / "replication.md").read_text(encoding="utf-8")
    assert json.loads((out / "studies" / "settings.json").read_text())["participants"] == 2


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--studies", "0"], "studies is 0; it must be from 1 to 10000"),
        (["--participants", "1"], "takes at least 2"),
        (["--vary", "-1"], "vary is -1; it must be from 0"),
        (["--studies", "3", "--vary", "4"], "from 0 (vary nothing) to 3"),
        (["--seed", "-5"], "seed -5; it must be from 0"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replicate", *arguments]) == 1
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("all of it")
    with pytest.raises(LabError, match="not of an earlier run"):
        check_place(tmp_path)
    with pytest.raises(LabError, match="not of an earlier run"):
        replicate(small_plan(), "fitted", 1, 2, 1, 0, tmp_path)
