"""The parts that `pytest --pyargs app.contracts --arbiter NAME` names, held to their contract."""

from __future__ import annotations

from typing import Any

from app.contracts.arbiter import ArbiterContract
from app.contracts.chosen import candidates


def pytest_generate_tests(metafunc: Any) -> None:
    """Every check for every part."""
    if "part" in metafunc.fixturenames:
        chosen = candidates(metafunc.config, "arbiter")
        metafunc.parametrize("part", chosen, ids=[part.name for part in chosen], scope="class")


class TestArbiter(ArbiterContract):
    """Those named on the command line."""
