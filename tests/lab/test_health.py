"""Whether the lab is well: each check by itself, with probes that fail, hang and come back."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from app.lab.health import MIN_FREE_BYTES, Check, CheckName, Health, why_no_room
from app.worker.probes import why_no_process
from app.worker.process_source import process_source
from study.store import WHAT_TO_DO, Trouble


@asynccontextmanager
async def watched(health: Health) -> AsyncIterator[None]:
    task = asyncio.create_task(health.watch())
    try:
        yield
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def until(true: Callable[[], bool]) -> None:
    ends_s = time.monotonic() + 20.0
    while not true():
        assert time.monotonic() < ends_s
        await asyncio.sleep(0.005)


def reason(health: Health, name: CheckName) -> str:
    return next(check.reason for check in health.checks() if check.name == name)


@pytest.fixture(autouse=True)
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.lab.health.LOOK_EVERY_S", 0.01)
    monkeypatch.setattr("app.lab.health.LOOK_AGAIN_AFTER_S", 0.01)


def test_what_troubles_the_store_is_told_at_once_and_ends_with_it() -> None:
    trouble: list[Trouble | None] = [None]
    health = Health(lambda: trouble[0], {})
    assert all(check.is_well for check in health.checks())
    trouble[0] = Trouble("full", "/somewhere/lab.sqlite: database or disk is full", 1.0, 2.0)
    assert health.checks()[:2] == (Check("store", WHAT_TO_DO["full"]), Check("data_folder"))
    trouble[0] = Trouble("gone", "/somewhere/lab.sqlite: gone", 1.0, 2.0)
    assert health.checks()[:2] == (Check("store", WHAT_TO_DO["gone"]), Check("data_folder", WHAT_TO_DO["gone"]))
    trouble[0] = None
    assert all(check.is_well for check in health.checks())


async def test_a_probe_that_fails_is_asked_again_until_it_is_well(caplog: pytest.LogCaptureFixture) -> None:
    said = ["no"]
    health = Health(lambda: None, {"workers": lambda: said[0]})
    with caplog.at_level(logging.WARNING):
        async with watched(health):
            await until(lambda: reason(health, "workers") == "no")
            said[0] = ""
            await until(lambda: reason(health, "workers") == "")
    told = [(record.getMessage(), record.about["check"]) for record in caplog.records]  # type: ignore[attr-defined]
    assert told == [("a check of the lab fails", "workers"), ("a check of the lab is well again", "workers")]


async def test_a_probe_that_hangs_fails_is_not_asked_twice_and_holds_up_no_other() -> None:
    released, asked, rooms = threading.Event(), [0], [0]

    def hang() -> str:
        asked[0] += 1
        released.wait(20)
        return ""

    def look() -> str:
        rooms[0] += 1
        return ""

    health = Health(lambda: None, {"workers": hang, "room": look}, answer_within_s=0.02)
    async with watched(health):
        await until(
            lambda: (
                reason(health, "workers").endswith("process can be started for a session: no answer for 0.02 s")
                and rooms[0] > 3
            )
        )
        assert asked[0] == 1
        released.set()
        await until(lambda: reason(health, "workers") == "")


async def test_a_probe_that_raises_is_a_reason_and_no_end_of_looking() -> None:
    said: list[Exception | None] = [ValueError("what somebody typed")]

    def probe() -> str:
        if said[0]:
            raise said[0]
        return ""

    health = Health(lambda: None, {"room": probe})
    async with watched(health):
        await until(lambda: reason(health, "room") == "how much room there is on the disk: ValueError")
        said[0] = None
        await until(lambda: reason(health, "room") == "")


async def test_the_lab_is_not_ready_before_the_robot_can_be_drawn() -> None:
    drawn = threading.Event()
    health = Health(lambda: None, {}, lambda: "" if drawn.wait(20) else "never")
    assert reason(health, "scene") == "the robot's look is being prepared"
    async with watched(health):
        await asyncio.sleep(0)
        assert reason(health, "scene") and health.prepares_scene
        drawn.set()
        await until(lambda: reason(health, "scene") == "")
        assert not health.prepares_scene  # from now on sessions' processes begin
    assert reason(Health(lambda: None, {}), "scene") == ""


async def test_sessions_do_not_wait_for_ever_for_a_look_that_does_not_come() -> None:
    drawn = threading.Event()
    health = Health(lambda: None, {}, lambda: "" if drawn.wait(20) else "never", scene_within_s=0.05)
    async with watched(health):
        await until(lambda: not health.prepares_scene)
        assert reason(health, "scene") == "the robot's look is being prepared", "nobody else should begin"
        drawn.set()
        await until(lambda: reason(health, "scene") == "")


async def test_a_look_that_cannot_be_made_is_told_and_holds_up_no_session() -> None:
    def fails() -> str:
        raise OSError("no room")

    health = Health(lambda: None, {}, fails)
    async with watched(health):
        await until(lambda: reason(health, "scene") == "how the robot is drawn: OSError")
        assert not health.prepares_scene


async def test_a_lab_that_draws_another_robot_than_the_study_says_is_not_ready() -> None:
    health = Health(lambda: None, {}, lambda: "the lab's own look is drawn instead")
    async with watched(health):
        await until(lambda: reason(health, "scene") == "the lab's own look is drawn instead")


def test_a_disk_that_is_nearly_full_takes_nobody_new(tmp_path: Path) -> None:
    assert why_no_room(tmp_path, lambda folder: MIN_FREE_BYTES) == ""
    assert why_no_room(tmp_path, lambda folder: 12_345_678) == "12 MB are free, a study wants 200"
    assert why_no_room(tmp_path / "gone") == "the data folder cannot be looked at"


def test_a_process_is_really_started_also_after_the_fork_server_died() -> None:
    from multiprocessing import forkserver

    source = process_source("kinematic")
    source.warm_up("kinematic")
    assert why_no_process(source) == ""
    server = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    os.kill(server, signal.SIGKILL)
    tries = iter(range(1000))
    while why_no_process(source, within_s=60.0):  # until the system has taken it away; then a new one begins
        assert next(tries, None) is not None


def test_that_no_process_can_be_started_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    source = process_source("kinematic")

    def no_pipe(duplex: bool = True) -> None:
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(source._context, "Pipe", no_pipe)
    assert why_no_process(source) == "a process for a session cannot be started: Too many open files"
