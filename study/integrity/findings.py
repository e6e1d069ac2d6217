"""What does not fit: where, and what."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One thing that is not as it was recorded."""

    place: str
    """A file, a page of it, or a row of a table, with its participant and its key."""
    what: str
    """What is wrong there, in words."""

    def __str__(self) -> str:
        return f"{self.place}: {self.what}"


@dataclass(frozen=True)
class Verdict:
    """What came of looking at a data folder or an export."""

    findings: tuple[Finding, ...]
    participants: int
    links: int
    notes: tuple[str, ...] = ()
    """What could not be looked at, and why."""
