"""Figures of simulated studies and their analysis, each by the command a user types. See `tests.bench`.

Seconds are those of the clock, starting the interpreter included, with those of the processors beside them: on a
machine that does other things too, only the latter tell something.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from study.export.export import read_meta, read_table, write_tables
from study.records import TABLES
from tests.bench.figure import Figure
from tests.support.lab_server import ROOT

PEOPLE = 12
TRIALS = 1000
STUDIES = 200
SAMPLE = 20
"""Studies that are run in place of all."""


@dataclass(frozen=True)
class Took:
    """What a command took: by the clock, and on all processors."""

    wall_s: float
    cpu_s: float

    def __str__(self) -> str:
        return f"{self.wall_s:.1f} s (CPU {self.cpu_s:.1f} s)"


def study_figures() -> Iterator[Figure]:
    """`salab simulate` of one study with one worker and with two."""
    with tempfile.TemporaryDirectory() as folder:
        for workers in (1, 2):
            took = _simulate(Path(folder) / str(workers), workers)
            aim = "2 s or less" if workers == 1 else ""
            yield Figure(f"salab simulate --participants {PEOPLE} --workers {workers}", str(took), aim)


def analysis_figures() -> Iterator[Figure]:
    """`salab analyze` over the study of twelve, with its participants repeated under other ids."""
    with tempfile.TemporaryDirectory() as folder:
        small, large = Path(folder) / "small", Path(folder) / "large"
        _simulate(small, 2)
        trials = _repeat(small, large)
        took = _salab("analyze", str(large), "--out", str(Path(folder) / "report"))
    yield Figure(f"salab analyze, {trials} trials", str(took), "3 s or less")


def replication_figures() -> Iterator[Figure]:
    """`salab replicate` of some studies with one worker and with two, and what that makes for all of them."""
    one, two = _replicate(SAMPLE, 1), _replicate(SAMPLE, 2)
    yield Figure(f"salab replicate --studies {SAMPLE} --workers 1 --vary 0", str(one))
    yield Figure(f"salab replicate --studies {SAMPLE} --workers 2 --vary 0", str(two))
    yield Figure("speed-up with two workers", f"{one.wall_s / two.wall_s:.2f}", "1.8 or more")
    times = STUDIES / SAMPLE
    yield Figure(
        f"estimate, not run: {STUDIES} studies, two workers, as {times:g} x {SAMPLE}",
        f"{two.wall_s * times / 60:.1f} min",
        "2 min or less",
    )


def whole_figures() -> Iterator[Figure]:
    """`salab replicate` of all studies, without its variations."""
    took = _replicate(STUDIES, 2)
    yield Figure(
        f"salab replicate --studies {STUDIES} --workers 2 --vary 0",
        f"{took.wall_s / 60:.1f} min (CPU {took.cpu_s / 60:.1f} min)",
        "2 min or less",
    )


def memory_figures() -> Iterator[Figure]:
    """What `salab simulate` and `salab replicate` take at most, by trials of one pickup."""
    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "study.toml"
        shipped = (ROOT / "study" / "definition" / "default.toml").read_text(encoding="utf-8")
        study.write_text(shipped.replace("pickups_per_trial = 3", "pickups_per_trial = 1"), encoding="utf-8")
        for people in (34, 334):
            options = ("--study", str(study), "--out", str(Path(folder) / str(people)))
            took = _peak_mb("simulate", "--participants", str(people), *options)
            yield Figure(f"salab simulate --participants {people}, one pickup a trial", f"{took:.0f} MB at most")
        for studies in (3, 28):
            took = _peak_mb("replicate", "--studies", str(studies), "--vary", "0", "--study", str(study))
            yield Figure(f"salab replicate --studies {studies} --vary 0, one pickup a trial", f"{took:.0f} MB at most")


def _peak_mb(*arguments: str) -> float:
    """Run the command in one process; the most memory that it had."""
    process = subprocess.Popen(
        [sys.executable, "-m", "app", *arguments], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"salab {' '.join(arguments)} ended with {os.waitstatus_to_exitcode(status)}")
    return used.ru_maxrss / 1e3


def _salab(*arguments: str) -> Took:
    """Run the command."""
    before, started_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "app", *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"salab {' '.join(arguments)} ended with {done.returncode}: {done.stderr[-500:]}")
    wall_s, after = time.perf_counter() - started_s, resource.getrusage(resource.RUSAGE_CHILDREN)
    return Took(wall_s, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)


def _simulate(out: Path, workers: int) -> Took:
    return _salab("simulate", "--participants", str(PEOPLE), "--workers", str(workers), "--out", str(out))


def _replicate(studies: int, workers: int) -> Took:
    return _salab("replicate", "--studies", str(studies), "--workers", str(workers), "--vary", "0")


def _repeat(small: Path, large: Path) -> int:
    """Write an export with at least `TRIALS` trials; how many it has."""
    copies = -(-TRIALS // len(read_table(small, "trials")))
    tables = {}
    for table in TABLES:
        rows = read_table(small, table)
        tables[table] = [
            replace(row, participant=f"{row.participant}-{copy:02d}") for copy in range(copies) for row in rows
        ]
    meta = {"machines": read_meta(small)["machines"], "erased_participants": 0}
    write_tables(large, tables, meta=meta)
    return len(tables["trials"])
