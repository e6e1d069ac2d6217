"""Words that may identify somebody: kept apart from the events that say they were said, shown beside them to whoever
may read them.

A note of the experimenter's, what a participant wrote when calling for help, and why they stopped are in the table of
identities, which no export holds. The event in the log has only `has_words`. Both are written in one commit and in the
same order, so that the n-th such event and the n-th words of its kind belong together.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from study.records import EventRow

KEPT_AS: Mapping[str, str] = {"note": "note", "step_help": "help", "step_withdraw": "withdraw_reason"}
"""Kind of event to the kind its words are kept under."""


def with_words(events: Iterable[EventRow], words: Iterable[tuple[str, str]]) -> tuple[EventRow, ...]:
    """The events as the experimenter may read them: each `has_words` replaced by the words.

    `events` are all that go with `words`, the (kind, text) kept apart, in order: everything of one participant, or of
    one commit.
    """
    waiting: dict[str, Iterator[str]] = {}
    kept = tuple(words)
    for kind in KEPT_AS.values():
        waiting[kind] = iter([text for found, text in kept if found == kind])
    return tuple(_told(row, waiting[KEPT_AS[row.kind]]) if row.kind in KEPT_AS else row for row in events)


def _told(row: EventRow, words: Iterator[str]) -> EventRow:
    data = json.loads(row.data)
    if "has_words" not in data:
        return row
    said = {"words": next(words, "")} if data.pop("has_words") else {}
    return replace(row, data=json.dumps({**data, **said}))
