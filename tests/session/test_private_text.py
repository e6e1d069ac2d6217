"""Words kept apart from their events, and put beside them again."""

from __future__ import annotations

import json
from typing import Any

from app.session.private_text import apart, with_words
from study.records import EventRow


def event(kind: str, **data: Any) -> EventRow:
    return EventRow("P001", None, None, "2026-01-01T00:00:00.000Z", kind, "participant", json.dumps(data))


def test_each_event_gets_its_own_words_back_and_the_others_stay_as_they_are() -> None:
    first, kept_first = apart("help", "where is the bin?")
    second, kept_second = apart("help", "thanks, Ann")
    events = (
        event("step_help", **second),
        event("step_help"),
        event("step_help", **first),
        event("grasped", object="can"),
    )
    assert "Ann" not in "".join(row.data for row in events)
    assert second["characters"] == len("thanks, Ann")
    assert with_words(events, (("label", "Ann"), *kept_first, *kept_second)) == [
        {"text": "thanks, Ann"},
        {},
        {"text": "where is the bin?"},
        {"object": "can"},
    ]


def test_words_that_are_gone_leave_a_blank() -> None:
    data, _ = apart("note", "forgotten")
    assert with_words((event("note", **data),), ()) == [{"text": ""}]


def test_nothing_said_leaves_nothing() -> None:
    assert apart("note", "") == apart("note", None) == ({}, ())
