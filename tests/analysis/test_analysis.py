"""From an export to the paper's comparisons: known differences are found, and bad data are told in a sentence."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.analysis.analysis import Analysis, analyse, compare
from study.analysis.dataset import load
from study.analysis.effect_sizes import Interval, NotFitted
from study.analysis.linear_model import Anova, RepeatedMeasures
from study.analysis.measures import TaskKind
from study.analysis.mixed_model import MixedModel
from study.analysis.observations import observations
from study.export.export import write_tables
from study.records import StudyError
from tests.support.analysis_samples import DataSet, Wanted, data_set


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    return analyse(load(data_set(6).write(tmp_path_factory.mktemp("export"))))


def rewritten(folder: Path, table: str, change: Callable[[dict[str, str]], dict[str, str] | None]) -> None:
    """The table's CSV file with every row (a dict) changed; a row that becomes None goes."""
    path = folder / f"{table}.csv"
    with path.open(newline="") as file:
        rows = [row for row in map(change, csv.DictReader(file)) if row is not None]
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


# ---- what is found --------------------------------------------------------------------------------------------------


def test_the_analysis_finds_the_differences_that_were_put_in(analysis: Analysis) -> None:
    for kind in ("pickup", "all"):
        gain = analysis.comparison("belief_gain", kind)
        assert gain is not None and not isinstance(gain.anova, NotFitted)
        assert gain.anova.p < 1e-4
        assert gain.summaries["balanced"].mean == pytest.approx(0.020, abs=0.002)
        ticks = analysis.comparison("efficiency_ticks", kind)
        assert ticks is not None
        pairs = {(pair.first, pair.second): pair for pair in ticks.pairs}
        assert pairs["teleoperation", "goal_oriented"].difference.value == pytest.approx(20, abs=5)
        assert all(pair.p < 0.05 for pair in ticks.pairs)
        effect = pairs["goal_oriented", "balanced"].effect
        assert isinstance(effect, Interval) and effect.value < 0


def test_the_model_reported_is_the_papers_and_the_others_stand_beside_it(analysis: Analysis) -> None:
    designs: tuple[tuple[TaskKind, int], ...] = (("pickup", 54 - 3 - 2 - 5), ("all", 108 - 3 - 2 - 7))
    for kind, rest in designs:
        ticks = analysis.comparison("efficiency_ticks", kind)
        assert ticks is not None and isinstance(ticks.model, MixedModel) and ticks.beside is not None
        assert [part.name for part in ticks.model.random] == ["position", "goal"]
        # Fixed covariates: 3 conditions, 2 more positions, 5 more objects; in all tasks 2 bins as well.
        assert isinstance(ticks.beside.fixed, Anova)
        assert (ticks.beside.fixed.df_effect, ticks.beside.fixed.df_error) == (2, rest)
        assert rest - 1e-6 <= ticks.model.anova.df_error <= rest + 2 + 5 + 2
        person = ticks.beside.with_participant
        assert isinstance(person, MixedModel)
        assert {part.name: part.sd for part in person.random}["participant"] == pytest.approx(5.7, abs=4)  # -8 to 8
        means = {of.condition: of.mean for of in person.anova.adjusted_means}
        assert means["goal_oriented"] - means["teleoperation"] == pytest.approx(-20, abs=5)


def test_fixed_covariates_can_be_asked_for(analysis: Analysis) -> None:
    full = analysis.comparison("efficiency_ticks", "pickup")
    assert full is not None and full.beside is not None
    fixed = compare(full.observations, "efficiency_ticks", "pickup", analysis.data.conditions, covariates="fixed")
    assert fixed.anova == full.beside.fixed
    assert fixed.pairs != full.pairs


def test_surveys_and_window_rate_are_compared_within_participants(analysis: Analysis) -> None:
    compared: tuple[tuple[str, TaskKind | None], ...] = (
        ("sus_modified", None),
        ("tlx_raw", None),
        ("window_rate", "all"),
    )
    for measure, kind in compared:
        found = analysis.comparison(measure, kind)
        assert found is not None and isinstance(found.model, RepeatedMeasures)
        assert (found.model.anova.df_effect, found.model.anova.df_error) == (2, 10)  # F(2, 22) with twelve
        assert {pair.effect_name for pair in found.pairs} == {"d_z"}


def test_tasks_that_never_converge_are_left_out_and_the_rest_kept(analysis: Analysis) -> None:
    found = analysis.comparison("convergence_user_actions", "all")
    assert found is not None
    never = sum(task.convergence_user_actions is None for task in analysis.data.measures.tasks)
    assert never > 0
    assert len(found.observations) == 108 - never


def test_gains_by_number_of_goals(analysis: Analysis) -> None:
    for trend in analysis.trends:
        assert {goals: found.n for goals, found in trend.by_goals.items()} == {2: 36, 4: 12, 5: 12, 6: 12}


def test_a_quick_comparison_has_the_same_p(analysis: Analysis) -> None:
    full = analysis.comparison("efficiency_ticks", "pickup")
    data = analysis.data
    quick = compare(
        observations(data.measures, "efficiency_ticks", "pickup"),
        "efficiency_ticks", "pickup", data.conditions, beside=False, intervals=False,
    )  # fmt: skip
    assert full is not None
    assert quick.anova == full.anova
    assert [pair.p for pair in quick.pairs] == [pair.p for pair in full.pairs]
    assert quick.beside is None


# ---- quality --------------------------------------------------------------------------------------------------------


def test_demo_participants_and_unfinished_trials_stay_out_and_are_told(tmp_path: Path) -> None:
    data, demo = data_set(3), data_set(1, kind="demo")
    for name, rows in demo.tables.items():
        data.tables[name] += rows
    data.tables["trials"][-4] = replace(data.tables["trials"][-4], outcome="aborted")  # S003's last trial
    found = load(data.write(tmp_path / "export"))
    assert found.quality.left_out_participants == {"demo": 1}
    assert (found.quality.participants, found.quality.complete_participants) == (3, 2)
    assert (found.quality.trials, found.quality.trials_left_out) == (8, {"aborted": 1})
    assert {task.participant for task in found.measures.tasks} == {"S001", "S002", "S003"}
    assert len(found.measures.tasks) == 48
    usability = analyse(found).comparison("sus_modified")
    assert usability is not None and usability.left_out is not None and usability.left_out.startswith("1 of 3")


def test_suspect_trials_stay_out_where_the_study_file_says_so(tmp_path: Path) -> None:
    data = data_set(3)
    trials = data.tables["trials"]
    trials[0] = replace(trials[0], quality="suspect")
    trials[4] = replace(trials[4], quality="suspect", quality_override="good", quality_reason="the page was in view")
    trials[5] = replace(trials[5], quality="good", quality_override="suspect", quality_reason="the phone rang")
    folder = data.write(tmp_path / "export")
    assert load(folder).quality.trials == 9, "they stay in unless the study file says otherwise"
    (folder / "study.toml").write_text("[quality]\nexclude_suspect = true\n", encoding="utf-8")
    found = load(folder)
    assert [row for row in trials if row not in found.trials] == [trials[0], trials[5]]
    assert len(found.measures.tasks) == 7 * 6
    assert any("Suspect trials left out" in note and "2 of 9" in note for note in found.quality.notes)


def test_changed_parameters_are_told(tmp_path: Path) -> None:
    data = data_set(2)
    data.tables["trials"][0] = replace(data.tables["trials"][0], parameters='{"alpha": 1}')
    notes = load(data.write(tmp_path / "export")).quality.notes
    assert any("2 different sets of parameters" in note for note in notes)


def test_missing_ticks_and_pauses_are_counted(tmp_path: Path) -> None:
    data = data_set(2)
    ticks = data.tables["ticks"]
    del ticks[30]
    ticks[40] = replace(ticks[40], after_pause=1)
    quality = load(data.write(tmp_path / "export")).quality
    assert (quality.missing_ticks, quality.pauses) == (1, 1)


# ---- what cannot be analysed ----------------------------------------------------------------------------------------


def complaint(folder: Path) -> str:
    with pytest.raises(StudyError) as caught:
        load(folder)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_no_folder_and_no_export(tmp_path: Path) -> None:
    assert "no such folder" in complaint(tmp_path / "missing")
    assert "no export here" in complaint(tmp_path)


def test_a_foreign_schema_version(tmp_path: Path) -> None:
    folder = data_set(1).write(tmp_path / "export")
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps({**meta, "schema_version": 99}))
    assert "schema version 99" in complaint(folder)


@pytest.mark.parametrize("table", ["ticks", "tasks"])
def test_a_row_of_a_trial_that_is_not_there_is_refused(tmp_path: Path, table: str) -> None:
    folder = data_set(1).write(tmp_path / "export")
    rewritten(folder, table, lambda row: {**row, "trial": "77" if row["trial"] == "2" else row["trial"]})
    assert f"{table}.csv: participant S001, trial 77 is not in trials.csv" in complaint(folder)


@pytest.mark.parametrize(
    ("table", "column"),
    [("ticks", "belief"), ("ticks", "source"), ("tasks", "outcome"), ("trials", "parameters")],
)
def test_a_missing_column_is_named(tmp_path: Path, table: str, column: str) -> None:
    folder = data_set(1).write(tmp_path / "export")
    rewritten(folder, table, lambda row: {name: cell for name, cell in row.items() if name != column})
    text = complaint(folder)
    assert f"{table}.csv: columns missing: {column}" in text and "export the data again" in text


def test_a_missing_table_is_named(tmp_path: Path) -> None:
    folder = data_set(1).write(tmp_path / "export")
    (folder / "ticks.csv").unlink()
    assert "ticks.csv: missing" in complaint(folder)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"tick": "x"}, "tick is 'x', must be a whole number"),
        ({"entropy": "high"}, "entropy is 'high', must be a number"),
        ({"belief": "{"}, "a belief is not JSON"),
        ({"entropy": ""}, "entropy is blank"),
    ],
)
def test_a_bad_cell_is_named(tmp_path: Path, change: dict[str, str], text: str) -> None:
    folder = data_set(1).write(tmp_path / "export")
    rewritten(folder, "ticks", lambda row: {**row, **change} if row["tick"] == "5" else row)
    assert text in complaint(folder)


def test_demo_data_alone(tmp_path: Path) -> None:
    assert "all 2 participants are demo participants" in complaint(data_set(2, kind="demo").write(tmp_path / "export"))


def test_pilots_are_analysed_when_there_is_nobody_else(tmp_path: Path) -> None:
    pilots = data_set(2, kind="pilot")
    assert load(pilots.write(tmp_path / "pilots")).quality.notes[0] == "All participants are pilots."
    both = data_set(2)
    for name, rows in pilots.tables.items():
        both.tables[name] += rows
    quality = load(both.write(tmp_path / "both")).quality
    assert (quality.participants, quality.left_out_participants) == (2, {"pilot": 2})


def test_no_completed_trial(tmp_path: Path) -> None:
    data = data_set(1)
    data.tables["trials"] = [replace(row, outcome="aborted") for row in data.tables["trials"]]
    assert "no completed trial (trials: 3 aborted)" in complaint(data.write(tmp_path / "export"))
    nothing = tmp_path / "empty"
    write_tables(nothing, {})
    assert "no completed trial (trials: none)" in complaint(nothing)


def test_one_condition_only(tmp_path: Path) -> None:
    text = complaint(data_set(2, conditions=("balanced",)).write(tmp_path / "export"))
    assert "all 2 completed trials are under balanced" in text and "at least two" in text


def test_tasks_missing_from_a_completed_trial(tmp_path: Path) -> None:
    data = data_set(1)
    data.tables["tasks"] = [row for row in data.tables["tasks"] if row.trial != 2]
    assert "no tasks of participant S001, trial 2" in complaint(data.write(tmp_path / "export"))


def test_all_ties_are_reported_model_by_model(tmp_path: Path) -> None:
    data: DataSet = data_set(4, wanted=lambda *_: Wanted(20, 3, (0.01,)), surveys=False)
    found = analyse(load(data.write(tmp_path / "export")))
    reasons = [comparison.model.reason for comparison in found.comparisons if isinstance(comparison.model, NotFitted)]
    assert len(reasons) == len(found.comparisons)
    assert all("values are equal" in reason for reason in reasons)
    assert found.comparison("sus_modified") is None


def test_one_participant_is_described_and_not_tested(tmp_path: Path) -> None:
    found = analyse(load(data_set(1).write(tmp_path / "export")))
    ticks = found.comparison("efficiency_ticks", "all")
    assert ticks is not None and isinstance(ticks.model, NotFitted)
    assert "cannot be told apart from position" in ticks.model.reason
    assert ticks.summaries["balanced"].n == 6


def test_conditions_of_another_study(tmp_path: Path) -> None:
    def wanted(participant: str, condition: str, kind: str, rng: np.random.Generator) -> Wanted:
        return Wanted(30 + 10 * (condition == "fast") + int(rng.integers(5)), 3, (float(rng.normal(0.01, 0.002)),))

    found = analyse(load(data_set(4, conditions=("slow", "fast"), wanted=wanted, surveys=False).write(tmp_path / "e")))
    ticks = found.comparison("efficiency_ticks", "all")
    assert found.data.conditions == ("fast", "slow")
    assert ticks is not None and len(ticks.pairs) == 1
    assert ticks.pairs[0].difference.value == pytest.approx(10, abs=2)
