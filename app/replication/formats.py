"""How numbers, comparisons and tables are written, on the screen and in the report."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from app.replication.paper import Claim

MEASURE_NAMES = {
    "belief_gain": "gain",
    "convergence_user_actions": "convergence",
    "efficiency_ticks": "efficiency",
    "window_rate": "window rate",
    "sus_modified": "usability",
    "tlx_raw": "workload",
}
CONDITION_NAMES = {"teleoperation": "teleop", "goal_oriented": "goal", "balanced": "balanced"}
_DECIMALS = {"belief_gain": 4, "convergence_user_actions": 1, "efficiency_ticks": 1, "window_rate": 4}


def name_of(claim: Claim) -> str:
    """A comparison in a few words."""
    first, second = CONDITION_NAMES[claim.first], CONDITION_NAMES[claim.second]
    return f"{MEASURE_NAMES[claim.measure]} {claim.kind}: {first} - {second}"


def number(value: float, measure: str) -> str:
    """A value with the decimals its measure is given with; nothing for what is not known."""
    return "" if value != value else f"{value:.{_DECIMALS.get(measure, 2)}f}"


def percent(value: float, decimals: int = 0) -> str:
    """A share; nothing for what is not known."""
    return "" if value != value else f"{value:.{decimals}%}"


def code(text: str) -> str:
    """Text as it stands, in Markdown."""
    return f"```\n{text}\n```"


def columns(rows: Sequence[Sequence[str]], *, ends_in_words: bool = False) -> str:
    """Rows of text in columns: words to the left, numbers to the right."""
    widths = [max(len(row[index]) for row in rows) for index in range(len(rows[0]))]
    if ends_in_words:
        widths[-1] = 0
    lines = []
    for row in rows:
        cells = [row[0].ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def write_csv(path: Path, names: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """A table for a spreadsheet."""
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([names, *rows])
