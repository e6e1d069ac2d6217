"""What a page may note by itself: one row for each name, with what it must hold and who may say it.

A note is logged as the event `page.NAME`. Nothing of the lab's own begins so, and what else a page says is a step;
that is checked as well. The record is read back through `study.flow.recorded`. A page of one's own has notes too
(`study.flow.page.FlowPage.notes`), under `own.NAME`: events `page.own.NAME`, which the lab never reads.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field

from study.flow.flow import FLOW, Flow
from study.flow.page import MAX_NOTE_CHARACTERS, NoData, Refused, StepData, parse

NAMESPACE = "page."
"""What the kinds of these events begin with in the record."""
OWN = "own."
"""What the names of notes of a page of one's own begin with."""

Role: TypeAlias = Literal["participant", "panel"]
Word: TypeAlias = Annotated[str, Field(max_length=64)]
Count: TypeAlias = Annotated[int, Field(ge=0, le=2**53, strict=True)]
MAX_PHASES = 60


class PadData(StepData):
    """Which gamepad."""

    pad_id: Annotated[str, Field(max_length=200)] = ""
    """What it calls itself."""


class ViewData(StepData):
    """Which view."""

    view: Word
    """The view's name."""


class TimerData(StepData):
    """Why the heartbeat's worker does not beat."""

    why: Literal["threw", "error", "silent"]
    """It could not be made, it failed, or it said nothing."""


class HeardData(StepData):
    """What was said about the alarm on the second device."""

    heard: bool
    """Whether it was heard."""


class ReceivedData(StepData):
    """What a tab was told is on disk."""

    acknowledged: Count
    """How many of its submits and notes, these reports apart."""
    ticks: Annotated[dict[Word, Count], Field(max_length=MAX_PHASES)] = Field(default_factory=dict)
    """Ticks of each practice and trial, by its name and number: the last one's number and one."""


@dataclass(frozen=True)
class NoteType:
    """One name."""

    meaning: str
    data: type[StepData] = NoData
    roles: tuple[Role, ...] = ("participant",)
    """The pages that may say it."""


NOTES: Mapping[str, NoteType] = {
    "hidden": NoteType("The page is not seen any more: another tab, or a window over all of it."),
    "visible": NoteType("The page is seen again."),
    "pad_plugged": NoteType("The gamepad in use is there.", PadData),
    "pad_unplugged": NoteType("The gamepad in use is gone.", PadData),
    "view_switched": NoteType("Another view of the scene was chosen.", ViewData),
    "heartbeat_by_timer": NoteType("The page's own timer beats instead of its worker.", TimerData),
    "message_dismissed": NoteType("The participant has put the experimenter's message away."),
    "panel_later": NoteType("The set-up goes on before the second device is there."),
    "panel_heard": NoteType("Whether the alarm is heard on the second device.", HeardData, ("panel",)),
    "received": NoteType(
        "What this tab was told is saved, once the study is over: the certificate compares it with what is stored.",
        ReceivedData,
        ("participant", "panel"),
    ),
    "in_step": NoteType(
        "Nothing: its acknowledgement tells a scripted client that everything before it has been dealt with.",
        roles=("participant", "panel"),
    ),
}
"""Every note of the pages that ship."""


def note_types(flow: Flow = FLOW) -> Mapping[str, NoteType]:
    """Every note that the pages of a flow may send, by its name on the wire."""
    own = {
        f"{OWN}{name}": NoteType((data.__doc__ or "").strip(), data)
        for page in flow.pages
        for name, data in page.notes.items()
    }
    return {**NOTES, **own}


def read_note(flow: Flow, name: str, data: Mapping[str, Any], role: Role) -> tuple[str, dict[str, Any]]:
    """The event that a note becomes, as (kind, data).

    Raises `Refused` for a note that this page has not, or whose data are not what its name stands for.
    """
    known = note_types(flow).get(name)
    if known is None:
        raise Refused("invalid", ("name", f"no note {name!r}; notes are {', '.join(note_types(flow))}"))
    if role not in known.roles:
        raise Refused("illegal", ("name", f"{name!r} is noted by {' or '.join(known.roles)}, and this page is {role}"))
    told = parse(known.data, data).model_dump(mode="json")
    size = len(json.dumps(told))
    if size > MAX_NOTE_CHARACTERS:
        raise Refused("invalid", ("data", f"is {size} characters of JSON; a note has {MAX_NOTE_CHARACTERS} at most"))
    return f"{NAMESPACE}{name}", {**told, "role": role}
