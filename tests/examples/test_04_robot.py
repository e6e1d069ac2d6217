"""A robot of one's own as an installed package, docs/examples/04_robot."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from study.export.export import read_table
from tests.support.lab_server import ROOT
from tests.support.outside_package import install_project, installed_at, salab

EXAMPLE = ROOT / "docs" / "examples" / "04_robot"


def test_it_moves_as_the_kinematic_robot_but_slowly_while_it_carries(tmp_path: Path) -> None:
    site = tmp_path / "site"
    site.mkdir()
    install_project(site, EXAMPLE)
    steps_m = {}
    for robot, environment in (("kinematic", None), ("careful", installed_at(site))):
        out = tmp_path / robot
        arguments = ("simulate", "--robot", robot, "--participants", "1", "--seed", "4", "--out", str(out))
        done = salab(*arguments, environment=environment)
        assert done.returncode == 0, done.stderr
        rows = [row for row in read_table(out, "ticks") if row.source == "user" and row.blocked == 0]
        for held in (False, True):
            moved = [
                np.linalg.norm([b.p_x - a.p_x, b.p_y - a.p_y, b.p_z - a.p_z])
                for a, b in itertools.pairwise(rows)
                if b.tick == a.tick + 1 and b.trial == a.trial and (a.held is not None) is held
            ]
            steps_m[robot, held] = float(max(moved))
    assert steps_m["kinematic", False] == steps_m["careful", False]
    assert abs(steps_m["careful", True] - 0.01) < 1e-6 < steps_m["kinematic", True] - 0.015


def test_without_the_package_there_is_no_such_robot(tmp_path: Path) -> None:
    done = salab("simulate", "--robot", "careful", "--participants", "1", "--out", str(tmp_path / "out"))
    assert done.returncode != 0
    assert "'careful' is not one of bullet, kinematic" in done.stderr
