"""Words that may identify somebody: kept apart from the record, which says only that there are some and how long.

event      {"by": "AB", "words": "note-1f2e3d4c", "characters": 17}      exported
identity   note-1f2e3d4c: "asked for her inhaler"                       never exported, gone when erased
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Mapping
from typing import Any

from study.flow.recorded import data_of, is_note
from study.records import EventRow

Private = tuple[tuple[str, str], ...]
"""(name, words) as they go into the store's identities."""


def apart(kind: str, text: str | None) -> tuple[dict[str, Any], Private]:
    """What an event may hold of a text, and the text under the name that the event gives it."""
    if not text:
        return {}, ()
    name = f"{kind}-{secrets.token_hex(4)}"
    return {"words": name, "characters": len(text)}, ((name, text),)


def with_words(events: Iterable[EventRow], identities: Iterable[tuple[str, str]]) -> list[dict[str, Any]]:
    """The data of events as experimenters read them: the words back in their place, under `text`.

    What a page noted by itself has no words of its own in the lab, whatever it says.
    """
    kept = dict(identities)
    return [data_of(row) if is_note(row) else _together(data_of(row), kept) for row in events]


def _together(data: dict[str, Any], kept: Mapping[str, str]) -> dict[str, Any]:
    if not isinstance(data.get("words"), str):
        return data
    rest = {name: value for name, value in data.items() if name not in ("words", "characters")}
    return {**rest, "text": kept.get(data["words"], "")}
