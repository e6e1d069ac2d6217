"""The paper's measures on tasks worked by hand, and on a study whose measures are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from study.analysis.measures import WindowMeasures, convergence, measure, measure_task, window_rates
from study.analysis.summaries import summarise, summary
from study.flow.answers import survey_scores
from study.records import StudyError, SurveyAnswerRow
from tests.support.analysis_samples import Wanted, data_set, script, scripted_task
from tests.support.study_samples import UTC, tick_row

THIRD = 1.0 / 3.0


def windows_of(letters: str, own: list[float | None] | None = None, **changes: Any) -> tuple[WindowMeasures, ...]:
    rows = script(letters, own or [0.5] * len(letters), **changes)
    return measure_task(scripted_task(rows), rows)[1]


# ---- total task efficiency ------------------------------------------------------------------------------------------


def test_efficiency_counts_user_robot_and_idle_ticks_alone() -> None:
    rows = script("uurriiggu", [0.5] * 9)
    task, _ = measure_task(scripted_task(rows), rows)
    assert task.efficiency_ticks == 7
    assert task.user_actions == 3


@pytest.mark.parametrize("letters", ["uurriiggu", "rrrrruuuuu", "iiiiiiug", "uiuiuiiiiiuP", "rrrrrrU"])
def test_a_direction_that_the_arbiter_overrode_is_a_direction_that_was_given(letters: str) -> None:
    own = [0.3 + 0.05 * index for index in range(len(letters))]
    taken, overridden = script(letters, own), script(letters.replace("u", "b"), own)
    assert {row.source for row in overridden} & {"blend"} or "u" not in letters
    assert measure_task(scripted_task(overridden), overridden) == measure_task(scripted_task(taken), taken)


def test_reset_ticks_belong_to_no_task() -> None:
    rows = script("uu", [0.5, 0.5])
    reset = [replace(row, task=None, kind=None, goal=None) for row in script("xx", [0.5] * 2, first_tick=2)]
    assert measure([scripted_task(rows)], rows + reset).tasks[0].efficiency_ticks == 2


# ---- belief convergence speed ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("letters", "own", "expected"),
    [
        ("uuuu", [0.2, 0.5, 0.6, 0.7], 2),
        ("uuuu", [0.5, 0.2, 0.6, 0.7], 3),  # it led, lost the lead, and led for good
        ("uuuu", [0.5, 0.6, 0.7, 0.2], None),  # lost it in the end
        ("uuuu", [THIRD, THIRD, THIRD, THIRD], None),  # a tie is not the most likely
        ("iuiiu", [THIRD, 0.5, 0.5, 0.5, 0.6], 1),  # ticks without input are not observed
        ("gggu", [THIRD, THIRD, THIRD, 0.4], 1),
        ("iii", [0.9, 0.9, 0.9], None),  # nothing was observed
    ],
)
def test_convergence(letters: str, own: list[float], expected: int | None) -> None:
    assert convergence("spray_bottle", script(letters, own)) == expected


def test_user_actions_while_the_goal_is_no_candidate_are_passed_over() -> None:
    # Held after the third user action: the last two are about bins.
    assert convergence("spray_bottle", script("uuuguu", [0.2, 0.2, 0.8, 0.8, None, None])) == 3


def test_a_belief_that_starts_afresh_has_to_converge_again() -> None:
    # Converged at 1, grasped a wrong object, put it down: uniform again, converged with the second observed after that.
    own = [0.8, None, None, THIRD, 0.2, 0.5]
    assert convergence("spray_bottle", script("uuuiuu", own)) == 3
    # ... also when the very next user action already leads.
    assert convergence("spray_bottle", script("uuuiu", [0.8, None, None, THIRD, 0.5])) == 2


def test_a_single_goal_is_known_with_the_first_user_action() -> None:
    assert convergence("spray_bottle", script("iuu", [1.0, 1.0, 1.0], others=())) == 1


# ---- windows --------------------------------------------------------------------------------------------------------


def test_a_window_needs_five_ticks_without_input() -> None:
    assert windows_of("uiiiiu") == ()
    (window,) = windows_of("uiiiiiu")
    assert (window.first_tick, window.ticks, window.ended_by) == (1, 5, "user")


def test_belief_gain_is_the_change_at_the_user_action_that_ends_the_window() -> None:
    (window,) = windows_of("urrrrru", [0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.45], entropy=0.71)
    assert window.gain == pytest.approx(0.15)
    assert window.uncertain


def test_belief_gain_is_looked_at_above_the_threshold_only() -> None:
    (at_threshold,) = windows_of("urrrrru", entropy=0.7)
    assert at_threshold.gain == 0.0
    assert not at_threshold.uncertain


@pytest.mark.parametrize(
    ("letters", "expected"),
    [
        ("iiiiigu", [("gripper", 5, None)]),
        ("iiiiiU", [("pause", 5, None)]),
        ("iiiPiiiu", []),  # the pause cuts seven ticks into three and four
        ("iiiiiPiiiiu", [("pause", 5, None), ("user", 5, 0.0)]),
        ("uiiiiii", [("task", 6, None)]),
        ("iiigiii", []),
        ("irirru", [("user", 5, 0.0)]),  # robot and idle ticks are both without input
    ],
)
def test_what_ends_a_window(letters: str, expected: list[tuple[str, int, float | None]]) -> None:
    assert [(item.ended_by, item.ticks, item.gain) for item in windows_of(letters)] == expected


def test_a_missing_tick_ends_a_window() -> None:
    rows = script("iiiiiiiu", [0.5] * 8)
    del rows[3]
    task, windows = measure_task(scripted_task(rows), rows)
    assert windows == ()
    assert task.missing_ticks == 1


def test_no_gain_where_the_instructed_goal_is_not_a_candidate_or_the_candidates_changed() -> None:
    assert windows_of("iiiiiu", [None] * 6)[0].gain is None
    assert windows_of("iiiiiu", [None] * 5 + [0.5])[0].gain is None


def test_a_window_does_not_reach_into_the_next_task() -> None:
    first, second = script("uiii", [0.5] * 4), script("iiiu", [0.5] * 4, first_tick=4, task=2, kind="dropoff")
    tasks = [scripted_task(first), scripted_task(second, task=2)]
    assert measure(tasks, first + second).windows == ()


# ---- which tasks ----------------------------------------------------------------------------------------------------


def test_failed_pickups_stay_in_and_failed_or_missing_dropoffs_stay_out() -> None:
    first = script("uiiiiiu", [0.5] * 7)
    second = script("uiiiiiu", [0.5] * 7, first_tick=7, task=2, kind="dropoff")
    tasks = [
        scripted_task(first, outcome="failure", reason="knocked_over"),
        scripted_task(second, task=2, outcome="failure", reason="outside"),
        replace(scripted_task(first), task=4, kind="dropoff", outcome="not_run", first_tick=None, last_tick=None),
    ]
    measures = measure(tasks, first + second)
    assert [task.task for task in measures.analysed_tasks()] == [1]
    assert [window.task for window in measures.analysed_windows()] == [1]
    assert len(measures.not_run) == 1
    counts = summarise(measures)["balanced"]["tasks"]["all"]["counts"]
    assert (counts["failures"], counts["not_run"], counts["successes"], counts["analysed"]) == (2, 1, 0, 1)


def test_the_window_rate_is_windows_over_control_ticks() -> None:
    rows = script("uiiiiiuggiiiii", [0.5] * 14)
    (rate,) = window_rates(measure([scripted_task(rows)], rows))
    assert (rate.windows, rate.control_ticks) == (2, 12)
    assert rate.rate == pytest.approx(2 / 12)


# ---- bad rows -------------------------------------------------------------------------------------------------------


def test_a_task_without_ticks_is_named() -> None:
    with pytest.raises(StudyError, match=r"participant P001, trial 1, task 1: .*no ticks"):
        measure([scripted_task(script("u", [0.5]))], [])


def test_ticks_out_of_order_are_named() -> None:
    rows = script("uuu", [0.5] * 3)
    with pytest.raises(StudyError, match="task 1: its ticks are out of order"):
        measure([scripted_task(rows)], rows[::-1])
    other = tick_row("P002")
    with pytest.raises(StudyError, match="task 1: its ticks are not together"):
        measure([scripted_task(rows)], [rows[0], other, rows[1]])


@pytest.mark.parametrize("belief", ["", "{", "[0.5]", "{}", '{"a": 2.0}', '{"a": "much"}', '{"a": NaN}', "3"])
def test_a_belief_that_cannot_be_read_is_named(belief: str) -> None:
    rows = [replace(row, belief=belief) for row in script("u", [0.5])]
    with pytest.raises(StudyError, match="task 1: a belief is not JSON"):
        measure([scripted_task(rows)], rows)


def test_a_window_without_entropy_is_an_error_and_not_a_silent_absence() -> None:
    with pytest.raises(StudyError, match="entropy of tick 4 is nan"):
        windows_of("iiiiiu", entropy=float("nan"))


# ---- surveys and summaries ------------------------------------------------------------------------------------------


def answers(instrument: str, values: dict[str, str]) -> list[SurveyAnswerRow]:
    return [SurveyAnswerRow("P001", "balanced", 2, instrument, item, value, UTC) for item, value in values.items()]


TLX = dict.fromkeys(
    ("mental_demand", "physical_demand", "temporal_demand", "performance", "effort", "frustration"), "2"
)


def test_surveys_are_scored_per_trial_and_demographics_passed_over() -> None:
    sus = {f"sus_{number:02d}": "7" if number % 2 else "1" for number in range(1, 11)}  # the best there is
    rows = answers("sus_modified", sus) + answers("tlx_raw", {**TLX, "effort": "5"})
    rows.append(SurveyAnswerRow("P001", None, None, "demographics", "age_group", "18_24", UTC))
    assert [(item.instrument, item.score) for item in survey_scores(rows)] == [("sus_modified", 7.0), ("tlx_raw", 2.5)]


def test_half_a_questionnaire_has_no_score() -> None:
    rows = answers("tlx_raw", TLX)
    with pytest.raises(StudyError, match=r"participant P001, trial 2: .*frustration"):
        survey_scores(rows[:-1])
    with pytest.raises(StudyError, match=r"tlx_raw.effort is 'x'"):
        survey_scores(answers("tlx_raw", {**TLX, "effort": "x"}))
    with pytest.raises(StudyError, match="answered twice"):
        survey_scores(rows + rows[:1])


def test_a_summary_says_nothing_it_cannot_know() -> None:
    assert vars(summary([])) == {"n": 0, "mean": None, "sd": None}
    assert vars(summary([2.0])) == {"n": 1, "mean": 2.0, "sd": None}
    assert summary([1.0, 3.0]).sd == pytest.approx(2**0.5)


def test_a_study_with_known_measures_gives_them_back() -> None:
    def wanted(participant: str, condition: str, kind: str, rng: np.random.Generator) -> Wanted:
        return {
            "teleoperation": Wanted(60, 20, (0.01, 0.03)),
            "goal_oriented": Wanted(40, None, (0.05,)),
            "balanced": Wanted(50, 4, (-0.02,)) if kind == "pickup" else Wanted(30, 5),
        }[condition]

    data = data_set(2, wanted=wanted)
    measures = measure(data.tables["tasks"], data.tables["ticks"])
    found = summarise(measures)
    teleoperation, goal_oriented, balanced = (
        found[name]["tasks"] for name in ("teleoperation", "goal_oriented", "balanced")
    )
    assert teleoperation["all"]["efficiency_ticks"] == {"n": 12, "mean": 60.0, "sd": 0.0}
    assert teleoperation["all"]["convergence_user_actions"] == {"n": 12, "mean": 20.0, "sd": 0.0}
    assert teleoperation["pickup"]["belief_gain"]["n"] == 12
    assert teleoperation["pickup"]["belief_gain"]["mean"] == pytest.approx(0.02)
    assert teleoperation["all"]["window_rate"]["mean"] == pytest.approx(2 / 60)
    assert goal_oriented["all"]["counts"]["never_converged"] == 12
    assert goal_oriented["all"]["convergence_user_actions"] == {"n": 0, "mean": None, "sd": None}
    assert balanced["all"]["efficiency_ticks"]["mean"] == 40.0
    assert balanced["dropoff"]["belief_gain"]["n"] == 0
    assert set(balanced["all"]["belief_gain_by_goals"]) == {"4", "5", "6"}
    assert list(found) == ["teleoperation", "goal_oriented", "balanced"]
