"""The one door to events of the record: what the lab goes by when it reads back what it wrote.

    ROUND_TRIP.of(row)    the measurement, or None where the row is no such event, is somebody else's, or cannot be read
    data_of(row)          what an event says, as an object; for people to look at

An event is what its namespace, its source and its kind say together, and never what it is called alone. What a page
noted stands in the namespace `page.` (`study.flow.notes`). Before there was one, a page noted under any name it liked:
such rows are told by the page's role, which the lab added to them, and read as notes or not at all. A row that cannot
be read is as good as none: no record may keep a session from going on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from study.flow.notes import NAMESPACE, NOTES
from study.records import EventRow, unix_s

UNREADABLE = "unreadable"
"""Under which name people are shown the beginning of data that are no object."""
SHOWN_CHARACTERS = 200
MOST_S = 1e10
"""No time that the lab measures is longer: some three hundred years."""


class Told(BaseModel):
    """Base of what is read of an event. What else stands in it is another reader's."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)


class Nothing(Told):
    """That it happened is all that is read of it."""


class ClockSet(Told):
    """The computer's clock was set."""

    by_s: Annotated[float, Field(ge=-MOST_S, le=MOST_S, allow_inf_nan=False)]
    """By how much; back is negative."""


class RoundTrip(Told):
    """The way to the page and back."""

    ms: Annotated[float, Field(ge=0.0, le=1000.0 * MOST_S, allow_inf_nan=False)]


class Connected(Told):
    """A page is there."""

    role: Literal["participant", "panel"] = "participant"


class SetUp(Told):
    """What the set-up found."""

    sound: bool
    """Whether the alarm was heard."""


class Freed(Told):
    """The arm was freed."""

    phase: Literal["practice", "trial"]


class RanOn(Told):
    """Which robot and which machine a worker runs a practice or a trial on; the rest is known of a robot that does not
    ship."""

    robot: str
    machine: str = ""
    """As `study.store.fingerprint_id` calls it; "" = recorded before machines were named."""
    phase: Literal["practice", "trial"] = "trial"
    package: str = ""
    version: str = ""
    sha256: str = ""
    look: str = ""
    """How the robot was drawn; "" = recorded before there were looks, or nothing was drawn."""


class Received(Told):
    """What a tab was told is saved."""

    acknowledged: Annotated[int, Field(ge=0, le=2**53)]
    ticks: dict[str, Annotated[int, Field(ge=0, le=2**53)]]
    client: str = ""
    """The tab, as the lab knows it."""


Data = TypeVar("Data", bound=Told)


@dataclass(frozen=True)
class Recorded(Generic[Data]):
    """An event that the lab reads back: its kind, who can have caused it, and what is read of it."""

    kind: str
    sources: tuple[str, ...]
    data: type[Data]

    def of(self, row: EventRow) -> Data | None:
        """What a row says, if it is this event and can be read."""
        if row.source not in self.sources or kind_of(row) != self.kind:
            return None
        try:
            return self.data.model_validate(_object(row.data) or {})
        except ValidationError:
            return None


CLOCK_SET = Recorded("clock_set", ("lab",), ClockSet)
ROUND_TRIP = Recorded("round_trip", ("lab",), RoundTrip)
FOCUS_LOST = Recorded("focus_lost", ("participant",), Nothing)
CONNECTED = Recorded("connected", ("participant",), Connected)
TAB_TAKEN_OVER = Recorded("tab_taken_over", ("participant",), Connected)
SET_UP = Recorded("step_setup", ("participant",), SetUp)
HELP = Recorded("step_help", ("participant",), Nothing)
HELP_SEEN = Recorded("help_seen", ("experimenter",), Nothing)
FREE_ASKED_BY_PARTICIPANT = Recorded("step_free_arm", ("participant",), Nothing)
FREE_ASKED_BY_EXPERIMENTER = Recorded("free_arm", ("experimenter",), Nothing)
ARM_FREED = Recorded("arm_freed", ("participant", "experimenter", "robot"), Freed)
FREE_NOT_NEEDED = Recorded("free_not_needed", ("lab",), Nothing)
STARTED_BY_PARTICIPANT = Recorded("step_start", ("participant",), Nothing)
STARTED_BY_EXPERIMENTER = Recorded("start", ("experimenter",), Nothing)
RAN_ON = Recorded("robot", ("lab",), RanOn)
PAGE_HIDDEN = Recorded(f"{NAMESPACE}hidden", ("participant",), Nothing)
PAGE_VISIBLE = Recorded(f"{NAMESPACE}visible", ("participant",), Nothing)
PAD_UNPLUGGED = Recorded(f"{NAMESPACE}pad_unplugged", ("participant",), Nothing)
RECEIVED = Recorded(f"{NAMESPACE}received", ("participant",), Received)

READ_BACK: tuple[Recorded[Any], ...] = (
    *(CLOCK_SET, ROUND_TRIP, FOCUS_LOST, CONNECTED, TAB_TAKEN_OVER, PAGE_HIDDEN, PAGE_VISIBLE, PAD_UNPLUGGED),
    *(SET_UP, HELP, HELP_SEEN),
    *(FREE_ASKED_BY_PARTICIPANT, FREE_ASKED_BY_EXPERIMENTER, ARM_FREED, FREE_NOT_NEEDED),
    *(STARTED_BY_PARTICIPANT, STARTED_BY_EXPERIMENTER, RAN_ON, RECEIVED),
)
"""Every event that the lab goes by."""

_OF_CONNECTIONS = ("connected", "tab_taken_over", "disconnected")
"""What the lab itself records of a page, with its role."""
_OLD_NAMES: Mapping[str, str] = {"page_hidden": "hidden", "page_visible": "visible"}
"""Notes that were called otherwise before they had a namespace."""


def is_note(row: EventRow) -> bool:
    """Whether a page noted this by itself, whatever it called it."""
    return kind_of(row).startswith(NAMESPACE)


def kind_of(row: EventRow) -> str:
    """The kind of an event, with the namespace of notes also where the record is older than that. A note of then whose
    name the lab does not know is in it too, under that name."""
    if row.source != "participant" or row.kind.startswith(NAMESPACE) or row.kind in _OF_CONNECTIONS:
        return row.kind
    if (_object(row.data) or {}).get("role") not in ("participant", "panel"):
        return row.kind
    known = _OLD_NAMES.get(row.kind, row.kind)
    return f"{NAMESPACE}{known}" if known in NOTES else f"{NAMESPACE}other.{row.kind}"


def data_of(row: EventRow) -> dict[str, Any]:
    """What an event says. What is no object, or holds numbers that JSON has not, is shown as the text it is."""
    found = _object(row.data)
    return {UNREADABLE: row.data[:SHOWN_CHARACTERS]} if found is None else found


def time_of(utc: str | None) -> float | None:
    """A time of day in seconds since 1970; None for none, and for what is none."""
    try:
        return None if utc is None else unix_s(utc)
    except (ValueError, OverflowError):
        return None


def _object(text: str) -> dict[str, Any] | None:
    try:
        found = json.loads(text, parse_constant=_no_number, parse_float=_finite)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is too large")
    return value
