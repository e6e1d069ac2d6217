"""`salab simulate`: an export like a real study's, the same bytes however it was made."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from weakref import WeakSet

import pytest

from app.__main__ import main
from app.errors import LabError
from app.replication.studies import Archive
from app.simulated.participant import Record
from app.simulated.study import AHEAD, Plan, make_plan, run_jobs, simulate
from app.simulated.variants import changed_study, fitted_population
from app.trial.world import open_study
from study.definition.study import orders
from study.export.export import read_meta, read_table
from study.records import TABLES, row_of
from tests.support.jobs import dies, fails_at_two
from tests.support.study_samples import small_study

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def small_plan(seed: int = 7) -> Plan:
    return Plan(small_study().source_text, seed, population=fitted_population())


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("simulated") / "out"
    simulate(small_plan(), 3, 1, out, "fitted")
    return out


def test_the_folder_is_an_export(export: Path) -> None:
    rows = {table: read_table(export, table) for table in TABLES}
    assert [row.participant for row in rows["participants"]] == ["S001", "S002", "S003"]
    assert len(rows["tasks"]) == 3 * 3 * 2
    assert {row.study_hash for row in rows["participants"]} == set(read_meta(export)["studies"])
    assert (export / "study.toml").read_text(encoding="utf-8") == small_plan().study_text
    assert read_meta(export)["simulated"]["seed"] == 7
    assert not export.with_name("out.part").exists()


def test_orders_are_taken_in_turn(export: Path) -> None:
    taken = [tuple(row.condition_order.split(">")) for row in read_table(export, "participants")]
    assert taken == list(orders(small_study())[:3])


def test_two_processes_leave_the_same_bytes(export: Path, tmp_path: Path) -> None:
    simulate(small_plan(), 3, 2, tmp_path / "out", "fitted")
    assert files(tmp_path / "out") == files(export)


def test_interrupted_and_started_again_it_leaves_the_same_bytes(
    export: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    run = Plan.run

    def killed_at_the_third(self: Plan, index: int) -> Record:
        if index == 2:
            raise KeyboardInterrupt
        return run(self, index)

    monkeypatch.setattr(Plan, "run", killed_at_the_third)
    with pytest.raises(KeyboardInterrupt):
        simulate(small_plan(), 3, 1, out, "fitted")
    assert not out.exists()

    done_again: list[int] = []

    def counted(self: Plan, index: int) -> Record:
        done_again.append(index)
        return run(self, index)

    monkeypatch.setattr(Plan, "run", counted)
    simulate(small_plan(), 3, 1, out, "fitted")
    assert done_again == [2]
    assert files(out) == files(export)


def test_a_participant_who_was_being_written_is_done_again(export: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    simulate(small_plan(), 1, 1, tmp_path / "other", "fitted")
    part = tmp_path / "out.part"
    part.mkdir()
    half = part / f"00000.{os.getpid() + 1}"
    half.mkdir()
    (part / "settings.json").write_text(json.dumps(small_plan().settings()))
    simulate(small_plan(), 3, 1, out, "fitted")
    assert files(out) == files(export)


def test_what_waits_of_another_simulation_is_not_mixed_in(tmp_path: Path) -> None:
    part = tmp_path / "out.part"
    part.mkdir()
    (part / "settings.json").write_text(json.dumps(small_plan(8).settings()))
    with pytest.raises(LabError, match=r"unfinished simulation with another seed"):
        simulate(small_plan(7), 1, 1, tmp_path / "out", "fitted")


@pytest.mark.parametrize(
    ("inside", "why"),
    [(None, "Not a directory"), ("[1, 2]", "settings.json holds no settings"), ("{", "Expecting property name")],
)
def test_what_waits_and_cannot_be_read_is_one_plain_line(tmp_path: Path, inside: str | None, why: str) -> None:
    part = tmp_path / "out.part"
    if inside is None:
        part.write_text("a file of somebody's")
    else:
        part.mkdir()
        (part / "settings.json").write_text(inside)
    with pytest.raises(LabError) as caught:
        simulate(small_plan(), 1, 1, tmp_path / "out", "fitted")
    assert f"{part}: cannot be used: {why}" in str(caught.value) and "Errno" not in str(caught.value)
    kept = Archive(part, {"seed": 1})
    with pytest.raises(LabError) as caught:
        kept.open()
    assert "cannot be used: " in str(caught.value) and "Errno" not in str(caught.value)


def test_presets_are_study_files_of_their_own() -> None:
    plans = {name: make_plan(1, "kinematic", name) for name in ("shipped", "paper", "lab", "fitted")}
    rationality = {name: plan.case(0).setup.study.arbiter.rationality_per_m for name, plan in plans.items()}
    assert rationality["paper"] == 1.0
    assert rationality["lab"] == 5.0
    assert len({plans[name].case(0).setup.study.hash for name in ("paper", "lab", "fitted")}) == 3
    assert plans["shipped"].study_text == open_study(None).source_text


def test_a_study_file_is_simulated_as_it_stands(tmp_path: Path) -> None:
    own = changed_study(open_study(None), {"arbiter": {"rationality_per_m": 12.5}})
    file = tmp_path / "own.toml"
    file.write_text(own.source_text, encoding="utf-8")
    assert make_plan(1, "kinematic", None, file).study_text == own.source_text
    assert "rationality_per_m = 5.0" in make_plan(1, "kinematic", "lab", file).study_text


def test_a_participant_depends_on_nobody_else() -> None:
    plan = small_plan()
    assert plan.case(4).seed == plan.case(4).seed
    assert len({plan.case(index).seed for index in range(50)}) == 50
    assert plan.case(4).seed != replace(plan, seed=8).case(4).seed


@pytest.mark.parametrize("workers", [1, 2])
def test_what_fails_in_a_process_fails_the_whole(workers: int) -> None:
    with pytest.raises(LabError, match="two"):
        list(run_jobs(fails_at_two, [1, 2, 3], workers))


def test_a_process_that_dies_is_told_in_a_line() -> None:
    with pytest.raises(LabError, match="what is done is kept"):
        list(run_jobs(dies, [1, 2], 2))


class Taken(list[int]):
    """Jobs, and how many of them have been asked for."""

    taken = 0

    def __iter__(self) -> Iterator[int]:
        for job in super().__iter__():
            self.taken += 1
            yield job


def test_no_more_jobs_are_given_out_than_keep_the_processes_busy() -> None:
    jobs, ahead = Taken(range(10, 40)), []
    for done, (job, result) in enumerate(run_jobs(fails_at_two, jobs, 2)):
        assert job == result
        ahead.append(jobs.taken - done)
    assert jobs.taken == len(ahead) == 30 and max(ahead) <= 2 * AHEAD + 1


@pytest.mark.parametrize("people", [2, 5])
def test_rows_are_not_held_however_many_people_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, people: int
) -> None:
    monkeypatch.setattr("study.export.export._AT_ONCE", 50)
    alive: WeakSet[Any] = WeakSet()
    most = made = 0

    def counted(*given: Any) -> Any:
        nonlocal most, made
        row = row_of(*given)
        alive.add(row)
        most, made = max(most, len(alive)), made + 1
        return row

    monkeypatch.setattr("app.simulated.study.row_of", counted)
    simulate(small_plan(), people, 1, tmp_path / "out", "fitted")
    assert made > people * 300 and most <= 2 * 50 + 1


LEFT_ALONE = """
import os, sys, time
from app.simulated.study import run_jobs
import tests.support.jobs
if __name__ == "__main__":
    for job, pid in run_jobs(tests.support.jobs.tell_and_sleep, [1, 2], 2):
        pass
"""


def test_processes_end_when_the_command_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "command.py"
    script.write_text(LEFT_ALONE)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TELL_PIDS_IN": str(tmp_path)}
    with subprocess.Popen([sys.executable, str(script)], env=environment) as command:
        pids = wait_for(lambda: [int(path.suffix[1:]) for path in tmp_path.glob("pid.*")], 2)
        command.kill()
    wait_for(lambda: [pid for pid in pids if not alive(pid)], 2)


def wait_for(found: Callable[[], list[int]], count: int) -> list[int]:
    deadline_s = time.monotonic() + 60.0
    while len(found()) < count:
        assert time.monotonic() < deadline_s, f"found {found()}"
        time.sleep(0.05)  # other processes, no event to wait for
    return found()


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--participants", "0"], "participants is 0; it must be from 1 to 9999"),
        (["--workers", "0"], "workers is 0; it must be from 1 to 256"),
        (["--seed", "-1"], "seed -1; it must be from 0"),
        (["--study", "nowhere.toml"], "nowhere.toml: cannot be read"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", "--out", str(tmp_path / "out"), *arguments]) == 1
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_folder_with_something_else_in_it_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis.txt").write_text("all of it")
    assert main(["simulate", "--participants", "1", "--out", str(tmp_path)]) == 1
    assert "not empty and not an earlier export" in capsys.readouterr().err
    assert (tmp_path / "thesis.txt").read_text() == "all of it"
