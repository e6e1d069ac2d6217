"""What an experimenter can say about a session or to its participant while it runs: which, when, and why not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from app.config import LabError
from study.protocol import Session

RemarkKind = Literal["note", "task_marked", "message", "help_seen"]
KINDS: tuple[RemarkKind, ...] = get_args(RemarkKind)


class NotNow(LabError):
    """A remark that has no meaning in the session's state; the text says why."""


@dataclass(frozen=True)
class Remark:
    """Something for the record: its kind is the event's, its text is the experimenter's."""

    kind: RemarkKind
    text: str


def _always(session: Session, connected: bool, help_wanted: bool) -> str:
    return ""


def _in_a_phase(session: Session, connected: bool, help_wanted: bool) -> str:
    if session.place in ("practice", "trial"):
        return ""
    return "No task is under way: tasks are marked during practice and trials."


def _to_somebody(session: Session, connected: bool, help_wanted: bool) -> str:
    return "" if connected else "The participant's page is not connected: nobody would see the message."


def _if_asked(session: Session, connected: bool, help_wanted: bool) -> str:
    return "" if help_wanted else "The participant does not ask for help."


_RULES: Mapping[RemarkKind, Callable[[Session, bool, bool], str]] = {
    "note": _always,
    "task_marked": _in_a_phase,
    "message": _to_somebody,
    "help_seen": _if_asked,
}


def why_not(kind: RemarkKind, session: Session, connected: bool, help_wanted: bool) -> str:
    """Why a remark cannot be made now, as a sentence; "" when it can."""
    return _RULES[kind](session, connected, help_wanted)


def refuse_unless(kind: RemarkKind, session: Session, connected: bool, help_wanted: bool) -> None:
    """Raises `NotNow` when the remark cannot be made now."""
    reason = why_not(kind, session, connected, help_wanted)
    if reason:
        raise NotNow(reason)
