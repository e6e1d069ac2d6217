"""What a recruitment service says of the people it sent: its list, as it is exported, read. Pure.

The services name their columns and states differently; `COLUMNS` and `STATES` have those of Prolific, CloudResearch
(Connect and the older toolkit), Amazon Mechanical Turk and SONA. Anything else is told by `read_list`'s options.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from study.records import StudyError
from study.text_file import table_rows

ServiceState = Literal[
    "approved", "awaiting", "active", "rejected", "returned", "timed_out", "screened_out", "no_show", "unclear"
]
SERVICE_STATES: tuple[ServiceState, ...] = get_args(ServiceState)
COLUMNS: Mapping[str, tuple[str, ...]] = {
    "id": ("participant id", "prolific pid", "prolific id", "worker id", "amazon identifier", "survey code", "id code"),
    "status": ("status", "approval status", "assignment status", "participation status", "credit status"),
}
"""Headings of the two columns that are read, in small letters without marks; the first that is there counts."""
_WORDS: Mapping[ServiceState, tuple[str, ...]] = {
    "approved": ("approved", "auto approved", "paid", "credit granted", "participated", "partially approved"),
    "awaiting": ("awaiting review", "submitted", "pending", "pending approval", "completed", "awaiting action"),
    "active": ("active", "in progress", "reserved", "accepted", "started", "signed up"),
    "rejected": ("rejected", "denied"),
    "returned": ("returned", "abandoned", "cancelled", "canceled", "dropped", "not submitted"),
    "timed_out": ("timed out", "expired", "not submitted incomplete", "incomplete"),
    "screened_out": ("screened out", "terminated"),
    "no_show": ("no show", "unexcused no show", "excused no show", "excused"),
}
STATES: Mapping[str, ServiceState] = {word: state for state, words in _WORDS.items() for word in words}
"""What the services call the states of somebody, in small letters without marks."""
MOST_ROWS = 200_000
MOST_CHARACTERS = 100
"""So long an id may be, as in an open link."""


class ListError(StudyError):
    """A list that cannot be read; one line with what would help."""


@dataclass(frozen=True)
class Listed:
    """One line of the service's list."""

    person: str
    """The id that the service gives them; "" where the line has none."""
    state: ServiceState
    said: str
    """The state in the service's own word."""
    line: int
    """Of the file."""


def plain(text: str) -> str:
    """A heading or a state in small letters, its words apart by one blank and nothing else between them: `WorkerId`,
    `worker_id` and `Worker ID` are alike."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return " ".join(re.findall(r"[a-z0-9]+", apart.lower()))


def read_list(text: str, *, id_column: str | None = None, status_column: str | None = None) -> tuple[Listed, ...]:
    """The lines of a service's list, with comma, semicolon or tab between the cells.

    `id_column` and `status_column` name the columns that are not found by themselves. Raises `ListError`.
    """
    try:
        rows = list(table_rows(text.removeprefix("\ufeff")))
    except ValueError as error:
        raise ListError(str(error)) from None
    if len(rows) < 2:
        raise ListError("holds no line beside its headings; export the list once more")
    if len(rows) > MOST_ROWS:
        raise ListError(f"has {len(rows)} lines; at most {MOST_ROWS} are taken")
    headings = [cell.strip() for cell in rows[0][1]]
    persons = _place(headings, "id", id_column)
    states = _place(headings, "status", status_column)
    listed = []
    for number, row in rows[1:]:
        person = row[persons].strip() if persons < len(row) else ""
        said = row[states].strip() if states < len(row) else ""
        listed.append(Listed(person[:MOST_CHARACTERS], STATES.get(plain(said), "unclear"), said, number))
    if not any(line.person for line in listed):
        raise ListError(f"no line has anything in its column {headings[persons]!r}; name another with --id-column")
    return tuple(listed)


def _place(headings: Sequence[str], which: Literal["id", "status"], wanted: str | None) -> int:
    """Where a column is, by the name given or by what the services call it."""
    for name in (wanted,) if wanted is not None else COLUMNS[which]:
        found = [place for place, heading in enumerate(headings) if plain(heading) == plain(name)]
        if len(found) > 1:
            raise ListError(f"has {len(found)} columns {headings[found[0]]!r}; leave the one that counts")
        if found:
            return found[0]
    said = f"no column {wanted!r}" if wanted is not None else f"no column with the {which} of a person is known"
    raise ListError(f"{said}; name one with --{which}-column: {', '.join(headings)}")
