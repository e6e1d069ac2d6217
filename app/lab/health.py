"""Whether the lab does what it is for: kept up to date by itself, so that asking costs nothing and never waits.

store        what is acknowledged is on disk     ┐
data_folder  the data folder is where it was     ├ healthy: a person has to act when one fails
workers      a session gets its process          ┘
room         there is room for more data         ┐ ready, with all of the above: new people can begin
scene        the robot looks as the study says   ┘
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import shutil
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.monitoring.log_lines import about
from study.store import WHAT_TO_DO, Trouble

log = logging.getLogger(__name__)

CheckName = Literal["store", "data_folder", "workers", "room", "scene"]
HEALTH: tuple[CheckName, ...] = ("store", "data_folder", "workers")
ASKS: Mapping[CheckName, str] = {
    "workers": "whether a process can be started for a session",
    "room": "how much room there is on the disk",
    "scene": "how the robot is drawn",
}
"""What is looked at, for when that cannot be told."""
LOOK_EVERY_S = 10.0
LOOK_AGAIN_AFTER_S = 1.0
"""While something is wrong."""
ANSWER_WITHIN_S = 3.0
"""A probe that has not answered by then fails, and is waited for without asking again."""
SCENE_WITHIN_S = 60.0
"""Sessions wait no longer for the robot's look: then each makes it ready for itself."""
MIN_FREE_BYTES = 200_000_000
"""A session writes some megabytes; SQLite's log and an export want room besides."""


@dataclass(frozen=True)
class Check:
    """One part of the lab. `reason` says in a line what is wrong, "" while it is well; it names no path."""

    name: CheckName
    reason: str = ""

    @property
    def is_well(self) -> bool:
        """Whether nothing is wrong."""
        return not self.reason


Probe = Callable[[], str]
"""Looks at something and says what is wrong, "" for nothing. May block."""


class Health:
    """The checks of one lab. `watch` keeps them up to date.

    `trouble` is the store's condition. `probes` may block: each has a thread of its own. `prepare_scene` is done once
    and says what is wrong with it; None where there is no scene.

    Attributes:
        prepares_scene: the robot's look is being made ready, once for all sessions, which wait for it.
    """

    def __init__(
        self,
        trouble: Callable[[], Trouble | None],
        probes: dict[CheckName, Probe],
        prepare_scene: Probe | None = None,
        answer_within_s: float = ANSWER_WITHIN_S,
        scene_within_s: float = SCENE_WITHIN_S,
    ) -> None:
        self._trouble = trouble
        self._probes = probes
        self._prepare_scene = prepare_scene
        self._answer_within_s = answer_within_s
        self._scene_within_s = scene_within_s
        self._reasons: dict[CheckName, str] = dict.fromkeys(probes, "")
        self._reasons["scene"] = "the robot's look is being prepared" if prepare_scene else ""
        self.prepares_scene = prepare_scene is not None
        self._asked: dict[CheckName, asyncio.Future[str]] = {}

    def checks(self) -> tuple[Check, ...]:
        """All of them, as they stand."""
        trouble = self._trouble()
        saving = WHAT_TO_DO[trouble.kind] if trouble is not None else ""
        gone = saving if trouble is not None and trouble.kind == "gone" else ""
        found = (Check(name, reason) for name, reason in self._reasons.items())
        return (Check("store", saving), Check("data_folder", gone), *found)

    async def watch(self) -> None:
        """Look again and again until cancelled."""
        if self._prepare_scene is not None:
            _on_thread("scene", self._prepare_scene).add_done_callback(self._prepared)
            asyncio.get_running_loop().call_later(self._scene_within_s, self._wait_no_longer)
        while True:
            await asyncio.gather(*(self._look(name) for name in self._probes))
            all_well = all(check.is_well for check in self.checks())
            await asyncio.sleep(LOOK_EVERY_S if all_well else LOOK_AGAIN_AFTER_S)

    async def _look(self, name: CheckName) -> None:
        """Ask one probe, or wait on for the answer that is due."""
        asked = self._asked.get(name)
        if asked is None:
            asked = self._asked[name] = _on_thread(name, self._probes[name])
        done, _ = await asyncio.wait([asked], timeout=self._answer_within_s)
        if not done:
            self._found(name, f"{ASKS[name]}: no answer for {self._answer_within_s:g} s")
            return
        del self._asked[name]
        error = asked.exception()
        self._found(name, asked.result() if error is None else f"{ASKS[name]}: {type(error).__name__}")

    def _prepared(self, done: asyncio.Future[str]) -> None:
        self.prepares_scene = False
        if done.cancelled():
            return
        self._reasons["scene"] = ""
        error = done.exception()
        if error is None:
            log.info("the robot's look is ready")
        self._found("scene", done.result() if error is None else f"{ASKS['scene']}: {type(error).__name__}")

    def _wait_no_longer(self) -> None:
        if self.prepares_scene:
            self.prepares_scene = False
            log.warning("the robot's look takes long to make ready: sessions do not wait for it any more")

    def _found(self, name: CheckName, reason: str) -> None:
        before, self._reasons[name] = self._reasons[name], reason
        if reason and not before:
            log.error("a check of the lab fails", extra=about(check=name, reason=reason))
        elif before and not reason:
            log.warning("a check of the lab is well again", extra=about(check=name))


def _on_thread(name: str, probe: Probe) -> asyncio.Future[str]:
    """What a probe says; on a thread that the end of the process does not wait for."""
    loop = asyncio.get_running_loop()
    said: asyncio.Future[str] = loop.create_future()

    def tell(result: str, error: BaseException | None) -> None:
        if said.cancelled():
            return
        if error is None:
            said.set_result(result)
        else:
            said.set_exception(error)

    def run() -> None:
        try:
            result, failed = probe(), None
        except Exception as error:
            result, failed = "", error
        with contextlib.suppress(RuntimeError):  # the lab has ended meanwhile
            loop.call_soon_threadsafe(tell, result, failed)

    threading.Thread(target=run, name=f"probe {name}", daemon=True).start()
    return said


def why_no_room(folder: Path, free_bytes: Callable[[Path], int] | None = None) -> str:
    """Why nobody else should begin on the disk of this folder; "" while there is room."""
    try:
        free = free_bytes(folder) if free_bytes else shutil.disk_usage(folder).free
    except OSError:
        return "the data folder cannot be looked at"
    least = MIN_FREE_BYTES // 1_000_000
    return f"{free // 1_000_000} MB are free, a study wants {least}" if free < MIN_FREE_BYTES else ""
