"""The way out in a live session: whoever asks for it gets it, whatever has become of worker, lab and record."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from app.trial.engine import TrialEngine
from app.trial.setup import study_setup
from app.trial.values import inputs_of
from app.trial.world import open_study
from app.wire import Tick
from sim.kinematic import KinematicRobot
from study.definition.study import plan_session
from study.records import TickRow, TrialRow
from tests.support.lab_server import ROOT, LabServer
from tests.support.wire_client import (
    SHORT,
    Player,
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

StartLab = Callable[..., LabServer]
FORWARD, UP = (1, 0, 0), (0, 0, 1)
OPTIONS = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--trust")
KINDS = ("step_free_arm", "free_arm", "arm_freed", "free_not_needed")


def lab_of(start_lab: StartLab, folder: Path, changes: dict[str, str] = SHORT, **options: object) -> LabServer:
    return start_lab(*OPTIONS, "--study", str(write_study(folder, changes)), **options)


def rows(lab: LabServer, participant: str, table: str = "ticks") -> tuple[TickRow, ...]:
    with stored(lab) as store:
        found: tuple[TickRow, ...] = store.rows_of(table, participant)
    return found


def told(lab: LabServer, participant: str) -> list[tuple[str, str]]:
    """What the record says of freeing: kind of event, and who did it."""
    with stored(lab) as store:
        return [(row.kind, row.source) for row in store.rows_of("events", participant) if row.kind in KINDS]


async def freed(player: Player) -> Tick:
    """The next tick, in which the arm is freed; it ends when the arm is back."""
    first = await player.tick(FORWARD)
    assert first.status == "resetting"
    while (await player.tick()).status == "resetting":
        pass
    return first


def check_against_one_uninterrupted(lab: LabServer, participant: str, study_file: Path) -> None:
    """The record, run from its first tick in one go, gives the same rows bit for bit."""
    with stored(lab) as store:
        (person,) = store.rows_of("participants", participant)
    study = open_study(study_file, trust=True)
    plan = plan_session(study, tuple(person.condition_order.split(">")), person.seed)
    setup = study_setup(study, trust=True).trial_setup(participant, plan, 1, "trial")
    engine = TrialEngine(setup, KinematicRobot())
    engine.open()
    recorded = rows(lab, participant)
    assert [row.tick for row in recorded] == list(range(len(recorded)))
    uninterrupted = [engine.tick(inputs_of(row)).row for row in recorded]
    assert uninterrupted == [replace(row, started_utc=None, late_ms=None) for row in recorded]


async def test_the_participant_frees_the_arm_once_however_often_they_press(start_lab: StartLab, tmp_path: Path) -> None:
    lab = lab_of(start_lab, tmp_path)
    who = invite(lab)
    async with visit(who["link"]) as player:
        await player.reach_trial()
        for _ in range(3):
            await player.tick(FORWARD)
        await player.done("free_arm", identifier="once")
        await player.done("free_arm", identifier="once")  # a resend
        await player.done("free_arm")  # a second press before anything was seen of the first
        tick = await player.tick(FORWARD)
        assert (tick.tick, tick.status, tick.instruction.kind) == (3, "resetting", "reset")
        assert tick.notice is not None and "free again" in tick.notice
        await player.done("free_arm")  # and one while the arm goes back
        for _ in range(4):
            await player.tick(FORWARD)
    assert [(row.attempt, row.source) for row in rows(lab, who["participant"])] == [
        *[(1, "user")] * 3,
        (2, "free"),
        *[(2, "reset")] * 3,
        (2, "user"),
    ]
    asked = ("step_free_arm", "participant")
    assert told(lab, who["participant"]) == [
        asked,
        asked,
        ("arm_freed", "participant"),
        asked,
        ("free_not_needed", "lab"),
    ]
    assert seen_by_experimenter(lab, who["participant"])["frees"] == 1


async def test_a_worker_killed_in_the_second_attempt_is_replaced_and_the_record_stays_one(
    start_lab: StartLab, tmp_path: Path
) -> None:
    lab = lab_of(start_lab, tmp_path)
    who = invite(lab)
    async with visit(who["link"]) as player:
        others = set(worker_pids(lab))
        await player.reach_trial()
        (worker,) = set(worker_pids(lab)) - others
        for _ in range(3):
            await player.tick(FORWARD)
        await player.done("free_arm")
        await freed(player)
        for _ in range(3):
            await player.tick(UP)
        os.kill(worker, signal.SIGKILL)
        await player.status("recovering")
        await player.status("running")
        for _ in range(3):
            await player.tick(FORWARD)
    assert not events(lab, who["participant"], "replay_mismatch")
    assert {row.attempt for row in rows(lab, who["participant"])} == {1, 2}
    check_against_one_uninterrupted(lab, who["participant"], tmp_path / "study.toml")


async def test_what_was_asked_in_a_pause_outlives_the_lab_and_is_done_with_the_next_tick(
    start_lab: StartLab, tmp_path: Path
) -> None:
    lab = lab_of(start_lab, tmp_path, data_dir=tmp_path / "data")
    who = invite(lab)
    participant = who["participant"]
    async with visit(who["link"]) as player:
        await player.reach_trial()
        for _ in range(3):
            await player.tick(FORWARD)
        assert (await command(lab, participant, "pause")).status_code == 200
        await player.page("paused")
        reply = await command(lab, participant, "free_arm", "It hangs behind the bottle")
        assert reply.status_code == 200
        lab.kill()
        await player.ended()
    lab = start_lab(*OPTIONS, "--study", str(tmp_path / "study.toml"), data_dir=tmp_path / "data")
    async with visit(f"{lab.base_url}/p/{who['link'].rpartition('/')[2]}") as player:
        await player.page("paused")
        assert (await command(lab, participant, "resume")).status_code == 200
        await player.status("running")
        assert (await freed(player)).tick == 3
        await player.tick(UP)
    assert told(lab, participant) == [("free_arm", "experimenter"), ("arm_freed", "experimenter")]
    assert "bottle" not in str(events(lab, participant, "free_arm"))
    assert seen_by_experimenter(lab, participant)["frees"] == 1
    check_against_one_uninterrupted(lab, participant, tmp_path / "study.toml")


async def test_a_record_that_cannot_be_re_run_is_left_by_freeing_the_arm(start_lab: StartLab, tmp_path: Path) -> None:
    """The arbiter fails in every re-run of tick 1, so that no worker comes up: another attempt needs no re-run."""
    parts, switch = ROOT / "tests" / "support" / "parts" / "faulty.py", tmp_path / "switch"
    study = write_study(tmp_path, SHORT)
    (tmp_path / parts.name).write_text(parts.read_text(encoding="utf-8"), encoding="utf-8")
    text = study.read_text(encoding="utf-8")
    begin, end = text.index("[[conditions]]"), text.index("\n[arbiter]\n")
    own = f'[[conditions]]\nid = "own"\narbiter = "{parts.name}:Raises"\ntick = 1\nswitch = "{switch}"\n'
    study.write_text(text[:begin] + own + text[end:], encoding="utf-8")
    lab = start_lab(*OPTIONS, "--study", str(study))
    who = invite(lab)
    async with visit(who["link"]) as player:
        others = set(worker_pids(lab))
        await player.reach_trial()
        (worker,) = set(worker_pids(lab)) - others
        for _ in range(3):
            await player.tick(UP)
        switch.touch()
        os.kill(worker, signal.SIGKILL)
        await player.page("paused")
        await player.done("resume")
        await player.page("paused")
        await player.done("free_arm")
        await player.done("resume")
        await player.status("running")
        assert (await freed(player)).tick == 3
    assert [row.attempt for row in rows(lab, who["participant"])] == [1] * 3 + [2] * 4
    assert told(lab, who["participant"]) == [("step_free_arm", "participant"), ("arm_freed", "participant")]


async def test_practice_is_freed_too_and_nothing_is_where_nobody_drives(start_lab: StartLab, tmp_path: Path) -> None:
    lab = lab_of(start_lab, tmp_path, {"pickups_per_trial = 3 ": "pickups_per_trial = 1 "})
    who = invite(lab)
    participant = who["participant"]
    async with visit(who["link"]) as player:
        await player.page("consent")
        refused = await player.refused("free_arm")
        assert (refused.code, refused.field) == ("illegal", "step")
        reply = await command(lab, participant, "free_arm")
        assert (reply.status_code, "during practice and trials" in reply.text) == (409, True)
    async with visit(who["link"]) as player:
        await player.reach("practice")
        await player.status("running")
        await player.tick(FORWARD)
        assert (await command(lab, participant, "free_arm")).status_code == 200
        await freed(player)
    assert [row.attempt for row in rows(lab, participant, "practice_ticks")] == [1] + [2] * 4


async def test_a_trial_freed_too_often_is_suspect_and_says_why(start_lab: StartLab, tmp_path: Path) -> None:
    lab = lab_of(start_lab, tmp_path, {**SHORT, "max_frees = 3 ": "max_frees = 1 "})
    who = invite(lab)
    async with visit(who["link"]) as player:
        await player.reach_trial()
        for _ in range(2):
            await player.tick(FORWARD)
            await player.done("free_arm")
            await freed(player)
        assert (await command(lab, who["participant"], "abort_trial", "a test")).status_code == 200
        await player.page("survey")
    with stored(lab) as store:
        trial: TrialRow
        (trial,) = store.rows_of("trials", who["participant"])
    assert (trial.frees, trial.quality) == (2, "suspect")
    assert "arm freed: 2 times, at most 1 allowed" in (trial.quality_broken or "")
