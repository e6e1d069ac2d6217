"""Ending a participation at somebody's wish, with what was recorded or without: also while the lab cannot save."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Coroutine
from typing import Any, Protocol

from app.errors import LabError
from app.monitoring.log_lines import about
from app.session.commands import CannotSave, Command
from app.session.session import LiveSession
from study.store import WHAT_TO_DO, AsyncStore, StoredSession, StoreTroubled

log = logging.getLogger(__name__)

LOOK_EVERY_S = 0.5


class Home(Protocol):
    """What is needed of the lab."""

    @property
    def store(self) -> AsyncStore:
        """Its data."""

    async def command(self, participant: str, command: Command, by: str) -> LiveSession:
        """Something an experimenter does with a session."""

    async def stored_session(self, participant: str) -> StoredSession:
        """One participant, as stored."""

    async def erase(self, participant: str) -> bool | None:
        """Delete everything about a participant."""

    def later(self, work: Coroutine[Any, Any, None], name: str) -> None:
        """Have something done that nobody waits for."""


async def withdraw_from(lab: Home, participant: str, reason: str | None, by: str, *, keep: bool) -> None:
    """End a session; erase what was recorded, unless it is kept.

    Raises `NotNow`, and of its kinds `CannotSave`: where that says that the act waits, the erasing does too.
    """
    try:
        await lab.command(participant, Command("withdraw", reason), by)
    except CannotSave as error:
        if error.is_waiting and not keep:
            lab.later(_erase_when_over(lab, participant), "erase when over")
        raise
    if keep:
        return
    try:
        await lab.erase(participant)
    except StoreTroubled as error:
        lab.later(_erase_when_over(lab, participant), "erase when over")
        text = f"The session has ended, but the lab cannot save now. {WHAT_TO_DO[error.kind]} Its data are erased then."
        raise CannotSave(text, True) from error


async def _erase_when_over(lab: Home, participant: str) -> None:
    """What was promised while the lab could not save."""
    while True:
        await asyncio.sleep(LOOK_EVERY_S)
        if lab.store.trouble is not None:
            continue
        try:
            is_over = (await lab.stored_session(participant)).session.is_over
        except StoreTroubled:
            continue
        except LabError as error:  # erased by somebody else
            log.warning("who withdrew was not erased later", extra=about(reason=type(error).__name__))
            return
        if not is_over:
            continue
        try:
            await lab.erase(participant)
        except (StoreTroubled, LabError) as error:  # it is promised: until it is done
            log.warning("who withdrew is not erased yet", extra=about(reason=type(error).__name__))
            continue
        log.info("a participant who withdrew is erased, now that the lab can save")
        return
