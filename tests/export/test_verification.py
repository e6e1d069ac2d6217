"""A changed byte in an export is found, whichever file it is in, and named; what cannot be is refused on reading."""

from __future__ import annotations

import csv
import json
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from study.export.export import ExportError, export, read_table
from study.export.verification import refuse_changed, verify_export
from study.integrity.checksums import SUMS_NAME, digest, sums_of
from study.integrity.findings import Finding
from study.records import StudyError
from study.store import Store, open_store
from tests.export.test_export import fill
from tests.support.recordings import recorded_export
from tests.support.study_samples import UTC, shipped_study
from tests.support.typed_command import run


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The export of two people, one of them in a running trial, and of one who has only been enrolled."""
    place = tmp_path_factory.mktemp("whole")
    with open_store(place / "data", exclusive=True) as store:
        fill(store, "first")
        running(store)
        store.create_participant(shipped_study(), seed=3, public_id="third", utc=UTC)
        export(store, place / "export")
    return place / "export"


def running(store: Store) -> None:
    from dataclasses import replace

    from study.store import Batch
    from tests.support.study_samples import tick_row, trial_row

    who = store.create_participant(shipped_study(), seed=2, public_id="second", utc=UTC).participant
    begun = replace(trial_row(who), outcome="running", ticks=0, overruns=0)
    store.commit(Batch(trials=(begun,), ticks=tuple(tick_row(who, tick, late_ms=60.0) for tick in range(4))))


@pytest.fixture
def folder(whole: Path, tmp_path: Path) -> Path:
    shutil.copytree(whole, tmp_path / "export")
    return tmp_path / "export"


def told(folder: Path) -> list[str]:
    return [str(finding) for finding in verify_export(folder).findings]


def edit(folder: Path, table: str, change: Callable[[list[dict[str, str]]], object]) -> None:
    """Change rows of a CSV."""
    path = folder / f"{table}.csv"
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    change(rows)
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def test_what_was_exported_is_as_recorded(whole: Path) -> None:
    verdict = verify_export(whole)
    assert verdict.findings == ()
    assert verdict.participants == 3 and verdict.links == 25
    refuse_changed(whole)


def flips(folder: Path, count: int) -> Iterator[tuple[str, bytes]]:
    """A file of the export with one bit of one byte changed."""
    files = sorted(folder.iterdir())
    for seed in range(count):
        rng = random.Random(seed)
        path = rng.choice(files)
        raw = bytearray(path.read_bytes())
        raw[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
        yield path.name, bytes(raw)


def test_each_of_sixty_flipped_bits_is_found_and_its_file_named(whole: Path, folder: Path) -> None:
    for name, raw in flips(whole, 60):
        (folder / name).write_bytes(raw)
        try:
            found = told(folder)
        except StudyError as error:  # what says that this is an export
            found = [str(error)]
        assert any(name in line for line in found), (name, found)
        (folder / name).write_bytes((whole / name).read_bytes())


@pytest.mark.parametrize(
    ("table", "change", "found"),
    [
        ("ticks", lambda rows: rows[1].update(p_x="0.5"),
         "ticks of P001, trial 1, tick 1: column p_x is not as recorded"),
        ("ticks", lambda rows: rows[1].update(p_x="0.5"),
         "ticks.csv, row 2 (P001, 1, 1): column p_x is not what ticks.parquet has"),
        ("ticks", lambda rows: rows.pop(1),
         "ticks of P001, trial 1, tick 1: is missing; it was recorded"),
        ("ticks", lambda rows: rows.append({**rows[0], "tick": "99"}),
         "ticks of P001, trial 1, tick 99: was not recorded"),
        ("survey_answers", lambda rows: rows[0].update(value="7"),
         "survey_answers of P001, row 1: column value is not as"),
        ("trials", lambda rows: rows[1].update(ticks="9"),
         "trials of P002, trial 1: columns ticks, overruns are not as recorded"),
        ("tasks", lambda rows: rows[0].update(trial="3"),
         "tasks.csv: has rows of participant P001, trial 3, which trials.csv"),
        ("chain", lambda rows: rows[4].update(content=rows[5]["content"]),
         "chain of P001, link 5: its hash does not fit"),
        ("participants", lambda rows: rows.pop(),
         "chain.csv: has rows of participant P003, which participants.csv has not"),
    ],
)  # fmt: skip
def test_a_change_is_named_with_its_row_and_column(
    folder: Path, table: str, change: Callable[[list[dict[str, str]]], object], found: str
) -> None:
    edit(folder, table, change)
    assert any(line.startswith(found) for line in told(folder)), told(folder)


@pytest.mark.parametrize(
    ("table", "change", "says"),
    [
        ("ticks", {"tick": "-1"}, "tick is '-1', must be a whole number, at least 0"),
        ("ticks", {"entropy": "nan"}, "entropy is 'nan', must be a number"),
        ("ticks", {"p_x": "inf"}, "p_x is 'inf', must be a number"),
        ("ticks", {"blocked": "2"}, "blocked is '2', must be a whole number, at least 0 and at most 1"),
        ("ticks", {"source": "nobody"}, "source is 'nobody', must be one of user, blend, robot"),
        ("ticks", {"tick": "1"}, "participant P001, trial 1, tick 1 is there twice"),
        ("ticks", {"departure": "2.5"}, "departure is '2.5', must be a number, at least 0 and at most 2"),
        ("tasks", {"outcome": ""}, "outcome is blank, must be one of success, failure, not_run"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_on_reading(folder: Path, table: str, change: dict[str, str], says: str) -> None:
    edit(folder, table, lambda rows: rows[0].update(change))
    with pytest.raises(ExportError, match=rf"{table}\.csv:[23]: ") as refused:
        read_table(folder, table)
    assert says in str(refused.value)


def test_a_missing_file_and_missing_checksums_are_named(folder: Path) -> None:
    (folder / "codebook.csv").unlink()
    assert told(folder) == ["codebook.csv: is missing"]
    (folder / "SHA256SUMS").unlink()
    assert told(folder) == ["SHA256SUMS: is missing: nothing says what the files were"]


def test_a_changed_line_of_the_checksums_is_told_apart_from_a_changed_file(folder: Path) -> None:
    sums = folder / "SHA256SUMS"
    text = sums.read_text()
    sums.write_text(text.replace(text[:4], "0000", 1))
    (finding,) = verify_export(folder).findings
    assert finding == Finding("SHA256SUMS", "line 1 is changed: alerts.csv is as described elsewhere")


def test_an_export_of_before_says_that_it_has_no_chain(tmp_path: Path) -> None:
    verdict = verify_export(recorded_export("kinematic", tmp_path))
    assert verdict.findings == ()
    assert verdict.notes == ("written before there was a chain: rows can be compared with checksums alone",)


def test_the_analysis_refuses_what_was_changed_with_one_line(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(folder, "tasks", lambda rows: rows[0].update(reason="none"))
    status, _, error = run(capsys, "analyze", str(folder), "--out", str(tmp_path / "report"))
    assert status == 1 and error.count("\n") == 1
    assert "changed since the export: tasks.csv" in error and "--changed" in error
    status, _, error = run(capsys, "analyze", str(folder), "--out", str(tmp_path / "report"), "--changed")
    assert "changed since" not in error  # what follows is about the data
    status, said, _ = run(capsys, "verify", str(folder))
    assert status == 1 and "tasks of P001, trial 1, task 1: column reason is not as recorded" in said
    status, _, error = run(capsys, "verify")
    assert status == 1 and "Name an export" in error


def summed_again(folder: Path) -> None:
    """`SHA256SUMS` made anew of the files as they are."""
    names = [line.partition("  ")[2] for line in (folder / SUMS_NAME).read_text().splitlines()]
    (folder / SUMS_NAME).write_text(sums_of({name: digest(folder / name) for name in names}))


@pytest.mark.parametrize("name", ["codebook.csv", "meta.json", "questionnaires.json", "ticks.parquet"])
def test_a_change_whose_checksum_was_made_anew_is_found(folder: Path, name: str) -> None:
    raw = (folder / name).read_bytes()
    at = raw.index(b"participant") if b"participant" in raw else raw.index(b"item")
    (folder / name).write_bytes(raw[:at] + raw[at : at + 4].upper() + raw[at + 4 :])
    summed_again(folder)
    assert f"{name}: is not the file that is described elsewhere, though its checksum fits" in told(folder)
    with pytest.raises(ExportError, match=f"changed since the export: {name}"):
        refuse_changed(folder)


@pytest.mark.parametrize("name", ["ticks.csv", "meta.json", "study.toml", "datapackage.json"])
def test_a_file_without_a_checksum_is_named(folder: Path, name: str) -> None:
    lines = (folder / SUMS_NAME).read_text().splitlines(keepends=True)
    (folder / SUMS_NAME).write_text("".join(line for line in lines if not line.endswith(f"  {name}\n")))
    assert told(folder) == [f"SHA256SUMS: has no line of {name}"]
    with pytest.raises(ExportError, match="changed since the export: SHA256SUMS"):
        refuse_changed(folder)


def test_checksums_that_were_emptied_say_nothing_is_as_it_was(folder: Path) -> None:
    (folder / SUMS_NAME).write_text("")
    (folder / "codebook.csv").unlink()
    found = told(folder)
    assert "codebook.csv: is missing, and its checksum" in found and "SHA256SUMS: has no line of ticks.csv" in found


def test_no_word_in_the_meta_file_hides_the_chain_or_ends_the_look(folder: Path) -> None:
    meta = json.loads((folder / "meta.json").read_text())
    del meta["rows"]["chain"]
    (folder / "meta.json").write_text(json.dumps({**meta, "studies": None}))
    edit(folder, "survey_answers", lambda rows: rows[0].update(value="7"))
    found = told(folder)
    assert any(line.startswith("survey_answers of P001, row 1: column value is not as") for line in found), found
    assert "meta.json: studies is 'None', must be a list of hashes" in found
