"""A data folder of any name: the database is in it, and nowhere else."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from study.store import StoreError, open_store
from tests.support.recordings import recorded_data
from tests.support.study_samples import shipped_study

NAMES = (
    *("what now?a", "50%20off", "100%", "a#b", "a?mode=memory&uri=true", "file:x", "file:lab?mode=ro", ":memory:"),
    *("two  words", "Übung ünd プ", "quo'te\"s", "new\nline", "~", "-data", "semi;colon", "back\\slash", " "),
    *("a" * 200, "\udcff not UTF-8"),
)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("is_relative", [True, False])
def test_the_database_is_in_the_folder_that_was_named(own_folder: Path, name: str, is_relative: bool) -> None:
    folder = Path(name) if is_relative else own_folder / name
    with open_store(folder, exclusive=True) as store:
        one = store.create_participant(shipped_study(), seed=1, public_id="public", utc="2026-01-01T00:00:00.000Z")
    assert os.listdir(own_folder) == [name]
    assert set(os.listdir(own_folder / name)) == {"lab.sqlite", "lab.lock", "lab.pages"}
    with open_store(folder, must_exist=True) as store:
        assert store.sessions() == (one,)


@pytest.mark.parametrize("name", ["what now?a", "file:x", "100%s", "new\nline"])
def test_data_of_an_earlier_version_are_brought_up_there(own_folder: Path, name: str) -> None:
    recorded_data("kinematic", own_folder).rename(own_folder / name)
    there = set(os.listdir(own_folder))
    with open_store(Path(name)) as store:
        assert store.sessions()
    assert set(os.listdir(own_folder)) == there
    (copy,) = (own_folder / name).glob("lab.schema-*.sqlite")
    with closing(sqlite3.connect(copy)) as kept:
        assert kept.execute("PRAGMA integrity_check").fetchone() == ("ok",)


@pytest.mark.parametrize("kind", ["folder", "pipe", "device", "file in the way"])
def test_what_is_no_database_is_told_in_a_line(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "data"
    if kind == "file in the way":
        folder.write_text("")
    else:
        folder.mkdir()
        path = folder / "lab.sqlite"
        if kind == "folder":
            path.mkdir()
        elif kind == "pipe":
            os.mkfifo(path)
        else:
            path.symlink_to("/dev/zero")
    for must_exist in (False, True):
        with pytest.raises(StoreError) as told:
            open_store(folder, must_exist=must_exist).close()
        assert str(told.value).startswith(str(folder)) and "\n" not in str(told.value)
