"""An export is there whole or not at all, and who is killed while making one leaves nothing that stays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from study.export import placing
from study.export.export import ExportError, export, export_zip, read_meta, read_table, write_tables
from study.export.placing import NOTES, PREFIX, put_in_place, sweep, sweep_noted, work_folder
from study.store import Store, open_store
from tests.support.lab_server import ROOT
from tests.support.study_samples import tick_row

STUCK = """
import sys, time
from study.export.export import export, export_zip
from study.store import open_store

def told(table, rows):
    if table == sys.argv[4]:
        print("there", flush=True)
        time.sleep(600)

with open_store(sys.argv[2], must_exist=True) as store:
    {"folder": export, "zip": export_zip}[sys.argv[1]](store, sys.argv[3], told=told)
"""


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "data") as opened:
        yield opened


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def left(folder: Path) -> list[str]:
    return [name for name in names(folder) if name.startswith(PREFIX)]


@contextmanager
def stuck(kind: str, data_dir: Path, out: Path, at: str = "tasks") -> Iterator[subprocess.Popen[str]]:
    """An export in another process that has come so far; ended at the end."""
    command = [sys.executable, "-c", STUCK, kind, str(data_dir), str(out), at]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == "there\n"
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize(("kind", "at"), [("folder", "tasks"), ("zip", "tasks"), ("zip", "the archive")])
def test_a_killed_export_leaves_what_was_there_and_the_next_one_cleans_up(
    store: Store, tmp_path: Path, kind: str, at: str
) -> None:
    out = tmp_path / "place" / ("out" if kind == "folder" else "out.zip")
    make: Callable[..., object] = export if kind == "folder" else export_zip
    make(store, out)
    before = out.stat().st_ino
    with stuck(kind, tmp_path / "data", out, at) as process:
        assert len(left(out.parent)) == 1
        assert (out.parent / left(out.parent)[0]).stat().st_mode & 0o777 == 0o700
        sweep(out.parent)
        sweep_noted(tmp_path / "data")
        assert len(left(out.parent)) == 1, "what is being made is nobody else's to remove"
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert out.stat().st_ino == before and len(left(out.parent)) == 1
    make(store, out)
    assert names(out.parent) == [out.name] and out.stat().st_ino != before
    sweep_noted(tmp_path / "data")
    assert NOTES not in names(tmp_path / "data")


def test_an_erasure_reaches_what_a_killed_export_left_anywhere(store: Store, tmp_path: Path) -> None:
    with stuck("folder", tmp_path / "data", tmp_path / "elsewhere" / "out") as process:
        process.kill()
        process.wait()
    assert names(tmp_path / "elsewhere") == left(tmp_path / "elsewhere") != []
    assert names(tmp_path / "data" / NOTES) == left(tmp_path / "elsewhere")
    sweep_noted(tmp_path / "data")
    assert names(tmp_path / "elsewhere") == [] and NOTES not in names(tmp_path / "data")


def test_a_note_leads_to_work_folders_alone(tmp_path: Path) -> None:
    (tmp_path / NOTES).mkdir()
    (tmp_path / "thesis").mkdir()
    (tmp_path / NOTES / "odd").write_text(str(tmp_path / "thesis"))
    (tmp_path / NOTES / "odder").write_bytes(b"\xff")
    sweep_noted(tmp_path)
    assert (tmp_path / "thesis").is_dir()
    os.symlink(tmp_path / "thesis", tmp_path / f"{PREFIX}link")
    sweep(tmp_path)
    assert (tmp_path / "thesis").is_dir()


def test_an_export_that_fails_leaves_the_earlier_one(store: Store, tmp_path: Path) -> None:
    out = tmp_path / "out"
    export(store, out)
    with pytest.raises(ExportError, match="takes TickRow, not str"):
        write_tables(out, {"ticks": [tick_row("P001", 0), "not a row"]})
    assert read_table(out, "ticks") == [] and read_meta(out)["complete"] is True
    assert names(tmp_path) == ["data", "out"]


@pytest.mark.parametrize("can_exchange", [True, False])
def test_a_folder_takes_the_place_of_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, can_exchange: bool
) -> None:
    if not can_exchange:
        monkeypatch.setattr(placing, "_exchanged", lambda made, place: False)
    place = tmp_path / "place"
    place.mkdir()
    for number in ("one", "two"):  # into an empty folder, then in place of a full one
        with work_folder(tmp_path) as work:
            (work / "files").mkdir()
            (work / "files" / number).write_text(number)
            put_in_place(work / "files", place)
        assert (names(tmp_path), names(place)) == (["place"], [number])


def test_who_is_killed_between_two_moves_has_the_earlier_one_back(tmp_path: Path) -> None:
    left_over = tmp_path / f"{PREFIX}abc"
    (left_over / "earlier").mkdir(parents=True)
    (left_over / "earlier" / "kept").touch()
    (left_over / "place").write_text("out")
    sweep(tmp_path)
    assert (names(tmp_path), names(tmp_path / "out")) == (["out"], ["kept"])


@pytest.mark.parametrize("named", [".", ".."])
def test_the_folder_one_is_in_is_not_replaced(own_folder: Path, monkeypatch: pytest.MonkeyPatch, named: str) -> None:
    write_tables("here", {})
    (own_folder / "here" / "deeper").mkdir()
    monkeypatch.chdir(own_folder / "here" if named == "." else own_folder / "here" / "deeper")
    (own_folder / "here" / "deeper").rename(own_folder / "here" / ".DS_Store")  # no file that would be lost
    with pytest.raises(ExportError, match="the folder you are in, and an export takes a folder's place") as refused:
        write_tables(named, {})
    assert f"{named}/export" in str(refused.value)
