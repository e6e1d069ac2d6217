"""The robots that `pytest --pyargs app.contracts --robot NAME` names, held to their contract."""

from __future__ import annotations

from typing import Any

from app.contracts.chosen import candidates
from app.contracts.robot import RobotContract


def pytest_generate_tests(metafunc: Any) -> None:
    """Every check for every robot."""
    if "part" in metafunc.fixturenames:
        chosen = candidates(metafunc.config, "robot")
        metafunc.parametrize("part", chosen, ids=[part.name for part in chosen], scope="class")


class TestRobot(RobotContract):
    """Those named on the command line."""
