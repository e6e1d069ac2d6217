"""Who holds which cell, and what may be done to whom: pure values."""

from __future__ import annotations

import pytest

from study.definition.study import orders
from study.flow.protocol import State
from study.flow.roster import ACTS, Enrolled, EnrolmentKind, counts, grid, matches, why_not
from tests.support.study_samples import shipped_study

ORDERS = orders(shipped_study())


def one(
    number: int, state: State = "consent", kind: EnrolmentKind = "study", rejected: bool = False, order: int = 0
) -> Enrolled:
    return Enrolled(f"P{number:03d}", kind, state, ORDERS[order], rejected)


def test_the_grid_shows_who_holds_each_cell_and_which_order_is_next() -> None:
    everyone = [
        one(1, "done"),
        one(2, "trial", order=1),
        one(3, order=2),
        one(4, "withdrawn", order=3),
        one(5, "done", rejected=True, order=3),
        one(6, "done", kind="pilot", order=3),
        one(7, "aborted", order=4),
        one(9, "screened_out", order=5),
        one(10, "lapsed", order=5),
        Enrolled("P008", "study", "done", ("an", "older", "study"), False),
    ]
    rows = grid(shipped_study(), everyone)
    assert [row.order for row in rows] == list(ORDERS)
    assert [row.cells for row in rows] == [
        (("P001", "done"),),
        (("P002", "under_way"),),
        (("P003", "waiting"),),
        (),
        (),
        (),
    ]
    assert [row.lapsed for row in rows] == [0, 0, 0, 0, 0, 1]
    assert [row.is_next for row in rows] == [False, False, False, True, False, False]
    assert counts(everyone) == {
        "waiting": 1,
        "under_way": 1,
        "done": 2,
        "rejected": 1,
        "withdrawn": 1,
        "aborted": 1,
        "screened_out": 1,
        "lapsed": 1,
        "unreadable": 0,
    }


@pytest.mark.parametrize(
    ("person", "possible"),
    [
        (one(1), {"withdraw", "erase", "new_link"}),
        (one(1, "paused"), {"withdraw", "erase", "new_link"}),
        (one(1, "done"), {"reject", "erase"}),
        (one(1, "done", rejected=True), {"erase"}),
        (one(1, "done", kind="pilot"), {"erase"}),
        (one(1, "withdrawn"), {"erase"}),
        (one(1, "aborted"), {"erase"}),
    ],
)
def test_every_act_is_possible_or_says_why_not(person: Enrolled, possible: set[str]) -> None:
    reasons = {act: why_not(act, person) for act in ACTS}
    assert {act for act, why in reasons.items() if not why} == possible
    assert all(why.endswith(".") for act, why in reasons.items() if act not in possible)


def test_the_roster_is_filtered_by_group_and_by_words() -> None:
    assert matches(one(12), "Zoë", "all", " zo") and matches(one(12), "", "study", "p01")
    assert not matches(one(12), "", "all", "p013")
    assert matches(one(1, "done", rejected=True), "", "rejected", "")
    assert not matches(one(1, "done", rejected=True), "", "done", "")
    assert matches(one(1, kind="pilot"), "", "pilot", "") and not matches(one(1), "", "pilot", "")
