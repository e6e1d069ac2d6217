"""An export in pandas, docs/examples/10_export_in_pandas."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from study.export.export import read_table
from tests.support.lab_server import ROOT
from tests.support.outside_package import salab
from tests.support.wire_client import write_study

pytestmark = pytest.mark.slow

EXAMPLE = ROOT / "docs" / "examples" / "10_export_in_pandas" / "success_by_condition.py"


def test_the_table_counts_what_the_export_holds(tmp_path: Path) -> None:
    out = tmp_path / "pilot"
    study = str(write_study(tmp_path))  # the example counts as well in a short one
    assert salab("simulate", "--study", study, "--participants", "2", "--seed", "7", "--out", str(out)).returncode == 0
    command = [sys.executable, "-W", "error", str(EXAMPLE), str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    heads, _, *rows = (line.split() for line in done.stdout.splitlines())
    assert heads == ["tasks", "success", "seconds"]
    tasks = [row for row in read_table(out, "tasks") if row.outcome != "not_run"]
    assert sum(int(row[-3]) for row in rows) == len(tasks)
    conditions = [row[0] for row in rows if len(row) == 5]
    assert conditions == sorted({row.condition for row in tasks})
    assert all(0.0 <= float(row[-2]) <= 1.0 and float(row[-1]) > 0.0 for row in rows)
