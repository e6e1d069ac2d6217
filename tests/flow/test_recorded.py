"""What is read back of the record: by namespace, source and content together; the rest is as good as not there."""

from __future__ import annotations

import json
from typing import Any

import pytest

from study.flow.recorded import (
    ARM_FREED,
    CLOCK_SET,
    CONNECTED,
    PAGE_HIDDEN,
    READ_BACK,
    ROUND_TRIP,
    SET_UP,
    UNREADABLE,
    data_of,
    is_note,
    kind_of,
    time_of,
)
from study.records import EventRow
from tests.support.hostile_records import HOSTILE_DATA
from tests.support.study_samples import event_row


def row(kind: str, source: str, data: Any, **more: Any) -> EventRow:
    return event_row("P001", kind, source=source, data=data if isinstance(data, str) else json.dumps(data), **more)


def test_an_event_is_read_by_what_it_says_who_says_it_and_where() -> None:
    measured = ROUND_TRIP.of(row("round_trip", "lab", {"ms": 3}))
    assert measured is not None and measured.ms == 3.0
    assert ROUND_TRIP.of(row("round_trip", "participant", {"ms": 3})) is None
    assert ROUND_TRIP.of(row("page.round_trip", "lab", {"ms": 3})) is None
    assert CLOCK_SET.of(row("round_trip", "lab", {"by_s": 3})) is None


@pytest.mark.parametrize("event", [ROUND_TRIP, CLOCK_SET, SET_UP, ARM_FREED], ids=lambda event: event.kind)
@pytest.mark.parametrize("data", HOSTILE_DATA)
def test_what_cannot_be_read_is_as_good_as_not_there(event: Any, data: str) -> None:
    assert event.of(row(event.kind, event.sources[0], data)) is None


@pytest.mark.parametrize("data", HOSTILE_DATA)
@pytest.mark.parametrize("event", READ_BACK, ids=lambda event: event.kind)
def test_no_row_raises(event: Any, data: str) -> None:
    for kind in (event.kind, event.kind.removeprefix("page.")):
        for source in ("participant", "lab", "experimenter", "robot", "", "x" * 99):
            odd = row(kind, source, data)
            event.of(odd)
            json.dumps(data_of(odd), allow_nan=False)
            assert isinstance(kind_of(odd), str)


def test_notes_of_before_the_namespace_are_told_by_the_role_that_the_lab_added() -> None:
    old = row("page_hidden", "participant", {"role": "participant"})
    assert kind_of(old) == "page.hidden" and PAGE_HIDDEN.of(old)
    posing = row("step_setup", "participant", {"sound": True, "role": "participant"})
    assert is_note(posing) and SET_UP.of(posing) is None
    assert kind_of(posing) == "page.other.step_setup"
    step = row("step_setup", "participant", {"sound": True, "mapping": {"role": "participant"}})
    assert not is_note(step) and SET_UP.of(step)
    arrived = row("connected", "participant", {"role": "panel", "client": "tab"})
    assert not is_note(arrived) and CONNECTED.of(arrived)


def test_people_are_shown_what_cannot_be_read() -> None:
    assert data_of(row("x", "lab", '{"a": NaN}')) == {UNREADABLE: '{"a": NaN}'}
    assert data_of(row("x", "lab", "[" * 5000)) == {UNREADABLE: "[" * 200}


def test_a_time_that_is_none_is_none() -> None:
    assert time_of("1970-01-01T00:00:01.000Z") == 1.0
    assert [time_of(text) for text in (None, "", "yesterday", "9" * 30, "0000-00-00T00:00:00Z")] == [None] * 5
