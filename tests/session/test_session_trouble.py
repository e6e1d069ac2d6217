"""When something beside the participant goes wrong: a worker that hangs, a second device that is missing."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from app.wire import Page, Status
from tests.support.lab_server import LabServer
from tests.support.wire_client import (
    SHORT,
    Player,
    events,
    invite,
    seen_by_experimenter,
    stored,
    visit,
    worker_pids,
    write_study,
)

SECOND_DEVICE = {**SHORT, 'placement = "same_page_away" ': 'placement = "second_device" '}


@pytest.mark.slow
async def test_a_worker_that_hangs_is_replaced_and_holds_up_nobody(quick_lab: LabServer) -> None:
    made = invite(quick_lab, pace="real_time")
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        before = set(worker_pids(quick_lab))
        await player.status("ready")
        await player.done("start")
        async with player.beating():
            await player.status("running")
            stopped = [pid for pid in worker_pids(quick_lab) if pid in before]
            for pid in stopped:
                os.kill(pid, signal.SIGSTOP)
            async with httpx.AsyncClient(trust_env=False, timeout=5.0) as client:
                assert (await client.get(f"{quick_lab.base_url}/api/health")).status_code == 200
            await player.status("recovering")
            await player.status("running")
    assert events(quick_lab, made["participant"], "worker_lost")
    assert not events(quick_lab, made["participant"], "replay_mismatch")


@pytest.mark.slow
async def test_a_fork_server_that_is_killed_takes_no_session_with_it_and_is_replaced(
    start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    study = write_study(tmp_path)
    lab = start_lab("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", str(study))
    made = invite(lab)
    async with visit(made["link"]) as player:
        await player.reach_trial()
        await player.tick()
        (worker,) = worker_pids(lab)
        os.kill(parent_of(worker), signal.SIGKILL)
        assert (await player.tick()).tick == 1, "the worker goes on without it"
        os.kill(worker, signal.SIGKILL)
        await player.status("recovering")
        await player.status("running")
        assert (await player.tick()).tick == 2
    assert not events(lab, made["participant"], "replay_mismatch", "worker_failed")


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


async def test_words_of_a_participant_are_kept_apart_from_the_record(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"]) as player:
        await player.page("consent")
        await player.done("help", {"text": "I am Jane Roe"})
        await player.done("withdraw", {"reason": "call Jane Roe"})
        await player.page("withdrawn")
    with stored(quick_lab) as store:
        told = {name.partition("-")[0]: words for name, words in store.identities(made["participant"])}
        exported = [
            str(row) for table in ("participants", "events") for row in store.rows_of(table, made["participant"])
        ]
    assert (told["help"], told["withdraw"]) == ("I am Jane Roe", "call Jane Roe")
    assert exported
    assert not [row for row in exported if "Jane" in row]


async def test_a_trial_with_a_second_device_waits_for_the_device(
    start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    study = write_study(tmp_path, SECOND_DEVICE)
    lab = start_lab("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", str(study))
    made = invite(lab)
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        await player.status("ready")
        assert not seen_by_experimenter(lab, made["participant"])["panel_connected"]
        refused = await player.refused("start")
        assert (refused.code, refused.field) == ("illegal", "panel")
        async with visit(made["panel_link"], name="panel") as panel:
            assert (await panel.until(Page)).state == "waiting"
            assert seen_by_experimenter(lab, made["participant"])["panel_connected"]
            await player.done("start")
            await panel.page("trial")
            await pause_and_resume(lab, made["participant"], panel)
            await player.done("withdraw")
            await panel.page("withdrawn")


async def pause_and_resume(lab: LabServer, participant: str, panel: Player) -> None:
    for command, state in (("pause", "paused"), ("resume", "trial")):
        url = f"{lab.base_url}/api/sessions/{participant}/{command}"
        async with httpx.AsyncClient(headers=lab.headers, trust_env=False, timeout=30.0) as client:
            assert (await client.post(url, json={})).status_code == 200
        await panel.page(state)


async def test_holding_does_not_outlive_a_pause(quick_lab: LabServer) -> None:
    made = invite(quick_lab, pace="real_time")
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        await player.status("ready")
        await player.done("start")
        await player.until(Status, lambda status: status.status == "held")
    async with visit(made["link"], name="later") as player:
        await player.page("paused")
        assert not seen_by_experimenter(quick_lab, made["participant"])["held"]
