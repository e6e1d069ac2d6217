"""How many people take part at this moment, how many the lab takes, and whether the open link lets in one more.

Counted is whoever keeps the machine busy, or may at any moment:

    a real-time session with a process of its own
    one whose page is open, from its first page to its end
    one that has agreed to take part, until the lab puts it aside: its page may come back
    somebody whom the open link let in a moment ago, and whose page is on its way

Nobody is turned away who has a link of their own or has begun: beyond the number the dashboard warns.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Literal

from app.session.session import LiveSession
from study.flow.open_link import BEFORE_CONSENT

NEAR_SHARE = 0.8
"""From this share of what the lab takes on, the dashboard says how many there are."""
COMES_WITHIN_S = 30.0
"""Whoever was let in has their page open by then."""

Level = Literal["well", "near", "full", "beyond"]


@dataclass(frozen=True)
class Crowding:
    """How many people take part, and how many the lab takes; None = nobody knows, and everybody is let in."""

    running: int
    most: int | None

    @property
    def has_room(self) -> bool:
        """Whether one more can be let in."""
        return self.most is None or self.running < self.most

    @property
    def level(self) -> Level:
        """How full it is."""
        if self.most is None or self.running < math.ceil(NEAR_SHARE * self.most):
            return "well"
        if self.running < self.most:
            return "near"
        return "full" if self.running == self.most else "beyond"

    @property
    def text(self) -> str:
        """What an experimenter is told; "" while there is nothing to tell."""
        people = "1 person takes" if self.running == 1 else f"{self.running} people take"
        if self.level == "near":
            return f"{people} part now; the lab takes {self.most} at once."
        if self.level == "full":
            return f"{people} part now, as many as the lab takes at once: the open link asks others to come back."
        if self.level == "beyond":
            return (
                f"{people} part now, and the lab takes {self.most} at once: robots may begin to be late. "
                "The open link asks others to come back; let those with links of their own wait too."
            )
        return ""


class Doorkeeper:
    """Counts. `live` gives the sessions that are live now.

    Attributes:
        most: how many the lab takes; None = nobody knows.
        note: what to know of a number that is not used; "" for nothing.
    """

    note = ""

    def __init__(
        self,
        most: int | None,
        live: Callable[[], Collection[LiveSession]],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.most = most
        self._live = live
        self._now_s = now_s
        self._coming: dict[str, float] = {}

    def crowding(self) -> Crowding:
        """How it is now."""
        counted = {one.enrolment.participant for one in self._live() if takes_room(one)}
        now_s, live = self._now_s(), {one.enrolment.participant for one in self._live()}
        self._coming = {
            one: at_s for one, at_s in self._coming.items() if one not in live and now_s - at_s < COMES_WITHIN_S
        }
        return Crowding(len(counted) + len(self._coming), self.most)

    def let_in(self, participant: str) -> None:
        """Somebody is on their way to their page."""
        self._coming[participant] = self._now_s()


def takes_room(session: LiveSession) -> bool:
    """Whether a live session is one of those that are counted."""
    if session.enrolment.pace != "real_time" or session.session.is_over:
        return False
    return session.has_worker or session.connected or session.session.place not in BEFORE_CONSENT
