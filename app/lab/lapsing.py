"""Places of people who came over the open link and closed its tab before they agreed to take part: they lapse, and are
given back to whoever returns while there are any."""

from __future__ import annotations

import contextlib
import logging
from contextlib import AbstractAsyncContextManager
from typing import Protocol

from app.clock import SteadyClock
from app.monitoring.log_lines import about
from app.trial.setup import StudySetup
from study.definition.study import Study
from study.flow.open_link import LAPSED
from study.flow.recorded import time_of
from study.records import StudyError, utc_text
from study.store import AsyncStore, StoredSession

log = logging.getLogger(__name__)

LOOK_EVERY_S = 30.0


class Home(Protocol):
    """What is needed of the lab."""

    @property
    def store(self) -> AsyncStore:
        """Its data."""

    @property
    def setup(self) -> StudySetup:
        """The study that new participants get."""

    def now_unix_s(self) -> float:
        """The time, by the lab's clock."""

    async def study_of(self, stored: StoredSession) -> Study:
        """The study a participant was enrolled in."""

    def while_away(self, participant: str) -> AbstractAsyncContextManager[bool]:
        """Nobody can connect meanwhile; False where somebody is connected."""

    def changed(self, participant: str) -> None:
        """Tell those who look on."""


class Lapsing:
    """Looks after the places of one lab. Its time is steady: a clock that is set takes nobody's place away, and neither
    does the time in which no lab ran."""

    def __init__(self, lab: Home) -> None:
        self._lab = lab
        self._clock = SteadyClock(lab.now_unix_s)
        self._since_unix_s = self._clock.now_unix_s()
        self._looked_unix_s = self._since_unix_s

    async def look(self) -> None:
        """As `sweep`, every now and then."""
        if self._clock.now_unix_s() - self._looked_unix_s >= LOOK_EVERY_S:
            await self.sweep()

    async def sweep(self, now_unix_s: float | None = None) -> tuple[str, ...]:
        """Let the places lapse whose time is over; whose they were."""
        now_unix_s = self._clock.now_unix_s() if now_unix_s is None else now_unix_s
        self._looked_unix_s = now_unix_s
        lapsed = []
        for stored, last_utc in await self._lab.store.run(lambda store: store.waiting_over_link()):
            last = max((at for at in map(time_of, (last_utc, stored.created_utc)) if at is not None), default=0.0)
            away_s = now_unix_s - max(last, self._since_unix_s)
            with contextlib.suppress(StudyError):  # of a study that cannot be read nobody knows the rule
                after_min = (await self._lab.study_of(stored)).recruitment.place_lapses_min
                if 0.0 < 60.0 * after_min < away_s and await self._lapse(stored.participant, after_min):
                    lapsed.append(stored.participant)
        return tuple(lapsed)

    async def _lapse(self, participant: str, after_min: float) -> bool:
        async with self._lab.while_away(participant) as is_away:
            if not is_away:
                return False
            utc, reason = utc_text(self._clock.now_unix_s()), f"no page for {after_min:g} min"
            has_lapsed = await self._lab.store.run(lambda store: store.lapse(participant, reason, utc))
        if has_lapsed:
            log.info("a place has lapsed", extra=about(participant=participant, after_min=after_min))
            self._lab.changed(participant)
        return has_lapsed

    async def give_back(self, stored: StoredSession) -> bool:
        """Begin a session anew whose place has lapsed, under the order that is least filled now; False when there is no
        place, or it has not lapsed."""
        participant, rules = stored.participant, self._lab.setup.study.recruitment
        if stored.session.state != LAPSED or not rules.open:
            return False
        study = await self._lab.study_of(stored)
        async with self._lab.while_away(participant) as is_away:
            utc = utc_text(self._clock.now_unix_s())
            is_given = is_away and await self._lab.store.run(
                lambda store: store.take_place_again(participant, study, rules.quota, utc)
            )
        if is_given:
            log.info("a place is given back", extra=about(participant=participant))
            self._lab.changed(participant)
        return is_given
