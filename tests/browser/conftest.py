"""Labs for pages: fakes that only speak the wire, and one that draws."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support import lab_server as labs
from tests.support.fake_lab import FakeLab
from tests.support.lab_server import LabServer
from tests.support.wire_client import SHORT, write_study


@pytest.fixture
def lab() -> Iterator[FakeLab]:
    with FakeLab() as running:
        yield running


@pytest.fixture
def panel_lab() -> Iterator[FakeLab]:
    """In a round, with its readings on a second device."""
    with FakeLab(placement="second_device", state="trial") as running:
        yield running


@pytest.fixture(scope="module")
def drawing_lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabServer]:
    """A lab that draws: real time, a scene, no physics engine."""
    folder = tmp_path_factory.mktemp("drawing")
    with labs.start(folder / "data", "--robot", "kinematic", "--study", str(write_study(folder, SHORT))) as running:
        yield running
