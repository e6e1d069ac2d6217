"""An open link's rules: the ids in it, who is let in, where it leads on to."""

from __future__ import annotations

import pytest

from study.definition.link_placeholders import filled
from study.definition.sections import Recruitment
from study.flow.open_link import Answer, answer, ids_among, open_link, read_ids
from study.flow.protocol import State

RULES = Recruitment(open=True, quota=2)
PROLIFIC = {"PROLIFIC_PID": ["5f3c9a1b2d4e6f708192a3b4"], "STUDY_ID": ["64a1"], "SESSION_ID": ["64b2"]}


def test_the_ids_of_a_prolific_link_are_read_and_the_rest_is_left_alone() -> None:
    ids, wrong = read_ids(RULES, {**PROLIFIC, "utm_source": ["<script>"]})
    assert ids == {name: values[0] for name, values in PROLIFIC.items()}
    assert wrong == ()


def test_only_the_persons_id_must_be_there() -> None:
    assert read_ids(RULES, {"PROLIFIC_PID": ["ab"], "STUDY_ID": [""]}) == ({"PROLIFIC_PID": "ab"}, ())
    assert read_ids(RULES, {"STUDY_ID": ["64a1"]})[1] == ("PROLIFIC_PID is missing in the link.",)
    assert read_ids(RULES, {})[1] == ("PROLIFIC_PID is missing in the link.",)


NO_IDS = ["{{%PROLIFIC_PID%}}", "a b", "<b>", "x" * 101, "a\n", "ä", "\ud800", "a&b=c", "%41", "null\0"]


@pytest.mark.parametrize("value", NO_IDS, ids=range(len(NO_IDS)))
def test_what_is_no_id_is_said(value: str) -> None:
    ids, wrong = read_ids(RULES, {"PROLIFIC_PID": [value]})
    assert ids == {}
    assert len(wrong) == 1
    assert wrong[0].startswith("PROLIFIC_PID is not filled in as it should be")
    assert value not in wrong[0]


def test_an_id_given_twice_in_one_link_is_neither() -> None:
    assert read_ids(RULES, {"PROLIFIC_PID": ["a", "b"]}) == ({}, ("PROLIFIC_PID stands 2 times in the link.",))


@pytest.mark.parametrize(
    ("held", "state", "is_known", "expected"),
    [
        (0, None, False, "enrol"),
        (1, None, False, "enrol"),
        (2, None, False, "full"),
        (3, None, False, "full"),
        (2, "eligibility", False, "back"),  # the check may have asked for another browser
        (2, "consent", False, "back"),
        (2, "trial", True, "back"),
        (2, "done", True, "back"),
        (0, "demographics", False, "elsewhere"),
        (0, "paused", False, "elsewhere"),
        (0, "done", False, "elsewhere"),
        (0, "screened_out", False, "elsewhere"),
    ],
)
def test_one_place_for_one_id_and_nobody_walks_into_another_ones_session(
    held: int, state: State | None, is_known: bool, expected: Answer
) -> None:
    assert answer(RULES, held, state, is_known) == expected


def test_a_study_that_is_not_open_lets_back_only_those_who_are_in() -> None:
    closed = Recruitment(quota=5)
    assert answer(closed, 0, None, False) == "closed"
    assert answer(closed, 0, "trial", True) == "back"


def test_links_carry_the_ids_that_stand_in_braces() -> None:
    ids = {"survey_code": "1234"}
    sona = "https://school.example/webstudy_credit.aspx?experiment_id=7&survey_code={survey_code}"
    assert filled(sona, ids) == "https://school.example/webstudy_credit.aspx?experiment_id=7&survey_code=1234"
    assert filled("https://service.example/complete?cc=C1", {}) == "https://service.example/complete?cc=C1"
    assert filled(sona, {}) is None
    assert filled("", ids) is None


def test_the_link_to_give_out_has_a_place_for_every_id() -> None:
    link = "https://lab.example/study/join?PROLIFIC_PID={{%PROLIFIC_PID%}}&STUDY_ID={{%STUDY_ID%}}&SESSION_ID="
    assert open_link("https://lab.example/study", RULES) == link + "{{%SESSION_ID%}}"
    own = Recruitment(id_parameters=("survey_code", "mail"), person="mail")
    assert open_link("http://127.0.0.1:1", own) == "http://127.0.0.1:1/join?survey_code=%SURVEY_CODE%&mail=ID"


def test_only_the_links_ids_are_found_among_what_identifies_somebody() -> None:
    noted = [("label", "x"), ("id.PROLIFIC_PID", "5f"), ("user_agent_participant", "y"), ("id.STUDY_ID", "64")]
    assert ids_among(noted) == {"PROLIFIC_PID": "5f", "STUDY_ID": "64"}
