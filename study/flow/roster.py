"""Who is enrolled, as the experimenter sees it: the counterbalancing as a filled grid, and what may be done to whom."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from study.definition.study import Study, next_order, orders
from study.flow.open_link import BEFORE_CONSENT, LAPSED
from study.flow.protocol import FREES_CELL, TERMINAL

EnrolmentKind = Literal["study", "pilot", "demo"]
"""What somebody is enrolled for. Only `study` holds a cell and is in the default export."""
Act = Literal["reject", "withdraw", "erase", "new_link"]
Cell = Literal["waiting", "under_way", "done"]
ACTS: tuple[Act, ...] = ("reject", "withdraw", "erase", "new_link")


@dataclass(frozen=True)
class Enrolled:
    """One participant, as far as counterbalancing and the buttons are concerned."""

    participant: str
    kind: str
    state: str
    order: tuple[str, ...]
    rejected: bool
    problem: str = ""
    """Why what is stored of them cannot be read; "" when it can."""

    @property
    def holds_cell(self) -> bool:
        """Whether this participant counts in the counterbalancing."""
        return self.kind == "study" and not self.rejected and self.state not in FREES_CELL

    @property
    def cell(self) -> Cell:
        """How far the cell is filled; of somebody who cannot be read nobody knows that they are not under way."""
        if self.state == "done":
            return "done"
        return "waiting" if self.state in BEFORE_CONSENT else "under_way"


@dataclass(frozen=True)
class GridRow:
    """One order of the conditions and who holds its cells, in order of enrolment."""

    order: tuple[str, ...]
    cells: tuple[tuple[str, Cell], ...]
    is_next: bool
    lapsed: int = 0
    """How many had it whose place has lapsed: they hold none."""


def grid(study: Study, everyone: Iterable[Enrolled]) -> tuple[GridRow, ...]:
    """Every order with its participants; the next one to be given out is marked.

    Orders of an earlier study file in the same data folder that this study does not have are left out.
    """
    held: dict[tuple[str, ...], list[tuple[str, Cell]]] = {order: [] for order in orders(study)}
    everyone = tuple(everyone)
    lapsed = Counter(one.order for one in everyone if one.kind == "study" and one.state == LAPSED)
    for one in everyone:
        if one.holds_cell and one.order in held:
            held[one.order].append((one.participant, one.cell))
    following = next_order(study, {order: len(cells) for order, cells in held.items()})
    return tuple(GridRow(order, tuple(cells), order == following, lapsed[order]) for order, cells in held.items())


def why_not(act: Act, one: Enrolled) -> str:
    """Why this cannot be done now, or "" when it can."""
    if one.problem and act != "erase":
        return f"What is stored of them cannot be read: {one.problem}"
    if act == "reject":
        if one.kind != "study":
            return f"A {one.kind} participant holds no cell that could be given out again."
        if one.rejected:
            return "Rejected already."
        if one.state in FREES_CELL:
            return f"Already {one.state.replace('_', ' ')}: the cell is free."
        if one.state != "done":
            return "The session is not over. Abort or withdraw it: that frees the cell too."
    if act == "withdraw" and one.state in TERMINAL:
        return "The session is over. To remove what was recorded, erase it."
    if act == "new_link" and one.state in TERMINAL:
        return "The session is over."
    return ""


def counts(everyone: Iterable[Enrolled]) -> Mapping[str, int]:
    """Participants of the study by what became of them: waiting, under_way, done, rejected, and the ends that give
    a cell back."""
    found = dict.fromkeys(("waiting", "under_way", "done", "rejected", *sorted(FREES_CELL), "unreadable"), 0)
    for one in everyone:
        if one.kind == "study" or one.problem:
            found[group(one)] += 1
    return found


def group(one: Enrolled) -> str:
    """The counted group that somebody is in."""
    if one.problem:
        return "unreadable"
    return "rejected" if one.rejected else one.state if one.state in FREES_CELL else one.cell


def matches(one: Enrolled, noted: str, show: str, search: str) -> bool:
    """Whether a line belongs in a filtered roster; `noted` is what the experimenter knows of them besides the id.

    `show` is all, a kind, or one of the counted groups.
    """
    if show not in ("all", one.kind, group(one)):
        return False
    wanted = search.strip().lower()
    return not wanted or wanted in one.participant.lower() or wanted in noted.lower()
