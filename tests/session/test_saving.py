"""While the disk does not do, everybody knows, the robot holds and nothing is acknowledged; then it all goes on."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any
from unittest.mock import AsyncMock

import pytest

from app.lab.lab import Lab
from app.lab.withdrawing import withdraw_from
from app.session.commands import CannotSave, Command, NotNow
from app.session.session import LiveSession
from app.wire import Input, Page, Saves, Status, Tick, Welcome
from app.worker.process import WorkerProcess
from tests.support.dashboard_client import dashboard
from tests.support.data_places import locked
from tests.support.lab_server import LabServer
from tests.support.local_lab import RIGHT, LocalPage, in_first_trial, lab_in_here
from tests.support.wire_client import Player, command, events, invite, seen_by_experimenter, stored, visit

pytestmark = pytest.mark.slow


async def test_a_database_that_is_locked_holds_the_robot_and_lets_it_go_on(quick_lab: LabServer) -> None:
    made = invite(quick_lab, pace="real_time")
    async with visit(made["link"]) as player, dashboard(quick_lab) as experimenter:
        await player.reach("trial_ready")
        await player.status("ready")
        await player.done("start")
        async with player.beating():
            await player.until(Tick)
            with locked(quick_lab.data_dir):
                told = await player.until(Saves, lambda saves: not saves.works)
                assert told.text and "Nothing is lost" in told.text
                assert (await player.status("held")).reason == told.text
                acknowledged = player.heard(Tick)[-1].tick
                line = await experimenter.line(made["participant"], lambda line: bool(line["not_saving"]))
                assert "locked" in line["not_saving"]
                assert experimenter.lab["trouble"]["kind"] in ("locked", "slow")
                answer = await command(quick_lab, made["participant"], "pause")
                assert answer.status_code == 503 and "cannot save now" in answer.text
                async with visit_unheard(made["link"]) as second:  # a page that comes now is told, too
                    assert not (await second.until(Saves)).works
                with stored(quick_lab) as store:
                    assert len(store.rows_of("ticks", made["participant"])) == acknowledged + 1
            await player.until(Saves, lambda saves: saves.works)
    async with visit(made["link"], name="again") as player:
        assert (await player.until(Saves)).works
        await player.page("paused")  # it was away; anybody lets it go on
        await player.done("resume")
        async with player.beating():
            assert (await player.until(Tick)).tick >= acknowledged + 1
    with stored(quick_lab) as store:
        rows = store.rows_of("ticks", made["participant"])
    assert [row.tick for row in rows] == list(range(len(rows)))
    ((_, told_later),) = events(quick_lab, made["participant"], "not_saved")
    assert told_later["why"] in ("locked", "slow") and told_later["for_s"] > 0
    assert not events(quick_lab, made["participant"], "worker_lost")


@contextlib.asynccontextmanager
async def visit_unheard(link: str) -> AsyncIterator[Player]:
    """A page that opens its socket and is not welcomed yet."""
    from app.simulated.connection import enter, open_wire

    async with open_wire(await enter(link), "unheard", False) as wire:
        yield Player(wire)


# ---- in this process: what takes a minute is over in a moment


@pytest.fixture
async def lab(tmp_path: Path) -> AsyncIterator[Lab]:
    async with lab_in_here(tmp_path, unsaved_pause_s=0.3) as running:
        yield running


@pytest.fixture
async def patient_lab(tmp_path: Path) -> AsyncIterator[Lab]:
    """One that tries again for as long as it does by itself, however slow the computer is."""
    async with lab_in_here(tmp_path) as running:
        yield running


async def changed(lab: Lab, is_so: Callable[[], bool]) -> None:
    """Wait until something that the lab tells those who look on makes this true."""
    told = asyncio.Event()
    with lab.watching(lambda who: told.set()):
        while not is_so():
            await asyncio.wait_for(told.wait(), 20.0)
            told.clear()


async def driven(lab: Lab) -> tuple[LiveSession, LocalPage, str]:
    """A session whose first trial has ticked once, its page, and whose it is."""
    invitation = await lab.invite()
    session = await lab.session(await lab.stored_session(invitation.participant))
    page = await in_first_trial(session)
    await page.tick(1)
    return session, page, invitation.participant


async def test_a_trouble_that_lasts_pauses_the_session_with_its_reason_and_resume_works(
    lab: Lab, tmp_path: Path
) -> None:
    session, page, participant = await driven(lab)
    with locked(tmp_path / "data"):
        session.receive(page, Input(seq=2, client_ms=0.0, direction=RIGHT))
        await page.until(Saves, works=False)
        while "tell the experimenter" not in (await page.until(Saves, works=False)).text:
            pass
        with pytest.raises(NotNow, match="Another program keeps the database locked"):
            await lab.command(participant, Command("resume"), "AB")
    assert (await page.until(Tick)).tick == 1  # what was in hand
    paused = await page.until(Page, state="paused")
    assert (paused.content["causes"], paused.content["can_resume"]) == (["fault"], True)
    assert session.session.reason is not None and "could not save for" in session.session.reason
    assert (await page.until(Saves)).works
    await lab.command(participant, Command("resume"), "AB")
    await page.until(Status, status="running")
    assert (await page.tick(3)).tick == 2
    (event,) = [row for row in lab.store.store.rows_of("events", participant) if row.kind == "not_saved"]
    assert '"why": "locked"' in event.data


async def test_an_experimenter_who_waits_is_told_and_what_they_asked_for_is_done_later(
    lab: Lab, tmp_path: Path
) -> None:
    _, page, participant = await driven(lab)
    with locked(tmp_path / "data"), pytest.raises(NotNow, match="done when it can"):
        await lab.command(participant, Command("pause"), "AB")
    assert "experimenter" in (await page.until(Page, state="paused")).content["causes"]


@pytest.mark.parametrize("begins", ["with the session", "with the erasing"])
async def test_whoever_withdraws_while_nothing_can_be_saved_is_erased_when_it_can(
    lab: Lab, tmp_path: Path, begins: str
) -> None:
    session, _, participant = await driven(lab)
    if begins == "with the erasing":
        await lab.command(participant, Command("withdraw"), "AB")
        lab.command = AsyncMock(return_value=session)  # type: ignore[method-assign]
    with locked(tmp_path / "data"):
        with pytest.raises(CannotSave) as told:
            await withdraw_from(lab, participant, "by phone", "AB", keep=False)
        assert told.value.is_waiting
        assert participant not in dict(lab.store.store.erasures())

    await changed(lab, lambda: participant in dict(lab.store.store.erasures()))


async def test_a_session_without_a_page_is_kept_while_it_holds_what_is_not_saved(lab: Lab, tmp_path: Path) -> None:
    session, page, participant = await driven(lab)
    session.detach(page)
    with locked(tmp_path / "data"):
        with pytest.raises(CannotSave, match="done when it can"):
            await lab.command(participant, Command("withdraw"), "AB")
        await lab.let_go(-1.0)
        assert lab.live_session(participant) is session
    await changed(lab, lambda: session.session.is_over)


async def test_a_session_can_be_opened_while_nothing_can_be_saved(lab: Lab, tmp_path: Path) -> None:
    session, _, participant = await driven(lab)
    stored_session = await lab.stored_session(participant)
    await lab.let_go(-1.0)  # a page is there: it stays
    await session.close()
    lab._live.clear()
    with locked(tmp_path / "data"):
        with contextlib.suppress(Exception):
            await lab.store.run(lambda store: store.try_to_write())
        opened = await asyncio.wait_for(lab.session(stored_session), 5.0)
        page = LocalPage(opened)
        assert not (await page.until(Saves)).works
    await page.until(Welcome)
    assert (await page.until(Saves)).works
    assert (await page.until(Page)).state == "paused"


# ---- effects that fail


async def test_a_worker_that_cannot_be_started_is_tried_again(
    patient_lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, page, participant = await driven(patient_lab)
    start, failures = WorkerProcess.start, iter([True, True])

    async def start_later(process: WorkerProcess) -> None:
        if next(failures, False):
            raise OSError(24, "Too many open files")
        await start(process)

    monkeypatch.setattr(WorkerProcess, "start", start_later)
    session._link.kill()
    await page.until(Status, status="recovering")
    await page.until(Status, status="running")
    assert (await page.tick(2)).tick == 1
    kinds = [row.kind for row in patient_lab.store.store.rows_of("events", participant)]
    assert kinds.count("worker_lost") == 1 and kinds.count("worker_failed") == 1


async def test_one_that_can_never_be_started_pauses_with_the_reason_and_resume_tries_again(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, page, participant = await driven(lab)

    async def never(process: WorkerProcess) -> None:
        raise OSError(24, "Too many open files")

    with monkeypatch.context() as patch:
        patch.setattr(WorkerProcess, "start", never)
        session._link.kill()
        await page.until(Page, state="paused")
        assert "Too many open files" in (session.session.reason or "")
    await lab.command(participant, Command("resume"), "AB")
    await page.until(Status, status="running")
    assert (await page.tick(2)).tick == 1


@pytest.mark.parametrize("broken", ["show_page", "show_status", "show_world"])
async def test_an_error_on_the_way_to_an_effect_leaves_no_dead_session(
    patient_lab: Lab, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    """Whatever raises once, between what is recorded and what follows from it: the trial goes on."""
    session, page, participant = await driven(patient_lab)
    connections = session._context.connections
    works: Callable[..., Any] = getattr(connections, broken)
    failures = iter([True])

    def once(*arguments: Any) -> None:
        if next(failures, False):
            raise RuntimeError("once")
        works(*arguments)

    await patient_lab.command(participant, Command("pause"), "AB")
    monkeypatch.setattr(connections, broken, once)
    with contextlib.suppress(RuntimeError):
        await patient_lab.command(participant, Command("resume"), "AB")
    await page.until(Status, status="running")
    session.receive(page, Input(seq=2, client_ms=0.0, direction=RIGHT))
    seq = 2
    while True:
        message = await page.until((Tick, Status))
        if isinstance(message, Tick):
            break
        if message.status == "running":
            seq += 1
            session.receive(page, Input(seq=seq, client_ms=0.0, direction=RIGHT))
    rows = patient_lab.store.store.rows_of("ticks", participant)
    assert [row.tick for row in rows] == list(range(len(rows)))


async def test_a_trial_that_cannot_be_judged_ends_all_the_same(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    _, page, participant = await driven(lab)

    def cannot(*arguments: Any) -> None:
        raise ArithmeticError("no number")

    monkeypatch.setattr("app.session.transitions.judged", cannot)
    await lab.command(participant, Command("abort_trial", "too long"), "AB")
    await page.until(Page, state="survey")
    (row,) = lab.store.store.rows_of("trials", participant)
    assert (row.outcome, row.quality) == ("aborted", "suspect")
    assert "could not be judged: ArithmeticError: no number" in row.quality_broken


async def test_a_queue_that_ended_is_begun_again(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    session, page, participant = await driven(lab)
    monkeypatch.setattr(session, "_could_not", None)  # nothing deals with errors now
    session._queue.put_nowait("no piece of work")  # type: ignore[arg-type]
    await page.tick(2)
    assert not seen(lab, participant).startswith("paused")


def seen(lab: Lab, participant: str) -> str:
    session = lab.live_session(participant)
    assert session is not None
    return session.session.state


def test_the_roster_says_what_is_wrong(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    assert seen_by_experimenter(quick_lab, made["participant"])["not_saving"] == ""
