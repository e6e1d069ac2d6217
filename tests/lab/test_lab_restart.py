"""Kill anything at any time: what was acknowledged is on disk, and the trial goes on with its next tick."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import select
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from app.config import LabConfig
from app.lab.lab import Lab
from app.session.commands import Command, NotNow
from app.simulated.bot import Bot
from app.simulated.connection import BotError, enter, open_wire
from app.wire import Input, Page, Status, Tick, WireDirection
from study.records import TickRow, unix_s
from study.store import Batch, Store
from tests.support.dashboard_client import dashboard
from tests.support.lab_server import LabServer
from tests.support.local_lab import ENDS_WITHIN_S, RIGHT, LocalPage, in_first_trial, lab_in_here
from tests.support.wire_client import (
    Player,
    asked,
    command,
    events,
    invite,
    seen_by_experimenter,
    stored,
    visit,
    worker_pids,
    write_study,
)

pytestmark = pytest.mark.slow

LEFT: WireDirection = (0, 1, 0)


@pytest.fixture
def launch(start_lab: Callable[..., LabServer], tmp_path: Path) -> Callable[[], LabServer]:
    """Starts a lab with the short study, always on the same data folder."""
    study = str(write_study(tmp_path))

    def start() -> LabServer:
        arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", study)
        return start_lab(*arguments, data_dir=tmp_path / "data")

    return start


def at(lab: LabServer, link: str) -> str:
    """The same link at a lab that listens on another port now."""
    return lab.base_url + urlsplit(link).path


def ticks(lab: LabServer, participant: str) -> tuple[TickRow, ...]:
    with stored(lab) as store:
        rows: tuple[TickRow, ...] = store.rows_of("ticks", participant)
    return rows


async def drive(player: Player, count: int) -> Tick:
    """Ticks with changing input; the last of them."""
    for number in range(count):
        last = await player.tick(RIGHT if number % 3 else LEFT)
    return last


def contiguous(rows: tuple[TickRow, ...]) -> bool:
    return [row.tick for row in rows] == list(range(len(rows)))


# --- a worker ----------------------------------------------------------------------------------------------------


async def test_a_killed_worker_costs_no_tick(launch: Callable[[], LabServer]) -> None:
    lab = launch()
    made = invite(lab)
    participant = made["participant"]
    async with visit(made["link"], telemetry=True) as player:
        await player.reach_trial()
        last = await drive(player, 7)
        (pid,) = worker_pids(lab)
        os.kill(pid, signal.SIGKILL)
        await player.status("recovering")
        assert seen_by_experimenter(lab, participant)["state"] == "trial"
        await player.status("running")
        assert (await player.tick(RIGHT)).tick == last.tick + 1
        await drive(player, 4)
    metrics = asked(lab, "GET", "metrics").text.splitlines()
    assert {"salab_worker_starts_total 2.0", "salab_worker_restarts_total 1.0", "salab_ticks_total 12.0"} <= set(
        metrics
    )
    rows = ticks(lab, participant)
    assert contiguous(rows) and len(rows) == 12
    assert rows[7].after_pause == 1 and (rows[7].m_x, rows[7].m_y, rows[7].m_z) == (0, 0, 0)
    kinds = [kind for kind, _ in events(lab, participant)]
    assert "worker_lost" in kinds
    assert "replay_mismatch" not in kinds
    # The re-run world is the one that was lost: a lab that starts on this record re-runs all of it without a mismatch.
    lab.kill()
    again = launch()
    async with visit(at(again, made["link"])) as player:
        await player.page("paused")
        await player.done("resume")
        await player.status("running")
        assert (await player.tick()).tick == 12
    assert not events(again, participant, "replay_mismatch")


async def test_a_worker_that_keeps_ending_pauses_the_session_for_the_experimenter(
    launch: Callable[[], LabServer],
) -> None:
    lab = launch()
    made = invite(lab)
    participant = made["participant"]
    async with visit(made["link"]) as player:
        await player.reach_trial()
        last = await drive(player, 2)
        for crash in range(LabConfig().worker_restarts + 1):
            (pid,) = worker_pids(lab)
            os.kill(pid, signal.SIGKILL)
            if crash < LabConfig().worker_restarts:
                await player.status("running")
        page = await player.page("paused")
        assert page.content["causes"] == ["experimenter"]
        assert worker_pids(lab) == []
        (pause,) = [data for _, data in events(lab, participant, "state") if data["to"] == "paused"]
        assert "keeps ending" in pause["reason"]
        assert len(events(lab, participant, "worker_lost")) == LabConfig().worker_restarts + 1
        await command(lab, participant, "resume")
        await player.status("running")
        assert (await player.tick(RIGHT)).tick == last.tick + 1


async def test_a_worker_that_ends_before_the_start_comes_back_too(launch: Callable[[], LabServer]) -> None:
    lab = launch()
    made = invite(lab)
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        await player.status("ready")
        for crash in range(LabConfig().worker_restarts + 1):
            (pid,) = worker_pids(lab)
            os.kill(pid, signal.SIGKILL)
            if crash < LabConfig().worker_restarts:
                await player.status("ready")
        await player.page("paused")
        await command(lab, made["participant"], "resume")
        await player.status("ready")
        await player.done("start")
        await player.status("running")
        assert (await player.tick(RIGHT)).tick == 0


# --- the lab -----------------------------------------------------------------------------------------------------


def wait_for_end(pid: int) -> None:
    """Until a process that is not our child is gone."""
    with contextlib.suppress(ProcessLookupError):
        descriptor = os.pidfd_open(pid)
        try:
            assert select.select([descriptor], [], [], ENDS_WITHIN_S)[0], f"process {pid} did not end"
        finally:
            os.close(descriptor)


@pytest.mark.parametrize("end", ["kill", "close"])
async def test_a_lab_that_ends_in_mid_trial_goes_on_where_it_was(launch: Callable[[], LabServer], end: str) -> None:
    lab = launch()
    made = invite(lab)
    participant = made["participant"]
    async with visit(made["link"]) as player:
        await player.reach_trial()
        last = await drive(player, 9)
        await player.done("help", {"text": "before"}, identifier="help-1")
        (worker,) = worker_pids(lab)
        # More is on its way when it ends: whatever of it is not acknowledged may be lost, and nothing else.
        for _ in range(30):
            await player.hands(RIGHT)
        getattr(lab, end)()
        await player.ended()
        last = player.heard(Tick)[-1]
    wait_for_end(worker)

    lab = launch()
    seen = seen_by_experimenter(lab, participant)
    assert seen["place"] == "trial" and not seen["connected"]
    kept = ticks(lab, participant)
    assert contiguous(kept) and len(kept) > last.tick
    assert kept[last.tick].input_seq == last.seq
    async with dashboard(lab) as board:
        await board.line(participant)
        await board.watch(participant)
        said = [event["data"] for event in (await board.news())["events"] if event["kind"] == "step_help"]
    assert said == [{"text": "before"}]
    async with visit(at(lab, made["link"])) as player:
        page = await player.until(Page)
        assert (page.state, page.content["causes"]) == ("paused", ["connection"])
        assert player.seq == kept[-1].input_seq
        await player.done("help", {"text": "before"}, identifier="help-1")  # resent: it was acknowledged already
        async with dashboard(lab) as board:
            await board.line(participant, lambda line: line["connected"] and line["help_wanted"])  # nobody has seen it
        await player.done("resume")
        await player.status("running")
        assert (await player.tick(LEFT)).tick == len(kept)
        await drive(player, 3)
    rows = ticks(lab, participant)
    assert contiguous(rows) and len(rows) == len(kept) + 4
    assert [row.tick for row in rows if row.after_pause] == [len(kept)]
    assert rows[: len(kept)] == kept
    (help_event,) = [data for _, data in events(lab, participant, "step_help")]
    assert help_event["characters"] == len("before")
    assert not events(lab, participant, "replay_mismatch")
    if end == "kill":
        assert events(lab, participant, "lab_restarted")


async def test_every_acknowledged_form_survives(launch: Callable[[], LabServer]) -> None:
    lab = launch()
    made = invite(lab)
    link = made["link"]
    for state in ("setup", "trial_ready"):
        async with visit(at(lab, link)) as player:
            await player.reach(state)
        lab.kill()
        lab = launch()
        assert seen_by_experimenter(lab, made["participant"])["state"] == state
    with stored(lab) as store:
        instruments = {row.instrument for row in store.rows_of("survey_answers", made["participant"])}
        (participant,) = store.rows_of("participants", made["participant"])
    assert instruments == {"demographics", "comprehension"}
    assert participant.consent_utc
    async with visit(at(lab, link)) as player:  # the robot is brought back to where Start can be pressed
        await player.page("trial_ready")
        await player.status("ready")


async def test_a_study_interrupted_again_and_again_is_complete_in_the_end(launch: Callable[[], LabServer]) -> None:
    lab = launch()
    made = invite(lab)
    participant = made["participant"]
    finished = False
    for limit in (40, 80, None):
        async with open_wire(await enter(at(lab, made["link"])), "bot", telemetry=True) as wire:
            bot = Bot(wire, None)
            with contextlib.suppress(BotError) if limit else contextlib.nullcontext():
                while limit is None or bot.report.ticks < limit:
                    await bot._handle(await wire.receive())
                    if bot.report.pages and bot.report.pages[-1] == "done":
                        finished = True
                        break
        if limit is not None:
            lab.kill()
            lab = launch()
    assert finished
    with stored(lab) as store:
        tasks = store.rows_of("tasks", participant)
        answers = store.rows_of("survey_answers", participant)
        for trial in (1, 2, 3):
            assert contiguous(store.rows_of("ticks", participant, trial=trial))
            numbers = [row.alert for row in store.rows_of("alerts", participant, trial=trial)]
            assert numbers == list(range(1, len(numbers) + 1))
    assert [(row.trial, row.task) for row in tasks] == [(trial, task) for trial in (1, 2, 3) for task in (1, 2)]
    assert len([row for row in answers if row.trial]) == 48
    assert not events(lab, participant, "replay_mismatch")


# --- the disk ----------------------------------------------------------------------------------------------------


async def test_who_waits_for_a_session_that_is_closed_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with lab_in_here(tmp_path) as lab:
        participant = (await lab.invite()).participant
        writing, written = threading.Event(), threading.Event()
        commit = Store.commit

        def slow(store: Store, batch: Batch) -> bool:
            writing.set()
            written.wait(ENDS_WITHIN_S)
            return commit(store, batch)

        monkeypatch.setattr(Store, "commit", slow)
        waiting = [asyncio.create_task(lab.command(participant, Command("pause"), "AB")) for _ in range(2)]
        await asyncio.to_thread(writing.wait, ENDS_WITHIN_S)  # the first is being dealt with, the other queues
        live = lab.live_session(participant)
        assert live is not None
        await live.close()
        written.set()
        for answer in await asyncio.wait_for(asyncio.gather(*waiting, return_exceptions=True), ENDS_WITHIN_S):
            assert isinstance(answer, NotNow)


async def test_a_tick_that_could_not_be_stored_is_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with lab_in_here(tmp_path) as lab:
        invitation = await lab.invite()
        holder = await lab.holder(invitation.participant_token)
        assert holder is not None
        session = await lab.session(holder[0])
        page = await in_first_trial(session)
        for seq in range(1, 20):
            await page.tick(seq)

        commit = Store.commit
        failures = iter([True])

        def full(store: Store, batch: Batch) -> bool:
            if len(batch.ticks) > 0 and next(failures, False):
                raise OSError("No space left on device")
            return commit(store, batch)

        monkeypatch.setattr(Store, "commit", full)
        # The tick that raises the first reading is the one that finds the disk full.
        session.receive(page, Input(seq=20, client_ms=0.0, direction=RIGHT))
        await page.until(Status, status="recovering")
        await page.until(Status, status="running")
        again = await page.tick(21)
        assert (again.tick, again.seq) == (19, 21)
        assert (await page.tick(22)).tick == 20
        rows = lab.store.store.rows_of("ticks", invitation.participant)
        assert contiguous(rows) and len(rows) == 21
        assert [row.input_seq for row in rows[-2:]] == [21, 22]
        (reading,) = lab.store.store.rows_of("alerts", invitation.participant)
        assert reading.due_trial_s == 10.0
        kinds = [row.kind for row in lab.store.store.rows_of("events", invitation.participant)]
        assert "replay_mismatch" not in kinds


async def test_a_deserted_session_gives_its_worker_back_and_returns_where_it_was(tmp_path: Path) -> None:
    async with lab_in_here(tmp_path) as lab:
        invitation = await lab.invite()
        stored_session = await lab.stored_session(invitation.participant)
        session = await lab.session(stored_session)
        page = LocalPage(session)
        session.attach(page)
        await page.until(Page, state="consent")
        await lab.let_go(-1.0)
        assert lab.live_session(invitation.participant) is session, "a page is connected"
        session.detach(page)
        await lab.command(invitation.participant, Command("pause"), "test")
        await lab.let_go(3600.0)
        assert lab.live_session(invitation.participant) is session, "it was here a moment ago"
        await lab.let_go(-1.0)
        assert lab.live_session(invitation.participant) is None
        again = await lab.session(stored_session)
        assert again is not session
        assert (again.session.state, again.session.place) == ("paused", "consent")


# ---- a computer whose clock is set


class Wall:
    """The computer's clock, which somebody sets."""

    def __init__(self) -> None:
        self.set_by_s = 0.0

    def __call__(self) -> float:
        return time.time() + self.set_by_s


def clock_events(lab: Lab, participant: str) -> list[float]:
    rows = lab.store.store.rows_of("events", participant)
    return [json.loads(row.data)["by_s"] for row in rows if row.kind == "clock_set"]


def in_order(lab: Lab, participant: str) -> bool:
    """Whether no time in the record is before the one that was written before it."""
    store = lab.store.store
    for times in (
        [row.utc for row in store.rows_of("events", participant)],
        [row.started_utc for row in store.rows_of("ticks", participant)],
    ):
        if times != sorted(times) or not times:
            return False
    return True


@pytest.mark.parametrize("by_s", [-3600.0, -90_000.0, 3600.0])
async def test_a_clock_that_is_set_in_a_trial_moves_no_time_and_is_told(tmp_path: Path, by_s: float) -> None:
    wall = Wall()
    async with lab_in_here(tmp_path, wall) as lab:
        participant = (await lab.invite()).participant
        session = await lab.session(await lab.stored_session(participant))
        page = await in_first_trial(session)
        for seq in range(1, 5):
            await page.tick(seq)
        assert clock_events(lab, participant) == []
        wall.set_by_s = by_s
        for seq in range(5, 9):
            await page.tick(seq)
        await lab.command(participant, Command("abort_trial", "x"), "AB")
        (trial,) = lab.store.store.rows_of("trials", participant)
        assert unix_s(trial.started_utc) <= unix_s(trial.finished_utc) < unix_s(trial.started_utc) + ENDS_WITHIN_S
        assert trial.quality == "suspect"
        assert f"the computer's clock was set by {by_s:+.1f} s" in json.loads(trial.quality_broken)
        assert clock_events(lab, participant) == pytest.approx([by_s], abs=1.0)
        assert in_order(lab, participant)


async def test_a_lab_that_starts_again_before_its_last_word_goes_on_after_it(tmp_path: Path) -> None:
    wall = Wall()
    async with lab_in_here(tmp_path, wall) as lab:
        participant = (await lab.invite()).participant
        page = await in_first_trial(await lab.session(await lab.stored_session(participant)))
        for seq in range(1, 5):
            await page.tick(seq)
    wall.set_by_s = -86_400.0
    async with lab_in_here(tmp_path, wall) as lab:
        session = await lab.session(await lab.stored_session(participant))
        await lab.command(participant, Command("abort_trial", "x"), "AB")
        assert session.session.place != "trial"
        (trial,) = lab.store.store.rows_of("trials", participant)
        assert unix_s(trial.started_utc) <= unix_s(trial.finished_utc)
        assert trial.quality == "suspect"
        assert clock_events(lab, participant) == pytest.approx([-86_400.0], abs=ENDS_WITHIN_S)
        assert in_order(lab, participant)
        # Who comes now has nothing in the record yet, and the time of the computer.
        other = await lab.stored_session((await lab.invite()).participant)
        await lab.session(other)
        assert abs(unix_s(other.created_utc) - wall()) < ENDS_WITHIN_S
        assert clock_events(lab, other.participant) == []
