"""What is flushed, and what is said of files where a mode does not keep others out."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.disk import flushing, private_files
from study.disk.flushing import to_disk
from study.disk.private_files import keep_private


@pytest.mark.parametrize("can_open_folders", [True, False])
def test_files_and_folders_are_flushed_or_said_to_be_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, can_open_folders: bool
) -> None:
    monkeypatch.setattr(flushing, "CAN_OPEN_FOLDERS", can_open_folders)
    (tmp_path / "file").write_text("text")
    to_disk(tmp_path / "file")
    to_disk(tmp_path)
    assert (tmp_path / "file").read_text() == "text"
    with pytest.raises(FileNotFoundError):
        to_disk(tmp_path / "gone")


def test_where_modes_say_nothing_a_folder_of_others_is_told_and_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(private_files, "HAS_MODES", False)
    monkeypatch.setenv("HOME", str(tmp_path / "ada"))
    (tmp_path / "ada").mkdir()
    (tmp_path / "lab.sqlite").touch()
    (tmp_path / "lab.sqlite").chmod(0o644)
    keep_private(tmp_path / "ada", "lab")
    assert caplog.text == ""
    keep_private(tmp_path, "lab")
    assert "icacls" in caplog.text
    assert (tmp_path / "lab.sqlite").stat().st_mode & 0o777 == 0o644
