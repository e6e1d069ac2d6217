"""A copy of the data folder while a lab runs, and the way back.

A backup is a data folder with checksums: the database as of one moment (by SQLite's backup API, or row by row from a
server), the lab's key, and the study files of the participants to read. It belongs to its owner alone. Everything is
written beside the place where it is to stand, and moved there when it is whole and on disk.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from study.integrity.checksums import SUMS_NAME, changed_files, check_sums, digest, sums_of
from study.integrity.findings import Verdict
from study.integrity.signing import KEY_NAME
from study.store.copying import copy_rows
from study.store.place import DataPlace, place_of
from study.store.sqlite_file import FILE_NAME
from study.store.values import StoreError
from study.store.verification import verify_data
from study.store.whole import made_whole

NOTE_NAME = "backup.json"
FORMAT = "shared-autonomy-lab backup"
KEPT = (KEY_NAME,)
"""Files of a data folder beside the database that a restored lab needs."""


def back_up(data: DataPlace | Path, out: Path, utc: str) -> Verdict:
    """Copy a lab's data, and say whether the copy holds what was recorded. Raises `StoreError` when there are none, the
    place is taken, or the copy cannot be written: then there is none."""
    place = place_of(data)
    folder, source = place.folder, place.folder / FILE_NAME
    if place.url is None and not source.is_file():
        raise StoreError(f"{folder}: no lab data here ({FILE_NAME} is missing)")
    _refuse_inside(out, folder, "a backup is lost with the folder that it lies in, and erasing does not reach it")
    with made_whole(out) as made:
        if place.url is None:
            _copy_file(source, made / FILE_NAME)
        else:
            copy_rows(place, made)
        with closing(sqlite3.connect(made / FILE_NAME)) as copy:
            copy.execute("PRAGMA journal_mode=DELETE")  # a file that stands alone, with no log beside it
            studies = copy.execute("SELECT hash, text FROM studies").fetchall()
        for study_hash, text in studies:
            (made / f"study-{study_hash[:12]}.toml").write_text(text, encoding="utf-8", newline="")
        for name in KEPT:
            if (folder / name).is_file():
                shutil.copyfile(folder / name, made / name)
        verdict = verify_data(made)
        note = {"format": FORMAT, "utc": utc, "participants": verdict.participants, "links": verdict.links}
        (made / NOTE_NAME).write_text(json.dumps(note, indent=2) + "\n", encoding="utf-8")
        sums = {path.name: digest(path) for path in made.iterdir()}
        (made / SUMS_NAME).write_text(sums_of(sums), encoding="utf-8")
    return verdict


def _copy_file(source: Path, target: Path) -> None:
    address = f"file:{quote(str(source.absolute()))}?mode=ro"
    with (
        closing(sqlite3.connect(address, uri=True, timeout=10.0)) as database,
        closing(sqlite3.connect(target)) as copy,
    ):
        database.backup(copy)


def restore(backup: Path, folder: Path) -> Verdict:
    """Make a data folder of a backup that is as it was written.

    Raises `StoreError` for what is no backup, for a changed one, and for a folder that holds anything.
    """
    try:
        note = json.loads((backup / NOTE_NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        note = None
    if not isinstance(note, dict) or note.get("format") != FORMAT:
        raise StoreError(f"{backup}: no backup here; give the folder that `salab backup` wrote")
    changed = changed_files(check_sums(backup, known=(FILE_NAME, NOTE_NAME, *KEPT)))
    if changed:
        raise StoreError(f"{backup}: changed since the backup: {changed}; nothing was restored")
    verdict = verify_data(backup)
    if verdict.findings:
        raise StoreError(f"{backup}: not as recorded: {verdict.findings[0]}; nothing was restored")
    _refuse_inside(folder, backup, "a backup stays as it was written")
    with made_whole(folder) as made:
        for name in (FILE_NAME, *KEPT):
            if (backup / name).is_file():
                shutil.copyfile(backup / name, made / name)
    return verdict


def _refuse_inside(place: Path, folder: Path, why: str) -> None:
    if place.resolve().is_relative_to(folder.resolve()) and place.resolve() != folder.resolve():
        raise StoreError(f"{place}: lies in {folder}; {why}; choose another place")
