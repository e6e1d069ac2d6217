"""What one fault is: how it is done to a lab, what people must see of it, and how long the robot may stand still."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from tests.faults.memory import Seen
from tests.support.wire_client import SHORT

if TYPE_CHECKING:
    from tests.faults.stage import Stage

TOLD_S = 2.0
"""People are told within a second; as much again is for a machine that does other work."""
Disk = Literal["usual", "small", "failing"]
"""Where the data folder lies: as everything does, on a disk that can be filled, or on one that can be made to fail."""


class CannotRun(Exception):
    """This machine lacks what the fault takes; the text says what."""


@dataclass(frozen=True)
class Sight:
    """Something that somebody must see, and how soon after the fault began, in seconds."""

    words: str
    is_it: Callable[[Seen], bool]
    within_s: float


@dataclass(frozen=True)
class Setup:
    """The lab that a fault is done to. Rows with the same set-up may follow one another on one lab."""

    options: tuple[str, ...] = ("--robot", "kinematic", "--no-scene")
    study: Mapping[str, str] = field(default_factory=lambda: SHORT, hash=False)
    is_network_bad: bool = False
    disk: Disk = "usual"
    disk_mb: int = 24
    """Size of a small disk."""
    is_clock_false: bool = False
    second_device: bool = False
    in_page: bool = False
    """The participant is at a real page, in a Chromium."""


@dataclass(frozen=True)
class Fault:
    """A row of the table.

    `does` does it, waits for its end, and does what whoever is there would do then (start the lab again). Meanwhile the
    person lets go of what they held, calls for help, and goes on when the page lets them.
    """

    name: str
    about: str
    does: Callable[[Stage], Awaitable[None]]
    downtime_s: float
    """The robot may stand still for so long, beyond the fault's own time as `does` tells it."""
    part: str = ""
    """Whose it is to mend."""
    participant: tuple[Sight, ...] = ()
    experimenter: tuple[Sight, ...] = ()
    setup: Setup = field(default_factory=Setup)
    way_s: float = 0.0
    """How long what a page says may be on its way."""
    goes_on: bool = True
    """Whether the robot obeys again at the end; otherwise `does` says what is right instead."""
    exports: bool = True
    """Whether the lab can export the data at the end."""
    is_kept: bool = True
    """Whether there is a record at the end that everything acknowledged must be in."""
    is_long: bool = False
    """Takes minutes: only when asked for."""


# ---- what is seen ---------------------------------------------------------------------------------------------------


def sign(name: str, within_s: float, text: str = "") -> Sight:
    """The sign of the participant's page."""
    words = f"sign “{name}”" + (f" ({text})" if text else "")
    return Sight(words, lambda seen: seen.kind == "sign" and seen.name == name and text in seen.text, within_s)


def one_sign(names: tuple[str, ...], within_s: float) -> Sight:
    """One of several signs."""
    return Sight(f"sign “{'” or “'.join(names)}”", lambda seen: seen.kind == "sign" and seen.name in names, within_s)


def panel(name: str, within_s: float) -> Sight:
    """What the participant's page says of the second device."""
    return Sight(f"second device {name}", lambda seen: seen.kind == "panel" and seen.name == name, within_s)


def line(within_s: float, **values: object) -> Sight:
    """The participant's line of the dashboard, with these values."""
    words = ", ".join(f"{name} {value}" for name, value in values.items())

    def is_it(seen: Seen) -> bool:
        return seen.kind == "line" and all(seen.data.get(name) == value for name, value in values.items())

    return Sight(f"line: {words}", is_it, within_s)


def event(kind: str, within_s: float) -> Sight:
    """An event of the session on the dashboard."""
    return Sight(f"event {kind}", lambda seen: seen.kind == "event" and seen.name == kind, within_s)


def board(text: str, within_s: float) -> Sight:
    """Words on the dashboard's page."""
    return Sight(f"dashboard “{text}”", lambda seen: seen.kind == "board" and text in seen.text, within_s)


def trouble(kinds: tuple[str, ...], within_s: float) -> Sight:
    """The dashboard says that the lab cannot save, and why."""
    words = f"trouble {' or '.join(kinds)}"
    return Sight(words, lambda seen: seen.kind == "trouble" and seen.name in kinds, within_s)


def unhealthy(within_s: float) -> Sight:
    """The health route says that the lab cannot do its work."""
    return Sight("health 503", lambda seen: seen.kind == "health" and seen.name == "503", within_s)


def unreachable(within_s: float) -> Sight:
    """The dashboard says that it has lost the lab, or the health route is silent."""
    return Sight("no lab", lambda seen: seen.kind == "lost" or (seen.kind, seen.name) == ("health", "silent"), within_s)
