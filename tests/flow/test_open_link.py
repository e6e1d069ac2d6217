"""An open link's rules: the ids in it, who is let in, where it leads on to."""

from __future__ import annotations

from urllib.parse import parse_qs, urlsplit

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


NO_IDS = ["a b", "b;", "7" * 101, "a\nb", "ä", "\ud800", "a&b=c", "41/", "abc\0"]


@pytest.mark.parametrize("value", NO_IDS, ids=range(len(NO_IDS)))
def test_what_is_no_id_is_said(value: str) -> None:
    ids, wrong = read_ids(RULES, {"PROLIFIC_PID": [value]})
    assert ids == {}
    assert len(wrong) == 1
    assert wrong[0].startswith("PROLIFIC_PID is not filled in as it should be")
    assert value not in wrong[0]


PLACEHOLDERS = [
    *(
        "ID",
        "id",
        "[ID]",
        "<ID>",
        "YOUR_ID",
        "your-id-here",
        "xxx",
        "XXXXXXXX",
        "___",
        "undefined",
        "null",
        "None",
        "NaN",
    ),
    *(
        "{{%PROLIFIC_PID%}}",
        "{PROLIFIC_PID}",
        "PROLIFIC_PID",
        "%SURVEY_CODE%",
        "${workerId}",
        "workerId",
        "[%mail_code%]",
    ),
    *(
        "mail_code",
        "MAIL-CODE",
        "*|MAIL_CODE|*",
        "${e://Field/PROLIFIC_PID}",
        "ASSIGNMENT_ID_NOT_AVAILABLE",
        "@@code@@",
    ),
]


@pytest.mark.parametrize("value", PLACEHOLDERS)
def test_what_stands_where_an_id_belongs_is_no_id(value: str) -> None:
    rules = Recruitment(open=True, quota=2, id_parameters=("mail_code",), person="mail_code")
    ids, wrong = read_ids(rules, {"mail_code": [value]})
    assert ids == {}
    assert len(wrong) == 1
    assert wrong[0].startswith("mail_code is still a placeholder: each person's own id belongs there")


@pytest.mark.parametrize("given", ["ab12 ", " ab12", "ab12\n", "\tab12\u00a0", "ab12\u2003"])
def test_blanks_around_an_id_are_not_part_of_it(given: str) -> None:
    assert read_ids(RULES, {"PROLIFIC_PID": [given], "STUDY_ID": ["  "]}) == ({"PROLIFIC_PID": "ab12"}, ())


@pytest.mark.parametrize("value", ["MY", "seat7", "ids", "person-12", "anna@uni.example", "5f3c9a1b2d4e", "Nan1", "xx"])
def test_ids_that_only_look_like_a_word_are_ids(value: str) -> None:
    assert read_ids(RULES, {"PROLIFIC_PID": [value]}) == ({"PROLIFIC_PID": value}, ())


@pytest.mark.parametrize("parameters", [("mail_code",), ("PROLIFIC_PID", "STUDY_ID"), ("survey_code",), ("id",)])
def test_the_link_to_give_out_opens_nothing_before_its_ids_are_filled_in(parameters: tuple[str, ...]) -> None:
    rules = Recruitment(open=True, quota=2, id_parameters=parameters, person=parameters[0])
    given = parse_qs(urlsplit(open_link("https://lab.example", rules)).query)
    assert read_ids(rules, given)[0] == {}


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
        (0, "lapsed", False, "enrol"),
        (2, "lapsed", True, "full"),
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
