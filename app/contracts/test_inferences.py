"""The parts that `pytest --pyargs app.contracts --inference NAME` names, held to their contract."""

from __future__ import annotations

from typing import Any

from app.contracts.chosen import candidates
from app.contracts.inference import InferenceContract


def pytest_generate_tests(metafunc: Any) -> None:
    """Every check for every part."""
    if "part" in metafunc.fixturenames:
        chosen = candidates(metafunc.config, "inference")
        metafunc.parametrize("part", chosen, ids=[part.name for part in chosen], scope="class")


class TestInference(InferenceContract):
    """Those named on the command line."""
