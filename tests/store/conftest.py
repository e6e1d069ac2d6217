"""Where the store keeps its data: every test of what a store does runs on both kinds of database."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.store import DataPlace
from tests.support.data_places import KINDS, new_place


@pytest.fixture(
    params=[pytest.param(kind, marks=[pytest.mark.postgres] if kind == "postgres" else []) for kind in KINDS]
)
def place(request: pytest.FixtureRequest, tmp_path: Path) -> DataPlace:
    """Nothing is there yet."""
    server = request.getfixturevalue("postgres") if request.param == "postgres" else None
    return new_place(request.param, tmp_path / "data", server)
