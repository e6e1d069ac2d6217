"""What an experimenter can do with a session or say about it: which acts there are, when, and why not.

An act is a command or a remark. Commands become events of the protocol, or free the arm; remarks only stand in the
record. Both are events with who and when; their words are kept apart (`app.session.private_text`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from app.errors import LabError
from study.flow.flow import FLOW, Flow
from study.flow.protocol import CLEARS, DRIVEN, EventName, Session

CommandName = Literal["start", "pause", "resume", "free_arm", "repeat_practice", "abort_trial", "abort", "withdraw"]
RemarkName = Literal["note", "task_marked", "message", "help_seen"]
ActName = CommandName | RemarkName
"""An act is a command or a remark: what both have in common goes by this name."""

EVENTS: Mapping[CommandName, EventName] = {
    "start": "start",
    "pause": "experimenter_pause",
    "resume": "experimenter_resume",
    "repeat_practice": "repeat_practice",
    "abort_trial": "abort_trial",
    "abort": "abort",
    "withdraw": "withdraw",
}
"""The event of the protocol that a command is. Freeing the arm is none: the session stays where it is."""
COMMANDS: tuple[CommandName, ...] = get_args(CommandName)
ACTS: tuple[ActName, ...] = (*COMMANDS, *get_args(RemarkName))
"""Every act, commands first."""


class NotNow(LabError):
    """An act that is not possible in the session's state; the text says why."""


class CannotSave(NotNow):
    """An act that the disk does not take now. `is_waiting`: it was begun, and is done when the lab can save again."""

    def __init__(self, text: str, is_waiting: bool = False) -> None:
        super().__init__(text)
        self.is_waiting = is_waiting


@dataclass(frozen=True)
class Command:
    """An act that changes a session. `words` say why, in the experimenter's own words."""

    name: CommandName
    words: str | None = None


@dataclass(frozen=True)
class Remark:
    """An act for the record alone: its name is the event's, its text is the experimenter's."""

    name: RemarkName
    text: str


@dataclass(frozen=True)
class Circumstances:
    """All that decides what can be done: the session, and whether its page, robot and second device are there."""

    session: Session
    connected: bool = False
    ready: bool = False
    """The robot is in place."""
    lacks_panel: bool = False
    """The second task appears on a second device that is not there."""
    lacks_picture: bool = False
    """The participant's page says that it draws no robot."""
    help_wanted: bool = False
    flow: Flow = FLOW

    @property
    def allowed(self) -> tuple[EventName, ...]:
        """The events that the session takes now."""
        return self.flow.allowed(self.session)


def why_not(act: ActName, now: Circumstances) -> str:
    """Why this cannot be done now, as a sentence; "" when it can."""
    if act in COMMANDS and now.session.is_over:
        return "The session is over."
    return _RULES[act](now)


def refuse_unless(act: ActName, now: Circumstances) -> None:
    """Raises `NotNow` when this cannot be done now: why, and what can be done instead."""
    reason = why_not(act, now)
    if not reason:
        return
    possible = [name for name in COMMANDS if not why_not(name, now)]
    instead = f" Now it is in {now.session.state!r}; possible: {', '.join(possible)}." if possible else ""
    raise NotNow(reason + instead)


_NO_PICTURE = (
    "The picture of the robot is missing on the participant's screen; it goes on by itself when that is back. Let them "
    "reload the page, or open their link in another browser."
)


def _start(now: Circumstances) -> str:
    session = now.session
    if session.state == "paused":
        return "The session is paused. Resume it first."
    if session.is_ticking:
        return "It has started already."
    if "start" not in now.allowed:
        return "Nothing waits to be started: that is so before practice and before a trial."
    if not now.connected:
        return "The participant's page is not connected: nobody could drive."
    if now.lacks_panel:
        return (
            "The second device is not connected. The participant's page shows its QR code and link; New link in the "
            "roster gives another one."
        )
    if now.lacks_picture:
        return _NO_PICTURE
    return "" if now.ready else "The robot is not in place yet."


def _pause(now: Circumstances) -> str:
    return "An experimenter has paused it already." if "experimenter" in now.session.causes else ""


def _resume(now: Circumstances) -> str:
    if now.session.state != "paused":
        return "The session is not paused."
    if now.lacks_picture and now.session.causes == {"picture"}:
        return _NO_PICTURE
    if not now.session.causes & CLEARS["experimenter_resume"]:
        return "The participant's connection was lost: they press Go on themselves."
    return ""


def _free_arm(now: Circumstances) -> str:
    if now.session.place in DRIVEN:
        return ""
    return "Nobody drives: the arm can be freed during practice and trials, also while they are paused."


def _repeat_practice(now: Circumstances) -> str:
    session = now.session
    if "repeat_practice" in now.allowed:
        return ""
    if "practice_ready" in session.skips:
        return "This study has no practice."
    if session.place in ("practice_ready", "practice"):
        return "The practice is not over yet."
    return "Practice can be repeated when it is over, until the trial begins."


def _abort_trial(now: Circumstances) -> str:
    return "" if "abort_trial" in now.allowed else "No trial is under way."


def _always(now: Circumstances) -> str:
    return ""


def _task_marked(now: Circumstances) -> str:
    if now.session.place in DRIVEN:
        return ""
    return "No task is under way: tasks are marked during practice and trials."


def _message(now: Circumstances) -> str:
    return "" if now.connected else "The participant's page is not connected: nobody would see the message."


def _help_seen(now: Circumstances) -> str:
    return "" if now.help_wanted else "The participant does not ask for help."


_RULES: Mapping[ActName, Callable[[Circumstances], str]] = {
    "start": _start,
    "pause": _pause,
    "resume": _resume,
    "free_arm": _free_arm,
    "repeat_practice": _repeat_practice,
    "abort_trial": _abort_trial,
    "abort": _always,
    "withdraw": _always,
    "note": _always,
    "task_marked": _task_marked,
    "message": _message,
    "help_seen": _help_seen,
}
