"""Words kept apart from their events, and put beside them again."""

from __future__ import annotations

import json
from typing import Any

from app.words import apart, with_words
from study.records import EventRow


def event(kind: str, **data: Any) -> EventRow:
    return EventRow("P001", None, None, "2026-01-01T00:00:00.000Z", kind, "participant", json.dumps(data))


def test_each_event_gets_its_own_words_back_and_the_others_stay_as_they_are() -> None:
    first, first_kept = apart("step_help", "the screen of Ann is dark")
    second, second_kept = apart("step_help", "now it is the sound")
    silent, nothing_kept = apart("step_help", None)
    events = (event("step_help", **second), event("step_help", **silent), event("step_help", by="AB", **first))
    assert not any("Ann" in row.data or "sound" in row.data for row in events)
    kept = (("label", "Ann"), *first_kept, *second_kept, *nothing_kept)
    assert with_words(events, kept) == [
        {"text": "now it is the sound"},
        {},
        {"by": "AB", "text": "the screen of Ann is dark"},
    ]
    assert with_words((event("task_done", task=1),), kept) == [{"task": 1}]


def test_words_that_were_erased_leave_a_blank() -> None:
    data, _ = apart("note", "gone")
    assert with_words((event("note", **data),), ()) == [{"text": ""}]
