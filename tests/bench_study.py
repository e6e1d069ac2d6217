"""Figures of simulated studies and their analysis, each by the command a user types. See tests/bench.py."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from study.export import read_meta, read_table, write_tables
from study.records import TABLES
from tests.bench import Figure
from tests.lab_server import ROOT

PEOPLE = 12
TRIALS = 1000
STUDIES = 200


def study_figures() -> Iterator[Figure]:
    """`salab simulate` with one worker and with two, starting the interpreter included."""
    with tempfile.TemporaryDirectory() as folder:
        times_s = [_simulate(Path(folder) / str(workers), workers) for workers in (1, 2)]
    yield Figure(f"salab simulate --participants {PEOPLE} --workers 1", f"{times_s[0]:.1f} s", "5 s or less")
    yield Figure(f"salab simulate --participants {PEOPLE} --workers 2", f"{times_s[1]:.1f} s")
    yield Figure("speed-up", f"{times_s[0] / times_s[1]:.2f}", "1.8 or more")


def analysis_figures() -> Iterator[Figure]:
    """`salab analyze` over the study of twelve, with its participants repeated under other ids."""
    with tempfile.TemporaryDirectory() as folder:
        small, large = Path(folder) / "small", Path(folder) / "large"
        _simulate(small, 2)
        trials = _repeat(small, large)
        seconds = _salab("analyze", str(large), "--out", str(Path(folder) / "report"))
    yield Figure(f"salab analyze, {trials} trials", f"{seconds:.1f} s", "10 s or less")


def replication_figures() -> Iterator[Figure]:
    """`salab replicate` without its variations."""
    with tempfile.TemporaryDirectory() as folder:
        out = ("--vary", "0", "--out", str(Path(folder) / "out"))
        seconds = _salab("replicate", "--studies", str(STUDIES), "--workers", "2", *out)
    yield Figure(
        f"salab replicate --studies {STUDIES} --workers 2 --vary 0", f"{seconds / 60:.1f} min", "10 min or less"
    )


def _salab(*arguments: str) -> float:
    """Seconds the command took."""
    started_s = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "app", *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"salab {' '.join(arguments)} ended with {done.returncode}: {done.stderr[-500:]}")
    return time.perf_counter() - started_s


def _simulate(out: Path, workers: int) -> float:
    return _salab("simulate", "--participants", str(PEOPLE), "--workers", str(workers), "--out", str(out))


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
