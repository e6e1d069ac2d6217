"""One figure as it is printed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One line of the table. `aim` is what the figure is held against, if anything."""

    what: str
    value: str
    aim: str = ""
