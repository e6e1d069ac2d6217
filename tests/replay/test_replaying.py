"""A record run again: the same bit for bit, whatever happened on the way; and what was changed in it is named."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.replay.comparison import Difference
from app.replay.recording import CannotReplay, ExportedTrials
from app.replay.replaying import Asked, Replayed, replay, replay_all
from app.simulated.bot import Bot
from app.simulated.connection import Wire, enter, open_wire
from app.trial.engine import TrialEngine
from app.trial.rerunning import rerun
from app.trial.values import CycleStart, TrialSetup, UserInput
from app.wire import Tick
from sim.kinematic import KinematicRobot
from study.export.export import ExportError, export
from study.records import TickRow
from study.store import machine_fingerprint
from tests.support.engine_cases import CLOSE, FORWARD, HANDS_OFF, UP, opened, practice_setup, push, run, trial_setup
from tests.support.lab_server import LabServer
from tests.support.recordings import recorded_export
from tests.support.typed_command import run as typed
from tests.support.wire_client import command, events, invite, stored, worker_pids, write_study

ROBOTS = ("kinematic", pytest.param("bullet", marks=pytest.mark.bullet))
NO_ROBOT = "the export does not say which robot ran it; name one with --robot"
ONE_PICKUP = {"pickups_per_trial = 3 ": "pickups_per_trial = 1 "}
OWN = """
from app.autonomy.interface import Arbiter


class Own(Arbiter):
    def decide(self, state, belief, user, feasible):
        return user or (0, 0, 0)
"""


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An export of one simulated participant, three trials of one pickup."""
    from app.simulated.study import make_plan, simulate

    folder = tmp_path_factory.mktemp("simulated")
    out = folder / "out"
    simulate(make_plan(7, "kinematic", None, write_study(folder, ONE_PICKUP)), 1, 1, out, None)
    return out


def changed(
    source: Path, folder: Path, table: str, change: Callable[[list[dict[str, str]]], Sequence[dict[str, str]]]
) -> Path:
    """A copy of an export in which the rows of one table are others."""
    copy = shutil.copytree(source, folder / "changed", dirs_exist_ok=True)
    path = copy / f"{table}.csv"
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    with path.open("w", encoding="utf-8", newline="") as file:
        lines = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        lines.writeheader()
        lines.writerows(change(rows))
    return copy


def with_cell(row: int, column: str, value: str) -> Callable[[list[dict[str, str]]], list[dict[str, str]]]:
    """Another value in one cell; rows are counted from 0."""

    def change(rows: list[dict[str, str]]) -> list[dict[str, str]]:
        assert rows[row][column] != value
        rows[row][column] = value
        return rows

    return change


def first(export_folder: Path, asked: Asked = Asked(), **which: Any) -> Replayed:
    """What comes of the first one."""
    return next(replay_all(export_folder, asked, participant="S001", trial=1, phases=("trial",), **which))


# --- what was recorded comes out again ---------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 2])
def test_a_simulated_study_comes_out_bit_for_bit(simulated: Path, workers: int) -> None:
    told = list(replay_all(simulated, workers=workers))
    assert [(one.called, one.state, one.robot, one.tolerance) for one in told] == [
        (f"S001 {phase} {trial}", "same", "kinematic", 0.0) for phase in ("trial", "practice") for trial in (1, 2, 3)
    ]
    assert all(one.ticks > 20 and not one.other and not one.assumed for one in told)
    assert str(told[0]) == f"S001 trial 1: {told[0].ticks} ticks, the same bit for bit (kinematic)"


class Troubled(Bot):
    """A bot to whom things happen between two ticks: `troubles` maps how many ticks there were to what."""

    def __init__(self, wire: Wire, troubles: Mapping[int, Callable[[], Awaitable[object]]]) -> None:
        super().__init__(wire, None)
        self._troubles = troubles

    async def until(self, state: str) -> None:
        """Go on until the page of this state is there."""
        while self.report.pages[-1:] != [state]:
            await self._handle(await self._wire.receive())

    async def _on_tick(self, tick: Tick) -> None:
        trouble = self._troubles.get(self.report.ticks + 1)
        if trouble is None:
            await super()._on_tick(tick)
        else:  # it drives on when it is told that ticks run
            self.report.ticks += 1
            self._instruction = tick.instruction
            await trouble()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
async def test_practice_and_trial_come_out_after_pauses_kills_and_freed_arms(
    start_lab: Callable[..., LabServer], tmp_path: Path, robot: str
) -> None:
    study = write_study(tmp_path, ONE_PICKUP)
    lab = start_lab("--robot", robot, "--pace", "lockstep", "--no-scene", "--study", str(study))
    who = invite(lab)
    participant = who["participant"]

    async def pause() -> None:
        assert (await command(lab, participant, "pause")).is_success
        assert (await command(lab, participant, "resume")).is_success

    async def kill() -> None:
        (worker,) = worker_pids(lab)
        os.kill(worker, signal.SIGKILL)

    async def free() -> None:
        assert (await command(lab, participant, "free_arm")).is_success
        await pause()

    in_practice = {4: pause, 9: kill, 14: free, 22: kill}
    in_trial = {80: kill, 90: pause, 105: free, 120: kill, 130: pause}
    async with open_wire(await enter(who["link"]), "troubled", telemetry=True) as wire:
        await Troubled(wire, {**in_practice, **in_trial}).until("survey")
    assert len(events(lab, participant, "worker_lost")) == 4
    assert len(events(lab, participant, "arm_freed")) == 2
    with stored(lab) as store:
        export(store, tmp_path / "out")
    told = list(replay_all(tmp_path / "out"))
    assert [(one.called, one.state, one.tolerance, one.assumed) for one in told] == [
        (f"{participant} {phase} 1", "same", 0.0, ()) for phase in ("trial", "practice")
    ], [str(one) for one in told]
    assert {one.robot for one in told} == {robot} and sum(one.ticks for one in told) > 130


def test_practice_that_was_repeated_is_run_as_often() -> None:
    setup = practice_setup()
    engine = opened(setup)
    rows = [result.row for result in run(engine, [push(FORWARD), CLOSE, HANDS_OFF])]
    again = CycleStart().repeated(2, 3)
    assert (again.first_tick, again.counted_from) == (3, 3)
    rows += rerun_rows(setup, again, [HANDS_OFF] * 5 + [push(UP)])
    assert [row.cycle for row in rows] == [1] * 3 + [2] * 6
    assert [result.row for result in rerun(setup, KinematicRobot(), rows)] == rows
    assert [result.row for result in rerun(setup, KinematicRobot(), rows[3:])] == rows[3:]


def test_an_attempt_that_a_fresh_worker_began_while_the_arm_went_back_is_run_so() -> None:
    setup = trial_setup()
    rows = [result.row for result in run(opened(setup), [push(FORWARD), UserInput(free=True)])]
    assert [row.attempt for row in rows] == [1, 2]
    start = CycleStart().after(rows[:1]).after(rows[1:])
    rows += rerun_rows(setup, start, [HANDS_OFF] * 5)
    assert [(row.attempt, row.source) for row in rows[1:4]] == [(2, "free"), (3, "free"), (3, "reset")]
    assert [result.row for result in rerun(setup, KinematicRobot(), rows)] == rows


def rerun_rows(setup: TrialSetup, start: CycleStart, inputs: Sequence[UserInput]) -> list[TickRow]:
    """The rows of a worker that takes up there."""
    engine = TrialEngine(setup, KinematicRobot(), start)
    engine.open()
    return [result.row for result in run(engine, inputs)]


# --- what was changed is found and named -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("p_x", "0.7000000000000002"),
        ("m_y", "0.5"),
        ("belief", '{"a": 1.0}'),
        ("entropy", "0.4999"),
        ("source", "blend"),
        ("user_x", "-1"),
        ("action_z", "1"),
        ("blocked", "1"),
        ("blocked_reason", "no"),
        ("gripper", "moving"),
        ("held", "spray_bottle"),
        ("goals", "{}"),
        ("digest", "0" * 16),
        ("departure", "1.5"),
        ("attempt", "2"),
        ("condition", "balanced"),
        ("kind", "dropoff"),
        ("trial_s", "2.75"),
    ],
)
def test_a_changed_value_of_a_tick_is_found_and_named(simulated: Path, tmp_path: Path, column: str, value: str) -> None:
    rows = exported_rows(simulated, "ticks")
    number = next(n for n, row in enumerate(rows) if row["source"] == "user" and row[column] != value and n > 4)
    told = first(changed(simulated, tmp_path, "ticks", with_cell(number, column, value)))
    assert (told.state, told.ticks) == ("different", number)
    assert told.difference is not None
    named = "action_x" if column == "user_x" else column  # what the person did is what is replayed
    assert (told.difference.table, told.difference.place, told.difference.column) == ("ticks", f"tick {number}", named)
    recorded = rows[number]["action_x"] if column == "user_x" else value
    assert told.difference.recorded.startswith(recorded[:6]) or value == "{}"
    assert told.difference.replayed != told.difference.recorded
    assert f"tick {number}: {named} is " in str(told)


@pytest.mark.parametrize(
    ("table", "change", "says"),
    [
        ("ticks", lambda rows: [*rows[:7], *rows[8:]], "tick 7: tick is 8 in the record and 7"),
        ("ticks", lambda rows: rows[:7], "trial 1: ticks is "),
        ("ticks", lambda rows: rows[-1:], "trial 1: ticks is "),
        ("tasks", with_cell(0, "outcome", "failure"), "task 1: outcome is failure in the record and success"),
        ("tasks", with_cell(1, "last_tick", "3"), "task 2: last_tick is 3 in the record"),
        ("tasks", lambda rows: rows[1:], "task 1: task is no row in the record and a row when"),
        ("trials", with_cell(0, "outcome", "aborted"), "trial 1: outcome is aborted in the record and over"),
        ("trials", with_cell(0, "parameters", "{}"), 'trial 1: parameters is {} in the record and {"condition": '),
        ("participants", with_cell(0, "seed", "4"), "trial 1: placement is "),
    ],
)
def test_rows_that_were_taken_added_or_changed_are_found(
    simulated: Path,
    tmp_path: Path,
    table: str,
    change: Callable[[list[dict[str, str]]], Sequence[dict[str, str]]],
    says: str,
) -> None:
    told = first(changed(simulated, tmp_path, table, change))
    assert told.state == "different" and says in str(told), str(told)


def test_rows_that_are_there_twice_are_not_replayed(simulated: Path, tmp_path: Path) -> None:
    twice = changed(simulated, tmp_path, "ticks", lambda rows: [*rows[:8], *rows[7:]])
    with pytest.raises(ExportError, match="trial 1, tick 7 is there twice"):
        first(twice)


def exported_rows(folder: Path, table: str) -> list[dict[str, str]]:
    """The cells of an exported table."""
    with (folder / f"{table}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


# --- elsewhere, or of before -------------------------------------------------------------------------------------


def test_on_another_machine_numbers_may_be_near_and_nothing_else_may_differ(simulated: Path, tmp_path: Path) -> None:
    here = {**machine_fingerprint(), "cpu": "another"}
    (recording,) = ExportedTrials(simulated).of("S001", 1)
    told = replay(recording, here=here)
    assert (told.state, told.tolerance) == ("same", 1e-6)
    assert told.other == (f"cpu was {machine_fingerprint()['cpu']}, is another",)
    row = recording.ticks[5]
    near = replace(row, p_x=row.p_x + 9e-7, entropy=row.entropy + 1e-9, digest="another")
    far = replace(row, p_x=row.p_x + 2e-6)
    word = replace(row, source="blend")
    belief = replace(row, belief=json.dumps({goal: p + 1e-8 for goal, p in json.loads(row.belief).items()}))
    for changed_row, asked, state in [
        (near, Asked(), "same"),
        (belief, Asked(), "same"),
        (far, Asked(), "different"),
        (far, Asked(tolerance=1e-5), "same"),
        (word, Asked(), "different"),
        (near, Asked(tolerance=0.0), "different"),
    ]:
        ticks = (*recording.ticks[:5], changed_row, *recording.ticks[6:])
        assert replay(replace(recording, ticks=ticks), asked, here).state == state


@pytest.mark.parametrize("robot", ROBOTS)
def test_an_export_of_the_first_schema_says_what_was_taken_for_granted(
    tmp_path: Path, robot: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Recorded by another version on another machine; before robots were named and arms were freed."""
    folder = str(recorded_export(robot, tmp_path))
    status, out, err = typed(capsys, "replay", folder, "--participant", "P001", "--trial", "1")
    assert (status, err) == (2, "")
    assert out == f"P001 trial 1: cannot be replayed: {NO_ROBOT}\n"
    status, out, err = typed(capsys, "replay", folder, "--participant", "P001", "--trial", "1", "--robot", robot)
    assert (status, err) == (0, ""), out
    assert "assumed: the lab's code, taken for this one" in out
    assert "not recorded then: attempt, attempts, departure" in out


def test_a_robot_that_is_named_for_other_trials_only_is_assumed_and_of_two_none_is_taken(
    simulated: Path, tmp_path: Path
) -> None:
    def note(robot: str, tick: str, trial: int = 1) -> dict[str, str]:
        data = json.dumps({"robot": robot, "phase": "trial"})
        told = {"participant": "S001", "trial": str(trial), "tick": tick, "utc": "", "kind": "robot", "source": "lab"}
        return {**told, "data": data}

    live = as_live(simulated, tmp_path)
    one = changed(live, tmp_path / "one", "events", lambda rows: [note("bullet", ""), note("kinematic", "")])
    told = first(one)
    assert (told.state, told.robot, told.assumed) == ("same", "kinematic", ())  # the one before the first tick
    alone = changed(live, tmp_path / "alone", "events", lambda rows: [note("kinematic", "")])
    _, *others = replay_all(alone, phases=("trial",))
    assert {other.assumed for other in others} == {("the robot, taken from their other trials",)}
    two = changed(live, tmp_path / "two", "events", lambda rows: [note("kinematic", ""), note("bullet", "4")])
    told = first(two)
    assert told.reason == "it ran on several robots: kinematic, then bullet; name one with --robot"
    assert first(two, Asked(robot="kinematic")).state == "same"


def as_live(simulated: Path, folder: Path) -> Path:
    """A simulated export that says of its robot what a live one does."""
    copy = shutil.copytree(simulated, folder / "live")
    meta = json.loads((copy / "meta.json").read_text(encoding="utf-8"))
    del meta["simulated"]
    (copy / "meta.json").write_text(json.dumps(meta), encoding="utf-8")
    return copy


def test_a_robot_of_another_source_is_not_taken_for_the_one_that_ran(simulated: Path) -> None:
    (recording,) = ExportedTrials(simulated).of("S001", 1)
    own = {"robot": "kinematic", "package": "arms", "version": "1.2", "sha256": "ab" * 32}
    told = replay(replace(recording, ran_on=replace(recording.ran_on, robots=(own,))))
    assert told.state == "cannot"
    assert told.reason.startswith("robot 'kinematic' was arms 1.2, source abababababab, here it is one without")
    gone = {"robot": "left", "package": "arms", "version": "1.2", "sha256": "ab" * 32}
    told = replay(replace(recording, ran_on=replace(recording.ran_on, robots=(gone,))))
    assert told.state == "cannot" and "'left'" in told.reason


def test_code_that_came_with_the_study_file_runs_when_it_is_trusted_and_not_before(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write_study(tmp_path, ONE_PICKUP)
    text = study.read_text(encoding="utf-8")
    begin, end = text.index("[[conditions]]"), text.index("\n[arbiter]\n")
    own = '[[conditions]]\nid = "own"\narbiter = "own.py:Own"\n'
    study.write_text(text[:begin] + own + text[end:], encoding="utf-8")
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    out = str(tmp_path / "out")
    simulate = ("simulate", "--participants", "1", "--study", str(study), "--trust", "--out", out)
    assert typed(capsys, *simulate)[0] == 0
    (tmp_path / "own.py").unlink()  # the export alone holds it
    status, printed, _ = typed(capsys, "replay", out)
    assert status == 2 and printed.count("cannot be replayed: arbiter 'own.py:Own'") == 2 and "--trust" in printed
    status, printed, _ = typed(capsys, "replay", out, "--trust")
    assert status == 0, printed


# --- the command -------------------------------------------------------------------------------------------------


def test_the_command_ends_with_what_came_of_it(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    which = ("--participant", "S001", "--trial", "2")
    status, out, err = typed(capsys, "replay", str(simulated), *which)
    assert (status, err, out.count("\n")) == (0, "", 1) and "S001 trial 2: " in out
    status, out, err = typed(capsys, "replay", str(simulated), *which, "--practice")
    assert (status, err) == (0, "") and "S001 practice 2: " in out
    worse = str(changed(simulated, tmp_path, "ticks", with_cell(3, "entropy", "0.25")))
    status, out, err = typed(capsys, "replay", worse)
    assert (status, err) == (1, "") and "tick 3: entropy is 0.25 in the record" in out
    assert out.splitlines()[-1].endswith("ticks replayed: 5 the same, 1 different")


def test_a_whole_export_is_verified_and_replayed_at_once(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = typed(capsys, "verify", str(simulated), "--replay")
    assert (status, err) == (0, "") and out.count("the same bit for bit") == 6
    assert "as recorded" in out and out.splitlines()[-1].endswith("ticks replayed: 6 the same")
    worse = str(changed(simulated, tmp_path, "ticks", with_cell(3, "entropy", "0.25")))
    status, out, err = typed(capsys, "verify", worse, "--replay")
    assert status == 1 and "ticks.csv" in out and "tick 3: entropy is 0.25 in the record" in out
    status, _, err = typed(capsys, "verify", "--data", str(tmp_path), "--replay")
    assert status == 1 and "--replay replays an export" in err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("nothing",), "no such folder"),
        ((".",), "no export here"),
        (("EXPORT", "--participant", "P9"), "no participant 'P9'; it has S001"),
        (("EXPORT", "--trial", "9"), "no ticks of trial 9"),
        (("EXPORT", "--workers", "0"), "workers is 0"),
        (("EXPORT", "--tolerance", "-1"), "'-1' is not a bound"),
        (("EXPORT", "--robot", "another"), "'another' is not one of"),
    ],
)
def test_what_cannot_be_replayed_is_one_line_and_status_2(
    simulated: Path,
    own_folder: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    says: str,
) -> None:
    given = [str(simulated) if argument == "EXPORT" else argument for argument in arguments]
    status, out, err = typed(capsys, "replay", *given)
    assert (status, out, err.count("\n")) == (2, "", 1) and says in err, err


def test_a_study_file_that_was_changed_is_not_replayed_with(simulated: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(simulated, tmp_path / "copy")
    (copy / "study.toml").write_text("title = 1\n", encoding="utf-8")
    with pytest.raises(CannotReplay, match="no study file with the hash"):
        first(copy)


def test_a_difference_is_one_sentence() -> None:
    found = Difference("ticks", "tick 3", "p_x", "0.1", "0.2")
    assert str(found) == "tick 3: p_x is 0.1 in the record and 0.2 when replayed"
