"""Words kept apart from their events, and put beside them again."""

from __future__ import annotations

import json
from typing import Any

from app.words import with_words
from study.records import EventRow


def event(kind: str, **data: Any) -> EventRow:
    return EventRow("P001", None, None, "2026-01-01T00:00:00.000Z", kind, "participant", json.dumps(data))


def test_each_event_gets_its_own_words_back_and_the_others_stay_as_they_are() -> None:
    events = (
        event("step_help", has_words=True),
        event("step_help", has_words=False),
        event("note", by="experimenter", has_words=True),
        event("step_help", has_words=True),
        event("task_marked", text="slipped"),
    )
    words = (("label", "Ann"), ("help", "first"), ("note", "a note"), ("help", "second"), ("user_agent", "Browser"))
    told = with_words(events, words)
    assert [json.loads(row.data) for row in told] == [
        {"words": "first"},
        {},
        {"by": "experimenter", "words": "a note"},
        {"words": "second"},
        {"text": "slipped"},
    ]
    assert told[4] is events[4]
    assert with_words(told, ()) == told


def test_words_that_are_gone_leave_a_blank() -> None:
    assert json.loads(with_words((event("note", has_words=True),), ())[0].data) == {"words": ""}
