"""An arbiter that misbehaves in a live session: the robot holds, the trial pauses with the reason, nothing is lost."""

from __future__ import annotations

import csv
import io
import os
import signal
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from app.simulated.bot import run_bot
from app.simulated.pilot import Pilot, Sight
from app.trial.engine import TrialEngine
from app.trial.setup import study_setup
from app.trial.values import UserInput, inputs_of
from app.trial.world import open_study
from app.wire import Alert, Page, Tick, World
from sim.kinematic import KinematicRobot
from study.definition.study import plan_session
from study.records import TickRow
from tests.support.lab_server import ROOT, LabServer
from tests.support.wire_client import (
    SHORT,
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

UP = (0, 0, 1)
FAULTY_TICK = 5
"""By then the arm is up as far as it goes: there is something that it cannot do."""
PARTS = ROOT / "tests" / "support" / "parts" / "faulty.py"
TWO_CYCLES = {**SHORT, "pickups_per_trial = 3 ": "pickups_per_trial = 2 ", "enabled = true": "enabled = false"}
"""And no readings, for which the hands leave the pad."""


@dataclass(frozen=True)
class Switch:
    """A file: as long as it is there, the arbiter misbehaves."""

    path: Path

    def turn(self, on: bool) -> None:
        if on:
            self.path.touch()
        else:
            self.path.unlink(missing_ok=True)

    @property
    def is_on(self) -> bool:
        return self.path.exists()


@pytest.fixture
def switch(tmp_path: Path) -> Switch:
    return Switch(tmp_path / "switch")


StartLab = Callable[..., LabServer]


def lab_with(
    start_lab: StartLab, folder: Path, arbiter: str, given: str = "", changes: dict[str, str] = SHORT
) -> LabServer:
    """A lab whose study has this arbiter of one's own, in a file beside it, as its only condition."""
    study = write_study(folder, changes)
    (folder / PARTS.name).write_text(PARTS.read_text(encoding="utf-8"), encoding="utf-8")
    text = study.read_text(encoding="utf-8")
    begin, end = text.index("[[conditions]]"), text.index("\n[arbiter]\n")
    own = f'[[conditions]]\nid = "own"\narbiter = "{PARTS.name}:{arbiter}"\n{given}'
    study.write_text(text[:begin] + own + text[end:], encoding="utf-8")
    options = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--trust")
    return start_lab(*options, "--study", str(study))


def faulty_lab(start_lab: StartLab, switch: Switch, arbiter: str, *, tick: int = FAULTY_TICK, once: bool) -> LabServer:
    given = f'tick = {tick}\nswitch = "{switch.path}"\nswitch_off = {str(once).lower()}\n'
    return lab_with(start_lab, switch.path.parent, arbiter, given)


def ticks(lab: LabServer, participant: str) -> tuple[TickRow, ...]:
    with stored(lab) as store:
        rows: tuple[TickRow, ...] = store.rows_of("ticks", participant)
    return rows


def exported_ticks(lab: LabServer) -> list[int]:
    """The numbers of the ticks in the export."""
    with zipfile.ZipFile(io.BytesIO(asked(lab, "GET", "export").content)) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith("ticks.csv") and "practice" not in name]
        text = archive.read(name).decode()
    return [int(row["tick"]) for row in csv.DictReader(io.StringIO(text))]


REASONS = {
    "Raises": "raised KeyError: 'goal of tick 5'",
    "ReturnsNaN": "returned (nan, 0, 0); it must be three numbers, each -1, 0 or 1",
    "Impossible": "which the arm cannot do from here",
    "Slow": "took longer than 100 ms",
    "CatchesEverything": "took longer than 100 ms",
    "BlocksInC": "took longer than 100 ms",
    "HangsInC": "gave no answer for 5 s and was ended",
    "Interrupts": "raised KeyboardInterrupt",
    "CannotBeTold": "raised Silent: an error that cannot be told (RuntimeError)",
    "Unprintable": "raised ValueError: name ? of a file",
    "EndsItsProcess": "ended the process that it runs in",
    "AnswersLater": "took longer than 100 ms",
    "CannotRemember": "raised LookupError: forgotten",
}


@pytest.mark.parametrize("arbiter", REASONS)
async def test_the_trial_pauses_with_the_reason_and_goes_on(arbiter: str, start_lab: StartLab, switch: Switch) -> None:
    switch.turn(on=True)
    lab = faulty_lab(start_lab, switch, arbiter, once=True)
    made = invite(lab)
    participant, part = made["participant"], f"arbiter 'faulty.py:{arbiter}'"
    async with visit(made["link"]) as player:
        await player.reach_trial()
        for _ in range(FAULTY_TICK):
            await player.tick(UP)
        await player.hands(None)
        page = await player.page("paused")
        assert (page.content["causes"], page.content["can_resume"]) == (["fault"], True)
        reason = seen_by_experimenter(lab, participant)["pause_reason"]
        assert reason.startswith(part) and REASONS[arbiter] in reason
        ((_, told),) = events(lab, participant, "part_failed")
        assert told["part"] == part and REASONS[arbiter] in told["reason"]
        before = ticks(lab, participant)
        # What was acknowledged is there, the tick that failed is not.
        assert [row.tick for row in before] == exported_ticks(lab) == list(range(FAULTY_TICK))
        assert not switch.is_on
        await player.done("resume")
        await player.status("running")
        assert (await player.tick(None)).tick == FAULTY_TICK
        after = ticks(lab, participant)
    assert after[:FAULTY_TICK] == before
    assert (after[FAULTY_TICK].after_pause, after[FAULTY_TICK].source) == (1, "robot")
    assert after[FAULTY_TICK].p_z == pytest.approx(before[-1].p_z + 0.02, abs=0.005)
    assert not events(lab, participant, "replay_mismatch", "worker_lost", "worker_failed")


QUESTION = {"position_m": [0.7, 0.0, 0.88], "momentum": [0.0, 0.0, 0.0], "goals_m": [[0.8, 0.3, 0.85]]}


@pytest.mark.parametrize("arbiter", ["Interrupts", "EndsItsProcess", "CatchesEverything", "Unprintable"])
def test_the_api_asks_it_where_it_harms_nobody(arbiter: str, start_lab: StartLab, tmp_path: Path) -> None:
    lab = lab_with(start_lab, tmp_path, arbiter, "tick = 0\n")
    answer = asked(lab, "POST", "arbiter/evaluate", {**QUESTION, "condition": "own"})
    assert answer.status_code == 422
    assert f"arbiter 'faulty.py:{arbiter}' " in answer.text and REASONS[arbiter] in answer.text
    assert asked(lab, "GET", "sessions").status_code == 200


def test_the_api_tells_what_an_arbiter_of_ones_own_chooses(start_lab: StartLab, tmp_path: Path) -> None:
    lab = lab_with(start_lab, tmp_path, "Counting")
    question = {**QUESTION, "condition": "own", "user_action": [0, 0, 1]}
    told = asked(lab, "POST", "arbiter/evaluate", question).json()
    assert told["actions"][told["chosen"]] == [0, 0, 1]
    assert asked(lab, "POST", "arbiter/evaluate", {**question, "condition": "faulty.py:Counting"}).json() == told


async def test_the_session_is_finished_when_the_arbiter_behaves_again(start_lab: StartLab, switch: Switch) -> None:
    switch.turn(on=True)
    lab = faulty_lab(start_lab, switch, "Raises", once=True)
    made = invite(lab)
    report = await run_bot(made["link"])
    assert len(events(lab, made["participant"], "part_failed")) == 1
    assert seen_by_experimenter(lab, made["participant"])["state"] == "done"
    recorded = [row.tick for row in ticks(lab, made["participant"])]
    assert recorded == list(range(len(recorded)))
    assert report.ticks == len(recorded)


async def test_the_experimenter_may_resume_it_too(start_lab: StartLab, switch: Switch) -> None:
    switch.turn(on=True)
    lab = faulty_lab(start_lab, switch, "Raises", tick=0, once=True)
    made = invite(lab)
    async with visit(made["link"]) as player:
        await player.reach_trial()
        await player.hands(UP)
        await player.page("paused")
        assert (await command(lab, made["participant"], "resume")).status_code == 200
        await player.status("running")
        assert (await player.tick(UP)).tick == 0


async def test_one_that_fails_in_every_re_run_waits_for_somebody(start_lab: StartLab, switch: Switch) -> None:
    """The log cannot be re-run, so no worker is of use: it is tried again when somebody says so, and no sooner."""
    lab = faulty_lab(start_lab, switch, "Raises", tick=1, once=False)
    made = invite(lab)
    participant = made["participant"]
    async with visit(made["link"]) as player:
        others = set(worker_pids(lab))
        await player.reach_trial()
        for _ in range(3):
            await player.tick(UP)
        (worker,) = set(worker_pids(lab)) - others
        switch.turn(on=True)
        os.kill(worker, signal.SIGKILL)
        await player.page("paused")
        for tries in (1, 2):
            await player.in_step()
            assert len(events(lab, participant, "part_failed")) == tries
            assert set(worker_pids(lab)) <= others
            assert seen_by_experimenter(lab, participant)["state"] == "paused"
            if tries == 1:
                await player.done("resume")
                await player.page("paused")
        switch.turn(on=False)
        await player.done("resume")
        await player.status("running")
        assert (await player.tick(UP)).tick == 3
    assert [row.tick for row in ticks(lab, participant)] == [0, 1, 2, 3]
    assert not events(lab, participant, "replay_mismatch")


# --- a distractor ----------------------------------------------------------------------------------------------------


async def test_a_distractor_that_raises_in_mid_trial_pauses_it_too(start_lab: StartLab, switch: Switch) -> None:
    """When it is to show something, and when it is to judge an answer."""
    folder = switch.path.parent
    source = PARTS.with_name("faulty_distractor.py")
    (folder / source.name).write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    kind = f'kind = "{source.name}:Breaks"\nswitch = "{switch.path}"\n'
    study = write_study(folder, {**SHORT, "digits = 4\ndecimals = 1\n": kind, "first_s = 10.0": "first_s = 1.0"})
    options = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--trust")
    lab = start_lab(*options, "--study", str(study))
    made = invite(lab)
    part = f"distractor '{source.name}:Breaks'"
    async with visit(made["link"]) as player:
        await player.reach_trial()
        await player.tick(UP)
        switch.turn(on=True)
        await player.hands(UP)
        await player.page("paused")
        assert seen_by_experimenter(lab, made["participant"])["pause_reason"].startswith(f"{part} raised KeyError")
        assert [row.tick for row in ticks(lab, made["participant"])] == [0]
        switch.turn(on=False)
        await player.done("resume")
        await player.status("running")
        assert (await player.tick(UP)).tick == 1
        shown = await player.until(Alert)
        assert shown.reading == "1"
        refused = await player.refused("alert_answer", {"alert": 1, "value": "break"})
        assert refused.message == "The lab could not take this answer, and has paused."
        await player.done("resume")
        await player.status("running")
        await player.done("alert_answer", {"alert": 1, "value": "1"})
        assert (await player.tick(UP)).tick == 2
    told = [data for _, data in events(lab, made["participant"], "part_failed")]
    assert [data["part"] for data in told] == [part, part]
    assert told[1]["reason"] == "raised ValueError: what is that?"


# --- memory ----------------------------------------------------------------------------------------------------------


def act(player: Player, pilot: Pilot) -> UserInput:
    """What a person does now, who sees what the page shows."""
    world = player.heard(World)[-1]
    told = [message.instruction for message in player.messages if isinstance(message, Tick)]
    page = [message for message in player.heard(Page) if message.state == "trial"][-1]
    task = told[-1] if told else page.content["instruction"]
    name, place = (task["object"], task["bin"]) if isinstance(task, dict) else (task.object, task.bin)
    if name not in world.objects_m:
        return UserInput()  # the table is being set anew
    release_m = world.bins_m[place] if place else next(iter(world.bins_m.values()))
    return pilot.act(name, Sight(world.position_m, world.held, world.gripper, world.objects_m[name], release_m))


async def test_a_counting_arbiter_survives_the_death_of_its_worker(start_lab: StartLab, tmp_path: Path) -> None:
    """Killed in the midst of its second cycle, where the count began at what it was at the end of the first."""
    lab = lab_with(start_lab, tmp_path, "Counting", changes=TWO_CYCLES)
    made = invite(lab)
    participant, pilot = made["participant"], Pilot()
    async with visit(made["link"], telemetry=True) as player:
        others = set(worker_pids(lab))
        await player.reach_trial()
        (worker,) = set(worker_pids(lab)) - others
        second_cycle_for, number = 0, 0
        while second_cycle_for < 40:
            now = act(player, pilot)
            # The arbiter moves at a cycle's beginning alone: nobody who is led away all the time ever arrives.
            in_cycle = second_cycle_for or number
            off = in_cycle < 30 and in_cycle % 4 == 1 and now.gripper is None
            tick = await player.tick(None if off else now.direction, now.gripper)
            number += 1
            second_cycle_for += tick.done_tasks >= 2
            assert number < 600, "the first cycle does not end"
            if second_cycle_for == 15:
                os.kill(worker, signal.SIGKILL)
                await player.status("recovering")
                await player.status("running")
                second_cycle_for += 1
    assert events(lab, participant, "worker_lost")
    assert not events(lab, participant, "replay_mismatch", "part_failed")
    rows = ticks(lab, participant)
    assert {row.cycle for row in rows} == {1, 2}
    with stored(lab) as store:
        (person,) = store.rows_of("participants", participant)
    study = open_study(tmp_path / "study.toml", trust=True)
    plan = plan_session(study, tuple(person.condition_order.split(">")), person.seed)
    setup = study_setup(study, trust=True).trial_setup(participant, plan, 1, "trial")
    engine = TrialEngine(setup, KinematicRobot())
    engine.open()
    uninterrupted = [engine.tick(inputs_of(row)).row for row in rows]
    assert uninterrupted == [replace(row, started_utc=None, late_ms=None) for row in rows]
    assert sum(row.source == "robot" and row.action_z == 1 for row in rows[-25:]) > 0
