"""The number as it is kept in a data folder: who may use it, and what is said of one that nobody may."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from app.sizing.capacity import NAME, Capacity, read, write
from app.sizing.machine import machine

HERE = {"system": "Linux x86_64", "cpu": "one", "cores": "4", "memory_gb": "8"}
KEPT = Capacity(16, 24, "bullet", True, "2026-11-27T20:00:00.000Z", "0.1.0", HERE)

WRONG: list[dict[str, Any]] = [{"sessions": value} for value in (0, -3, 2.5, "16", True, 10**9, None)]
WRONG += [{"held": 3}, {"robot": 7}, {"scene": "yes"}, {"machine": []}]


def test_what_is_kept_is_found_again(tmp_path: Path) -> None:
    assert read(tmp_path, HERE, "bullet", True) == (None, "")
    path = write(tmp_path / "data", KEPT)
    assert path.name == NAME and [one.name for one in (tmp_path / "data").iterdir()] == [NAME]
    assert read(tmp_path / "data", HERE, "bullet", True) == (KEPT, "")
    write(tmp_path / "data", replace(KEPT, sessions=2, version="0.2.0"))
    found, said = read(tmp_path / "data", HERE, "bullet", False)
    assert found is not None and (found.sessions, said) == (2, "")


@pytest.mark.parametrize(
    ("here", "robot", "kept", "says"),
    [
        ({**HERE, "cpu": "another"}, "bullet", KEPT, "was measured on another machine (cpu)"),
        ({**HERE, "cores": "2", "memory_gb": "4"}, "bullet", KEPT, "another machine (cores, memory_gb)"),
        (HERE, "mujoco", KEPT, "with the robot bullet, here mujoco moves"),
        (HERE, "bullet", replace(KEPT, scene=False), "without 3-D views"),
    ],
)
def test_a_number_of_elsewhere_is_left_alone_and_told(
    tmp_path: Path, here: dict[str, str], robot: str, kept: Capacity, says: str
) -> None:
    write(tmp_path, kept)
    found, said = read(tmp_path, here, robot, True)
    assert found is None and says in said and said.count("\n") == 0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        '{"sessions": 3}',
        json.dumps({**asdict(KEPT), "more": 1}),
        *(json.dumps({**asdict(KEPT), **wrong}) for wrong in WRONG),
    ],
)
def test_a_file_that_somebody_else_wrote_is_left_alone_and_told(tmp_path: Path, text: str) -> None:
    (tmp_path / NAME).write_text(text, encoding="utf-8")
    found, said = read(tmp_path, HERE, "bullet", True)
    assert found is None and "is not as `salab bench sessions` writes it" in said


def test_what_cannot_be_read_at_all_is_left_alone_and_told(tmp_path: Path) -> None:
    (tmp_path / NAME).mkdir()
    found, said = read(tmp_path, HERE, "bullet", True)
    assert found is None and "cannot be read (IsADirectoryError)" in said
    (tmp_path / NAME).rmdir()
    (tmp_path / NAME).write_bytes(b"\xff\xfe\x00")
    assert read(tmp_path, HERE, "bullet", True)[0] is None


def test_this_machine_is_told_in_a_few_words() -> None:
    found: Any = machine()
    assert set(found) == {"system", "cpu", "cores", "memory_gb"} and int(found["cores"]) >= 1
    assert found == machine()
