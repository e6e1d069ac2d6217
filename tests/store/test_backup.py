"""A copy made while a lab runs holds what was acknowledged, belongs to its owner, and becomes a data folder again."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from study.flow.flow import FLOW
from study.store import Batch, DataPlace, Store, StoreError, back_up, open_store, restore, verify_data
from tests.store.test_verification import WHO, fill
from tests.support.data_places import changed_in, typed_options
from tests.support.study_samples import UTC, append_tick, shipped_study, tick_row
from tests.support.typed_command import run


@pytest.fixture
def store(place: DataPlace) -> Iterator[Store]:
    with open_store(place, exclusive=True) as opened:
        fill(opened)
        yield opened


def test_what_was_acknowledged_last_is_in_a_backup_made_while_the_lab_runs(
    store: Store, place: DataPlace, tmp_path: Path
) -> None:
    append_tick(store, tick_row(WHO, tick=77))
    (place.folder / "lab.key").write_text("key")
    verdict = back_up(place, tmp_path / "copy", UTC)
    assert not verdict.findings and verdict.participants == 2
    append_tick(store, tick_row(WHO, tick=78))  # the lab goes on
    assert {path.name for path in (tmp_path / "copy").iterdir()} == {
        "lab.sqlite", "lab.key", f"study-{shipped_study().hash[:12]}.toml", "backup.json", "SHA256SUMS",
    }  # fmt: skip
    for path in (tmp_path / "copy", *(tmp_path / "copy").iterdir()):
        assert path.stat().st_mode & 0o077 == 0, path
    restored = restore(tmp_path / "copy", tmp_path / "again")
    assert restored == verdict
    assert (tmp_path / "again" / "lab.key").read_text() == "key"
    with open_store(tmp_path / "again", exclusive=True) as again:
        assert [row.tick for row in again.rows_of("ticks", WHO)] == [*range(30), 77]
        append_tick(again, tick_row(WHO, tick=78))  # and so can it
    assert not verify_data(tmp_path / "again").findings


def test_a_changed_backup_is_refused_and_nothing_is_made(store: Store, place: DataPlace, tmp_path: Path) -> None:
    back_up(place, tmp_path / "copy", UTC)
    raw = bytearray((tmp_path / "copy" / "lab.sqlite").read_bytes())
    raw[-1] ^= 1  # wherever it is, in free space too
    (tmp_path / "copy" / "lab.sqlite").write_bytes(raw)
    with pytest.raises(StoreError, match=r"changed since the backup: lab\.sqlite; nothing was restored"):
        restore(tmp_path / "copy", tmp_path / "again")
    assert not (tmp_path / "again").exists()


@pytest.mark.parametrize("left", ["", "lab.sqlite", "backup.json"])
def test_a_backup_whose_checksums_are_cut_off_is_refused(
    store: Store, place: DataPlace, tmp_path: Path, left: str
) -> None:
    back_up(place, tmp_path / "copy", UTC)
    sums = tmp_path / "copy" / "SHA256SUMS"
    lines = sums.read_text().splitlines(keepends=True)
    sums.write_text("".join(line for line in lines if left and line.endswith(f"  {left}\n")))
    with pytest.raises(StoreError, match="changed since the backup: SHA256SUMS; nothing was restored"):
        restore(tmp_path / "copy", tmp_path / "again")
    assert not (tmp_path / "again").exists()


def test_a_backup_of_changed_data_says_so_and_is_not_restored(store: Store, place: DataPlace, tmp_path: Path) -> None:
    changed_in(place, "UPDATE ticks SET digest = 'x' WHERE tick = 3 AND participant = 'P001'")
    (finding,) = back_up(place, tmp_path / "copy", UTC).findings
    assert str(finding) == "ticks of P001, trial 1, tick 3: column digest is not as recorded"
    with pytest.raises(StoreError, match=r"not as recorded: ticks of P001, trial 1, tick 3"):
        restore(tmp_path / "copy", tmp_path / "again")


def test_a_place_that_is_taken_is_refused_and_left_alone(store: Store, place: DataPlace, tmp_path: Path) -> None:
    back_up(place, tmp_path / "copy", UTC)
    with pytest.raises(StoreError, match="there already"):
        back_up(place, tmp_path / "copy", UTC)
    with pytest.raises(StoreError, match="there already"):
        restore(tmp_path / "copy", tmp_path / "data")
    assert not list(tmp_path.glob(".*unfinished"))
    (tmp_path / "empty").mkdir()
    restore(tmp_path / "copy", tmp_path / "empty")
    with pytest.raises(StoreError, match="no backup here"):
        restore(tmp_path / "data", tmp_path / "other")
    with pytest.raises(StoreError, match="no lab data here"):
        back_up(tmp_path / "absent", tmp_path / "other", UTC)


def test_after_a_phase_a_copy_of_the_file_alone_has_it(tmp_path: Path) -> None:
    with open_store(tmp_path / "data", exclusive=True) as store:
        made = store.create_participant(shipped_study(), seed=1, public_id="x", utc=UTC)
        append_tick(store, tick_row(made.participant, tick=0))
        store.commit(Batch(session=FLOW.advance(made.session, "withdraw", 1.0)[0], finished_utc=UTC))
        (tmp_path / "alone").mkdir()
        shutil.copy(store.path, tmp_path / "alone")
    with open_store(tmp_path / "alone", must_exist=True) as copy:
        assert [row.tick for row in copy.rows_of("ticks", made.participant)] == [0]
        assert copy.session(made.participant).session.state == "withdrawn"


def test_the_commands_tell_what_they_did(
    store: Store, place: DataPlace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, said, _ = run(capsys, "backup", str(tmp_path / "copy"), *typed_options(place))
    assert status == 0 and "2 participants" in said
    status, said, _ = run(capsys, "restore", str(tmp_path / "copy"), "--data", str(tmp_path / "again"))
    assert status == 0 and "as recorded" in said
    status, _, error = run(capsys, "restore", str(tmp_path / "copy"), "--data", str(tmp_path / "again"))
    assert status == 1 and error.count("\n") == 1 and "there already" in error


def test_a_backup_in_the_data_folder_and_a_data_folder_in_a_backup_are_refused(
    store: Store, place: DataPlace, tmp_path: Path
) -> None:
    with pytest.raises(StoreError, match="erasing does not reach it; choose another place"):
        back_up(place, tmp_path / "data" / "backups" / "monday", UTC)
    assert not (tmp_path / "data" / "backups").exists()
    back_up(place, tmp_path / "copy", UTC)
    with pytest.raises(StoreError, match="a backup stays as it was written"):
        restore(tmp_path / "copy", tmp_path / "copy" / "data")
    assert not (tmp_path / "copy" / "data").exists()
