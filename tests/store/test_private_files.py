"""What is recorded is about people: its files are their owner's alone, whatever the system's mask says."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from study.export.export import export, export_zip
from study.store import open_store
from tests.support.lab_server import LabServer
from tests.support.wire_client import invite


@pytest.fixture(autouse=True)
def open_mask() -> Iterator[None]:
    before = os.umask(0)
    yield
    os.umask(before)


def open_to_others(folder: Path) -> dict[str, str]:
    """Everything below that others may read or change."""
    return {
        str(path.relative_to(folder)): oct(path.lstat().st_mode)
        for path in sorted(folder.rglob("*"))
        if not path.is_symlink() and path.lstat().st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    }


def test_a_database_and_all_beside_it_are_its_owners(tmp_path: Path) -> None:
    with open_store(tmp_path / "data", exclusive=True):
        names = {path.name for path in (tmp_path / "data").iterdir()}
        assert names >= {"lab.sqlite", "lab.sqlite-wal", "lab.sqlite-shm", "lab.lock"}
        assert open_to_others(tmp_path) == {}


def test_what_was_open_is_closed_and_said_and_what_is_not_ours_is_left(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with open_store(tmp_path, exclusive=True):
        pass
    for name in ("lab.sqlite", "lab.lock", "lab.schema-0001.sqlite", "notes.txt"):
        (tmp_path / name).touch()
        (tmp_path / name).chmod(0o644)
    (tmp_path / "lab.link").symlink_to(tmp_path / "notes.txt")
    with open_store(tmp_path, exclusive=True):
        assert set(open_to_others(tmp_path)) == {"notes.txt"}
    assert caplog.text.count("could be read by others on this computer") == 3
    caplog.clear()
    with open_store(tmp_path, exclusive=True):
        assert "others" not in caplog.text


def test_exports_are_their_owners(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir(mode=0o700)
    with open_store(tmp_path / "data", exclusive=True) as store:
        export(store, tmp_path / "out" / "folder")
        export_zip(store, tmp_path / "out" / "export.zip")
    folder, archive = tmp_path / "out" / "folder", tmp_path / "out" / "export.zip"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700  # nobody gets at what is in it
    assert stat.S_IMODE(archive.stat().st_mode) == 0o600


def test_nothing_that_a_running_lab_writes_is_anybody_elses(start_lab: Callable[..., LabServer]) -> None:
    lab = start_lab("--robot", "kinematic", "--no-scene")
    invite(lab)
    assert open_to_others(lab.data_dir) == {}
