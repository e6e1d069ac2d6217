"""What the store hands out, and its error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from study.flow.protocol import Session
from study.records import StudyError

Kind = Literal["study", "pilot", "demo"]
"""What somebody is enrolled for. Only `study` holds a cell and is in the default export."""


class StoreError(StudyError):
    """The database cannot be opened or refuses a write; one line that says which file and why."""


@dataclass(frozen=True)
class StoredSession:
    """A participant as the lab knows them."""

    participant: str
    public_id: str
    session: Session
    order: tuple[str, ...]
    kind: Kind
    pace: str
    study_hash: str
    seed: int
    created_utc: str
    rejected: bool

    @property
    def demo(self) -> bool:
        """Whether this is a visitor who tries the study, not somebody of whom data are wanted."""
        return self.kind == "demo"


@dataclass(frozen=True)
class Cycle:
    """The start of a pick-and-place cycle: what a new worker needs before it re-runs the cycle's ticks."""

    participant: str
    trial: int
    practice: bool
    cycle: int
    start: str
    """JSON, made and read by the worker."""
