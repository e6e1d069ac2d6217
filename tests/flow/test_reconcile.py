"""A recruitment service's list beside the roster: what is read of the lists of several services, and what is found."""

from __future__ import annotations

import pytest

from study.definition.study import orders
from study.flow.reconcile import Known, reconcile, summary
from study.flow.recruiter_list import Listed, ListError, read_list
from study.flow.roster import Enrolled
from tests.support.study_samples import shipped_study

ORDER = orders(shipped_study())[0]
PROLIFIC = (
    "\ufeffSubmission id,Participant id,Status,Started at\r\n"
    "64a,5f01,APPROVED,2026-01-01\r\n64b,5f02,TIMED-OUT,\r\n64c,5f03,AWAITING REVIEW,\r\n64d,,RETURNED,\r\n\r\n"
)
CONNECT = "AssignmentId;ParticipantId;Status\nA1;AB12;Approved\nA2;CD34;Abandoned\n"
MTURK = '"HITId","WorkerId","AssignmentStatus"\n"3X","A1B2","Submitted"\n"3X","C3D4","Rejected"\n'
SONA = "survey_code,Credit Status\n77,Credit Granted\n78,Unexcused No-Show\n"
TOOLKIT = "AmazonIdentifier\tApprovalStatus\nA1B2\tNot Submitted/Incomplete\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (PROLIFIC, [("5f01", "approved", 2), ("5f02", "timed_out", 3), ("5f03", "awaiting", 4), ("", "returned", 5)]),
        ("sep=;\r\nParticipant id;Status\r\n5f01;APPROVED\r\n", [("5f01", "approved", 3)]),
        (CONNECT, [("AB12", "approved", 2), ("CD34", "returned", 3)]),
        (MTURK, [("A1B2", "awaiting", 2), ("C3D4", "rejected", 3)]),
        (TOOLKIT, [("A1B2", "timed_out", 2)]),
        (
            "survey_code,Credit Status\n77,Credit Granted\n78,Unexcused No-Show\n",
            [("77", "approved", 2), ("78", "no_show", 3)],
        ),
        ("Participant id,Status\n5f01,SLEEPING\n", [("5f01", "unclear", 2)]),
    ],
    ids=["Prolific", "a spreadsheet", "Connect", "Mechanical Turk", "the older toolkit", "SONA", "a word of tomorrow"],
)
def test_the_lists_of_services_are_read_as_they_are(text: str, expected: list[tuple[str, str, int]]) -> None:
    assert [(line.person, line.state, line.line) for line in read_list(text)] == expected


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('Participant id,Status\n"5f01,RETURNED\n5f02,APPROVED\n', "cannot be read as a table"),
        ("Participant id,Status,status\n5f01,RETURNED,APPROVED\n", "has 2 columns 'Status'; leave the one that counts"),
    ],
    ids=["a quote that is never closed", "two columns of one name"],
)
def test_a_list_that_says_two_things_is_refused(text: str, says: str) -> None:
    with pytest.raises(ListError, match=says):
        read_list(text)


def test_a_line_that_names_nobody_is_told() -> None:
    listed = read_list("Participant id,Status\nx1,APPROVED\n,APPROVED\n,RETURNED\n")
    found = [(one.kind, one.act, one.advice) for one in reconcile(listed, []) if not one.person]
    assert found == [("unclear", "", f"Line {line} of the list has no id: look who that is.") for line in (3, 4)]


def test_another_list_is_read_by_the_names_of_its_columns() -> None:
    text = "who,became\nx1,approved\n"
    assert read_list(text, id_column="Who", status_column="became") == (Listed("x1", "approved", "approved", 2),)
    with pytest.raises(ListError, match="with the id of a person is known; name one with --id-column: who, became"):
        read_list(text)
    with pytest.raises(ListError, match="no column 'code'; name one with --status-column"):
        read_list(text, id_column="who", status_column="code")


@pytest.mark.parametrize(
    "text", ["", "\n", "Participant id,Status\n", "Participant id,Status\n,APPROVED\n", "\x00" * 9]
)
def test_a_list_with_nobody_on_it_says_so(text: str) -> None:
    with pytest.raises(ListError):
        read_list(text)


def person(number: int, state: str, *ids: str, rejected: bool = False, over_link: bool = True) -> Known:
    return Known(Enrolled(f"P{number:03d}", "study", state, ORDER, rejected), ids, over_link)


def listed(**states: str) -> tuple[Listed, ...]:
    return read_list("Participant id,Status\n" + "".join(f"{name},{state}\n" for name, state in states.items()))


@pytest.mark.parametrize(
    ("there", "here", "kind", "act"),
    [
        ("APPROVED", "done", "agrees", ""),
        ("AWAITING REVIEW", "trial", "incomplete_here", ""),
        ("APPROVED", "withdrawn", "incomplete_here", ""),
        ("APPROVED", "screened_out", "incomplete_here", ""),
        ("RETURNED", "consent", "gone_there", "free_place"),
        ("TIMED-OUT", "survey", "gone_there", "abort"),
        ("RETURNED", "withdrawn", "agrees", ""),
        ("TIMED-OUT", "lapsed", "agrees", ""),
        ("TIMED-OUT", "done", "complete_here", ""),
        ("REJECTED", "done", "complete_here", "reject"),
        ("ACTIVE", "trial", "agrees", ""),
        ("ACTIVE", "done", "complete_here", ""),
        ("SLEEPING", "trial", "unclear", ""),
    ],
)
def test_each_person_is_found_once_with_what_might_be_done(there: str, here: str, kind: str, act: str) -> None:
    (found,) = reconcile(listed(x1=there), [person(1, here, "X1")])
    assert (found.kind, found.act, found.participant, found.lab) == (kind, act, "P001", here)
    assert bool(found.advice) == (kind != "agrees")


def test_who_stands_on_one_side_only_is_told() -> None:
    roster = [
        person(1, "consent", "x1"),
        person(2, "done", "x2"),
        person(3, "trial", "a label", over_link=False),
        Known(Enrolled("T004", "pilot", "trial", ORDER, False), ("x4",)),
    ]
    found = reconcile(listed(y1="APPROVED", y2="RETURNED"), roster)
    assert [(one.kind, one.person, one.participant, one.act) for one in found] == [
        ("unknown_here", "y1", "", ""),
        ("unknown_here", "y2", "", ""),
        ("unknown_there", "x1", "P001", "free_place"),
        ("unknown_there", "x2", "P002", ""),
    ]
    assert summary(found) == {"unknown_here": 2, "unknown_there": 2}


def test_who_is_there_twice_is_told_and_nothing_is_proposed() -> None:
    twice = read_list("Participant id,Status\nx1,RETURNED\nX1,APPROVED\nx2,RETURNED\n")
    roster = [person(1, "consent", "x1"), person(2, "consent", "x2"), person(3, "trial", "x2", over_link=False)]
    assert [(one.kind, one.participant, one.act) for one in reconcile(twice, roster)] == [
        ("twice", "P001", ""),
        ("twice", "P001", ""),
        ("twice", "P002, P003", ""),
    ]
