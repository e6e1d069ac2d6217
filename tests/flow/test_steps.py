"""What each step of a page must contain, and what follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from study.definition.builtin_questionnaires import INSTRUMENTS
from study.flow.facts import as_read
from study.flow.flow import FLOW
from study.flow.page import Outcome, Refused, StepContext, parse
from study.flow.protocol import Event, EventName
from study.flow.steps import AlertData
from tests.support.study_samples import shipped_study

STUDY, STEPS = shipped_study(), FLOW.steps
UTC = "2026-01-01T00:00:00.000Z"
CONTEXT = StepContext(STUDY, replace(FLOW.new_session("p07", 3), trial=2), "balanced", UTC, lacking=("webgl",))

DEMOGRAPHICS = {item.id: item.options[0].id for item in STUDY.demographics if item.required}
COMPREHENSION = {question.id: question.correct for question in STUDY.instructions.questions}
SURVEY = {name: {item.id: 4 for item in INSTRUMENTS[name].items} for name in STUDY.surveys}
SETUP = {"device": "gamepad", "pad_id": "a pad", "mapping": {"open": 3}, "dead_zone": 0.3, "sound": True}


def take(step: str, data: Mapping[str, Any]) -> Outcome:
    return STEPS[step](CONTEXT, data)


def refusal(step: str, data: Mapping[str, Any]) -> Refused:
    with pytest.raises(Refused) as caught:
        take(step, data)
    return caught.value


def fields(refused: Refused) -> list[str | None]:
    return [field for field, _ in refused.problems]


# ---- what leads on --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("step", "data", "event"),
    [
        ("eligibility", {}, "eligible"),
        ("consent", {"accepted": True, "hash": as_read(STUDY).consent.hash}, "consent_given"),
        ("decline", {}, "consent_declined"),
        ("demographics", {"answers": DEMOGRAPHICS}, "demographics_done"),
        ("setup", SETUP, "setup_done"),
        ("setup", {"device": "keyboard", "sound": False}, "setup_done"),
        ("instructions", {"answers": COMPREHENSION}, "instructions_done"),
        ("start", {}, "start"),
        ("survey", {"answers": SURVEY}, "survey_done"),
        ("continue", {}, "continue"),
        ("resume", {}, "resume"),
        ("debrief", {"answers": {}}, "debrief_done"),
        ("debrief", {"answers": {"comments": "It was fun."}}, "debrief_done"),
        ("withdraw", {}, "withdraw"),
    ],
)
def test_a_step_filled_in_well_leads_on(step: str, data: dict[str, Any], event: EventName) -> None:
    assert take(step, data).event == Event(event)


@pytest.mark.parametrize("state", FLOW.states)
def test_the_arm_is_freed_where_somebody_drives_also_in_a_pause(state: str) -> None:
    for session in (replace(CONTEXT.session, state=state), replace(CONTEXT.session, state="paused", resume_to=state)):
        context = replace(CONTEXT, session=session)
        if state in ("practice", "trial"):
            assert STEPS["free_arm"](context, {}) == Outcome(frees=True)
        else:
            with pytest.raises(Refused, match="during practice and trials"):
                STEPS["free_arm"](context, {})


def test_a_page_says_whether_the_robot_is_to_be_seen() -> None:
    assert take("picture", {"there": False, "why": "context_lost"}).event == Event("picture_lost", "context_lost")
    assert take("picture", {"there": True}).event is None, "nobody missed it"
    with pytest.raises(Refused, match="Input should be"):
        take("picture", {"there": False, "why": "boredom"})


def test_every_step_but_a_few_is_tried_above() -> None:
    assert set(STEPS) == {
        *(
            "eligibility",
            "leave",
            "consent",
            "decline",
            "demographics",
            "setup",
            "instructions",
            "start",
            "survey",
            "continue",
            "resume",
            "free_arm",
        ),
        *("debrief", "withdraw", "help", "picture"),
    }


def test_consent_names_the_text_agreed_to() -> None:
    assert (
        take("consent", {"accepted": True, "hash": as_read(STUDY).consent.hash}).consent_hash
        == as_read(STUDY).consent.hash
    )
    assert take("decline", {}).consent_hash is None


def test_a_reason_for_leaving_is_kept_and_none_is_needed() -> None:
    said = take("withdraw", {"reason": "no time"})
    assert (said.event, said.words) == (Event("withdraw"), "no time")
    silent = take("withdraw", {"reason": None})
    assert (silent.event, silent.words) == (Event("withdraw"), None)


def test_help_is_a_line_in_the_log_and_changes_nothing() -> None:
    assert take("help", {"text": "Where is the bin?"}) == Outcome(words="Where is the bin?")
    assert take("help", {}).event is None


def test_the_device_is_logged_as_it_was_set_up() -> None:
    assert take("setup", SETUP).log == SETUP


def test_survey_answers_are_about_this_trial_and_the_others_about_the_session() -> None:
    survey = take("survey", {"answers": SURVEY}).answers
    assert len(survey) == 16
    assert {(row.participant, row.condition, row.trial, row.value, row.answered_utc) for row in survey} == {
        ("p07", "balanced", 2, "4", UTC)
    }
    assert {row.instrument for row in survey} == set(STUDY.surveys)
    asked = [
        *take("demographics", {"answers": DEMOGRAPHICS}).answers,
        *take("instructions", {"answers": COMPREHENSION}).answers,
        *take("debrief", {"answers": {"comments": "Fine."}}).answers,
    ]
    assert {(row.condition, row.trial) for row in asked} == {(None, None)}
    assert {row.instrument for row in asked} == {"demographics", "comprehension", "debrief"}


# ---- what is refused ------------------------------------------------------------------------------------------------

UNASKED = {"extra": 1}


@pytest.mark.parametrize(
    ("step", "data", "field"),
    [
        ("consent", {"hash": as_read(STUDY).consent.hash}, "data.accepted"),
        ("consent", {"accepted": False, "hash": as_read(STUDY).consent.hash}, "data.accepted"),
        ("consent", {"accepted": True}, "data.hash"),
        ("consent", {"accepted": True, "hash": "0" * 64}, "data.hash"),
        ("consent", {"accepted": True, "hash": as_read(STUDY).consent.hash, **UNASKED}, "data.extra"),
        ("decline", UNASKED, "data.extra"),
        ("demographics", {}, "data.answers"),
        ("demographics", {"answers": ["x"]}, "data.answers"),
        ("demographics", {"answers": {**DEMOGRAPHICS, "age_group": "900"}}, "answers.age_group"),
        ("demographics", {"answers": {**DEMOGRAPHICS, "shoe_size": "44"}}, "answers.shoe_size"),
        ("eligibility", {"width_px": -1}, "data.width_px"),
        ("eligibility", {"user_agent": "x" * 501}, "data.user_agent"),
        ("eligibility", UNASKED, "data.extra"),
        ("leave", UNASKED, "data.extra"),
        ("setup", {**SETUP, "device": "telepathy"}, "data.device"),
        ("setup", {**SETUP, "dead_zone": 1.0}, "data.dead_zone"),
        ("setup", {**SETUP, "dead_zone": float("nan")}, "data.dead_zone"),
        ("setup", {**SETUP, "sound": "perhaps"}, "data.sound"),
        ("setup", {**SETUP, "pad_id": "x" * 201}, "data.pad_id"),
        ("setup", {**SETUP, "mapping": {"open": "x" * 9000}}, "data.mapping"),
        ("setup", {**SETUP, "mapping": {str(k): k for k in range(41)}}, "data.mapping"),
        ("instructions", {"answers": None}, "data.answers"),
        ("start", UNASKED, "data.extra"),
        ("survey", {"answers": {**SURVEY, "mood": {}}}, "answers.mood"),
        ("survey", {"answers": {**SURVEY, "tlx_raw": {**SURVEY["tlx_raw"], "effort": 8}}}, "answers.tlx_raw.effort"),
        ("continue", UNASKED, "data.extra"),
        ("resume", UNASKED, "data.extra"),
        ("debrief", {"answers": {"comments": 5}}, "answers.comments"),
        ("debrief", {"answers": {"secret": "?"}}, "answers.secret"),
        ("withdraw", {"reason": "x" * 4001}, "data.reason"),
        ("withdraw", {"reason": 5}, "data.reason"),
        ("help", {"text": ["x"]}, "data.text"),
    ],
)
def test_bad_data_is_refused_with_the_field_that_is_wrong(step: str, data: dict[str, Any], field: str) -> None:
    refused = refusal(step, data)
    assert refused.code == "invalid"
    assert fields(refused) == [field]
    assert all(message for _, message in refused.problems)


def test_a_required_item_left_out_is_named() -> None:
    left_out = {name: value for name, value in DEMOGRAPHICS.items() if name != "handedness"}
    assert fields(refusal("demographics", {"answers": left_out})) == ["answers.handedness"]


def test_nothing_of_a_survey_is_skipped_silently() -> None:
    everything = [f"answers.{name}.{item.id}" for name in STUDY.surveys for item in INSTRUMENTS[name].items]
    assert fields(refusal("survey", {"answers": {}})) == everything
    refused = refusal("survey", {"answers": {**SURVEY, "sus_modified": {}}})
    assert len(refused.problems) == 10
    assert refused.kept == ()


def test_a_wrong_answer_of_the_check_is_refused_but_kept_for_the_record() -> None:
    wrong = {**COMPREHENSION, "on_sound": "ignore"}
    refused = refusal("instructions", {"answers": wrong})
    assert fields(refused) == ["answers.on_sound"]
    assert {row.item: row.value for row in refused.kept} == wrong
    assert "log" not in refused.problems[0][1]  # the right option is not given away


def test_of_a_malformed_check_only_what_was_asked_is_kept() -> None:
    refused = refusal("instructions", {"answers": {"which_object": "nearest", "on_sound": ["log"], "other": "x"}})
    assert {"answers.which_object", "answers.on_sound", "answers.other", "answers.robot_moves"} == set(fields(refused))
    assert [(row.item, row.value) for row in refused.kept] == [("which_object", "nearest")]


@pytest.mark.parametrize(
    ("data", "field"),
    [({}, "data.alert"), ({"alert": 0}, "data.alert"), ({"alert": 1, "value": 3.5}, "data.value")],
)
def test_an_answer_to_a_reading_names_its_alert(data: dict[str, Any], field: str) -> None:
    with pytest.raises(Refused) as caught:
        parse(AlertData, data)
    assert fields(caught.value) == [field]
