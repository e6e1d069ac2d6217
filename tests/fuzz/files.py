"""Files: whatever stands in them, what comes of it is a value or one line for each problem, within a time."""

from __future__ import annotations

import base64
import shutil
import signal
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

from app.trial.world import drafted_layout, open_study, parse_stored
from study.analysis.dataset import load
from study.export.export import read_meta, read_table
from study.language.catalogue import shipped_text
from study.records import TABLES, StudyError
from study.text_file import list_rows
from tests.fuzz.mutations import mutated
from tests.fuzz.surface import Surface
from tests.support.recordings import recorded_export
from tests.support.study_samples import lab_text

WITHIN_S = 20
"""A file that takes longer to be refused hangs whoever waits for it; on a busy machine one takes a second."""
LONGEST_LINE = 2_000
QUESTIONNAIRE = """title = "Teamwork"
intro = "How much do you agree?"
score_means = "more trust"
points = 5
low = "not at all"
high = "very much"
items = [
    { id = "trust", text = "I trusted the robot." },
    { id = "strain", text = "It strained me.", reversed = true },
]
"""
MESH = (
    "# a tetrahedron\nv 0 0 0 0.1 0.2 0.3\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nf 1 2 3\nf 1//1 2//1 4//1\nf -1 -2 -3\n"
)
LAYOUT = """places_m = [[0.765, 0.448], [0.875, 0.326], [0.765, 0.204], [0.875, 0.082], [0.765, -0.04], [0.875, -0.162]]
[table]
center_m = [0.9, 0.0, 0.75]
size_m = [0.35, 1.2, 0.04]
[[bins]]
id = "cup"
label = "cup board"
center_m = [0.52, 0.47]
inner_size_m = [0.3, 0.3]
height_m = 0.38
color = "#0072b2"
[[objects]]
id = "mug"
label = "mug"
shape = "box"
size_m = [0.06, 0.06, 0.13]
mass_kg = 0.2
friction = 0.65
color = "#2f8f83"
mesh = "mug.obj"
"""


class TakesTooLong(BaseException):
    """Raised from a timer into whatever is reading; no `except Exception` catches it."""


@contextmanager
def in_time(seconds: int) -> Iterator[None]:
    """Raise `TakesTooLong` in what runs longer."""

    def late(*_: object) -> None:
        raise TakesTooLong(f"took more than {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


class Files(Surface):
    """Study files, what stands beside them, and tables of exports."""

    name = "files"

    def __init__(self, place: Path) -> None:
        self._place = place / "files"
        self._place.mkdir()
        self._export = recorded_export("kinematic", self._place)
        self._work = self._place / "work"
        study = lab_text()
        self._study = study
        asks = study.replace('surveys = ["sus_modified", "tlx_raw"]', 'surveys = ["teamwork"]', 1)
        german = study.replace('language = "en" ', 'language = "de" ', 1).replace(
            'translation = "" ', 'translation = "own.po" ', 1
        )
        german = german.replace('surveys = ["sus_modified", "tlx_raw"]', "surveys = []", 1)
        kitchen = study.replace('layout = "arc"', 'layout = "kitchen"', 1)
        po = shipped_text("de")[1]
        self._kinds: Mapping[str, tuple[int, dict[str, str], str, Callable[[Path], object]]] = {
            "study": (5, {"my-study.toml": study}, "my-study.toml", self._open),
            "questionnaire": (2, {"my-study.toml": asks, "teamwork.toml": QUESTIONNAIRE}, "teamwork.toml", self._open),
            "layout": (
                2,
                {"my-study.toml": kitchen, "kitchen.toml": LAYOUT, "mug.obj": MESH},
                "kitchen.toml",
                self._open,
            ),
            "mesh": (1, {"my-study.toml": kitchen, "kitchen.toml": LAYOUT, "mug.obj": MESH}, "mug.obj", self._open),
            "translation": (1, {"my-study.toml": german, "own.po": po[:6_000]}, "own.po", self._open),
            "list": (
                1,
                {"list.csv": "id,status\r\n5f3,APPROVED\r\n"},
                "list.csv",
                lambda file: list(list_rows(file, 10**6)),
            ),
            **{
                f"export-{name}": (1, {}, name, self._load(name))
                for name in ("meta.json", "study.toml", *(f"{table}.csv" for table in TABLES))
                if (self._export / name).exists()
            },
        }

    def inputs(self, count: int, random: Random) -> Iterator[tuple[Any, int]]:
        """A kind of file and what stands in it."""
        kinds = [kind for kind, (weight, *_) in self._kinds.items() for _ in range(weight)]
        for _ in range(count):
            kind = random.choice(kinds)
            _, files, name, _ = self._kinds[kind]
            raw = files[name].encode() if files else (self._export / name).read_bytes()
            yield {"kind": kind, "bytes": base64.b64encode(mutated(raw, random)).decode()}, 1

    def problem(self, given: Any) -> str:
        """What is no answer: a traceback, a wait, an answer of many lines."""
        _, files, name, read = self._kinds[given["kind"]]
        raw = base64.b64decode(given["bytes"])
        if files:
            shutil.rmtree(self._work, ignore_errors=True)
            self._work.mkdir()
            for other, text in files.items():
                (self._work / other).write_text(text, encoding="utf-8")
            (self._work / name).write_bytes(raw)
            target = self._work / ("my-study.toml" if "my-study.toml" in files else name)
            return self._told(read, target)
        whole = (self._export / name).read_bytes()
        (self._export / name).write_bytes(raw)
        try:
            return self._told(read, self._export)
        finally:
            (self._export / name).write_bytes(whole)

    def _told(self, read: Callable[[Path], object], target: Path) -> str:
        try:
            with in_time(WITHIN_S):
                read(target)
        except StudyError as error:
            lines = getattr(error, "problems", ())  # the lines of others are shortened where they are printed
            wrong = [line for line in lines if "\n" in line or len(line) > LONGEST_LINE]
            return f"no line: {wrong[0][:300]!r}" if wrong else ""
        except (Exception, TakesTooLong):
            return traceback.format_exc()
        return ""

    @staticmethod
    def _open(file: Path) -> None:
        """As `salab check` does; of a study that is fine also what is made of it."""
        try:
            study = open_study(file)
        except StudyError:
            drafted_layout(file)
            raise
        again = parse_stored(study.source_text, "as stored")
        if again.hash != study.hash:
            raise AssertionError("the text that is stored is another study than the file")

    def _load(self, name: str) -> Callable[[Path], object]:
        table = name.removesuffix(".csv")
        if name == "meta.json":
            return read_meta
        if name in ("ticks.csv", "tasks.csv", "trials.csv", "study.toml", "participants.csv"):
            return load
        return lambda folder: read_table(folder, table)
