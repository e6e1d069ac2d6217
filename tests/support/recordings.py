"""What earlier versions of the lab wrote (`recorded/SCHEMA/ROBOT`), copied to where a test may change it."""

from __future__ import annotations

import gzip
import shutil
import zipfile
from pathlib import Path

from study.store import open_store

RECORDED = Path(__file__).with_name("recorded")
SCHEMAS = tuple(sorted(folder.name for folder in RECORDED.iterdir()))
"""Every schema that was ever released; a new one gets a folder once, by `write_recorded_fixture`."""
CASES = tuple((folder.parent.name, folder.name) for folder in sorted(RECORDED.glob("*/*")))
"""Schema and robot of each recording: the first schema with both, those after it with the plain one."""
FINISHED, MIDWAY, ERASED, PILOT, DEMO = "P001", "P002", "P003", "T004", "D005"


def recorded_data(robot: str, place: Path, schema: str = SCHEMAS[0]) -> Path:
    """A data folder as that schema's lab left it."""
    folder = place / f"data-{schema}-{robot}"
    folder.mkdir()
    packed = RECORDED / schema / robot / "lab.sqlite.gz"
    if packed.exists():
        (folder / "lab.sqlite").write_bytes(gzip.decompress(packed.read_bytes()))
    else:
        shutil.copy(RECORDED / schema / robot / "lab.sqlite", folder)
    return folder


def recorded_export(robot: str, place: Path, schema: str = SCHEMAS[0]) -> Path:
    """The export of that data folder, unpacked, pilot included."""
    folder = place / f"export-{schema}-{robot}"
    with zipfile.ZipFile(RECORDED / schema / robot / "export.zip") as archive:
        archive.extractall(folder)
    return folder


def study_file(data: Path, place: Path) -> Path:
    """The study file that the participants of a data folder were enrolled with."""
    with open_store(data, must_exist=True) as store, store.snapshot() as recorded:
        (text,) = recorded.study_texts().values()
    path = place / "as-enrolled.toml"
    path.write_text(text, encoding="utf-8", newline="")
    return path
