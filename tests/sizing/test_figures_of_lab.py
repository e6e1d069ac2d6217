"""What is read off a lab: metrics as text, shares of values and of histograms; and the files that are made of steps."""

from __future__ import annotations

import csv
import json
import math
import os
from dataclasses import fields
from pathlib import Path

import pytest

from app.processes import busy_cpu_s, free_bytes, memory_bytes, tree_bytes, tree_cpu_s
from app.sizing import files
from app.sizing.figures_of_lab import Reading, bucket_share, most, parsed, share
from app.sizing.rule import Step, verdict
from tests.sizing.test_rule import ROOM, of

TEXT = """# HELP salab_commit_seconds From what happened.
# TYPE salab_commit_seconds histogram
salab_commit_seconds_bucket{le="0.005"} 10.0
salab_commit_seconds_bucket{le="0.01"} 30.0
salab_commit_seconds_bucket{le="+Inf"} 40.0
salab_store_queue_length 3.0
salab_http_requests_total{method="GET",route="/api/health",status="200"} 7.0
"""


def test_metrics_are_read_by_name_and_labels() -> None:
    found = Reading(parsed(TEXT), 0.0, 0.0)
    assert found.metric("salab_store_queue_length") == 3.0 and found.metric("salab_none") == 0.0
    assert found.buckets("salab_commit_seconds_bucket") == {0.005: 10.0, 0.01: 30.0, math.inf: 40.0}
    assert most([found, Reading({"salab_store_queue_length": 9.0}, 0.0, 0.0)], "salab_store_queue_length") == 9


def test_a_histogram_is_shared_out_by_straight_lines() -> None:
    after = {0.005: 10.0, 0.01: 30.0, math.inf: 40.0}
    assert bucket_share({}, after, 0.125) == pytest.approx(0.0025)
    assert bucket_share({}, after, 0.5) == pytest.approx(0.0075)
    assert bucket_share({}, after, 0.99) == 0.01, "beyond the last bound nothing is known"
    assert bucket_share(after, after, 0.5) == 0.0 == bucket_share({}, {}, 0.5)
    assert bucket_share({0.005: 10.0, 0.01: 10.0, math.inf: 10.0}, after, 0.5) == pytest.approx(0.00875)


def test_a_share_of_values_is_one_of_them() -> None:
    assert [share(list(range(100)), of) for of in (0.0, 0.5, 0.99)] == [0, 50, 99]
    assert share([], 0.5) == 0.0 and share([7.0], 0.99) == 7.0


def test_this_process_and_machine_have_figures() -> None:
    own_s, others_s = tree_cpu_s(os.getpid())
    memory = tree_bytes(os.getpid())
    assert own_s > 0.0 and others_s >= 0.0 and 1e6 < memory.own <= memory.resident
    assert busy_cpu_s() > 0.0 and 0 < free_bytes() < memory_bytes()
    gone = 2**22 + 1  # beyond what Linux numbers processes with
    assert tree_cpu_s(gone) == (0.0, 0.0) and tree_bytes(gone).resident == 0


def test_steps_are_written_with_what_they_mean_and_drawn(tmp_path: Path) -> None:
    steps = [of(8), of(16), of(24, late=200, worker_cores=3.5)]
    written = files.write_all(tmp_path / "out", steps, verdict(steps, ROOM), ROOM, {"robot": "kinematic"})
    assert [path.name for path in written] == ["sessions.csv", "sessions.json", "sessions.png"]
    with written[0].open(encoding="utf-8", newline="") as source:
        rows = list(csv.DictReader(source))
    names = {field.name for field in fields(Step)}
    assert [row["sessions"] for row in rows] == ["8", "16", "24"] and names < set(rows[0])
    assert [bool(row["does_not_hold"]) for row in rows] == [False, False, True]
    told = json.loads(written[1].read_text(encoding="utf-8"))
    assert (told["robot"], told["verdict"]["held"], len(told["steps"])) == ("kinematic", 16, 3)
    assert written[2].read_bytes().startswith(b"\x89PNG") and files.no_figure() == ""


def test_without_the_extra_the_figure_is_left_out_and_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "has_extra", lambda extra: False)
    written = files.write_all(tmp_path, [of(8)], verdict([of(8)], ROOM), ROOM, {})
    assert [path.name for path in written] == ["sessions.csv", "sessions.json"]
    assert files.no_figure() == "no figure was drawn; for one: pip install 'shared-autonomy-lab[analysis]'"
