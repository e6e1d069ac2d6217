"""A changed row, a missing one, one too many, a changed link: found, and named."""

from __future__ import annotations

import random
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from study.flow.flow import FLOW
from study.store import Batch, Cycle, DataPlace, Identity, Store, Submission, migration, open_store, verify_data
from tests.support.data_places import changed_in, typed
from tests.support.postgres_server import PostgresServer
from tests.support.recordings import SCHEMAS, recorded_data
from tests.support.study_samples import (
    UTC,
    alert_row,
    answer_row,
    event_row,
    shipped_study,
    task_row,
    tick_row,
    trial_row,
)
from tests.support.typed_command import run

WHO = "P001"


def fill(store: Store) -> None:
    """Two people with something in every table that is chained, and acts after the end."""
    study = shipped_study()
    for number in (1, 2):
        tokens = {"participant": f"{number}" * 64}
        made = store.create_participant(study, seed=number, public_id=f"public{number}", utc=UTC, tokens=tokens)
        who = made.participant
        store.add_token(who, "panel", f"{number}a" * 32, UTC)
        store.add_token(who, "panel", f"{number}b" * 32, UTC, alone=True)
        store.commit(
            Batch(
                session=FLOW.advance(made.session, "withdraw", 1.0)[0],
                finished_utc=UTC,
                ticks=tuple(tick_row(who, tick=tick) for tick in range(30)),
                practice_ticks=(tick_row(who, tick=0),),
                trials=(trial_row(who),),
                tasks=(task_row(who),),
                alerts=(alert_row(who),),
                answers=(answer_row(who), answer_row(who)),
                events=(event_row(who, "one"), event_row(who, "two")),
                cycles=(Cycle(who, 1, False, 1, "{}"), Cycle(who, 1, False, 1, '{"again": 1}')),
                submission=Submission(who, "tab.1.1", {}),
                identities=(Identity(who, "label", "somebody"),),
            )
        )
        later = replace(trial_row(who), quality_override="suspect", quality_reason="-0.0")
        store.commit(Batch(trials=(later,), events=(event_row(who, "quality_override"),)))
    assert store.reject(WHO, event_row(WHO, "rejected"))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A database as a lab that has ended leaves it."""
    folder = tmp_path_factory.mktemp("recorded")
    with open_store(folder, exclusive=True) as store:
        fill(store)
    return (folder / "lab.sqlite").read_bytes()


@pytest.fixture
def data(recorded: bytes, tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "lab.sqlite").write_bytes(recorded)
    return folder


@pytest.fixture(scope="module")
def recorded_on_server(postgres: PostgresServer, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The same in a database of PostgreSQL's, by its name."""
    name = postgres.database()
    with open_store(DataPlace(tmp_path_factory.mktemp("server"), postgres.url(name)), exclusive=True) as store:
        fill(store)
    return name


@pytest.fixture
def filled(place: DataPlace, request: pytest.FixtureRequest) -> DataPlace:
    """Either, for one test."""
    if place.url is None:
        return DataPlace(request.getfixturevalue("data"))
    server: PostgresServer = request.getfixturevalue("postgres")
    like = request.getfixturevalue("recorded_on_server")
    return DataPlace(place.folder, server.url(server.database(like)))


def changed(place: DataPlace, statement: str) -> list[str]:
    """What is found after somebody did this to the database."""
    assert changed_in(place, statement) > 0
    return [str(finding) for finding in verify_data(place).findings]


def test_what_the_lab_wrote_is_as_recorded_while_it_runs_and_after(place: DataPlace) -> None:
    with open_store(place, exclusive=True) as store:
        fill(store)
        running = verify_data(place)
    verdict = verify_data(place)
    assert running == verdict
    assert verdict.findings == () and verdict.notes == ()
    assert verdict.participants == 2
    assert verdict.links > 80


@pytest.mark.parametrize(
    ("statement", "found"),
    [
        ("UPDATE ticks SET p_x = p_x + 1e-9 WHERE participant = 'P001' AND tick = 7",
         "ticks of P001, trial 1, tick 7: column p_x is not as recorded"),
        ("UPDATE trials SET outcome = 'aborted', ticks = 3 WHERE participant = 'P002'",
         "trials of P002, trial 1: columns outcome, ticks are not as recorded"),
        ("UPDATE events SET kind = 'other' WHERE kind = 'two' AND participant = 'P001'",
         "events of P001, row 2: column kind is not as recorded"),
        ("UPDATE identities SET value = 'nobody' WHERE participant = 'P002'",
         "identities of P002, row 1: is not as recorded"),
        ("UPDATE sessions SET seed = 99 WHERE participant = 'P001'", "sessions of P001: is not as recorded"),
        ("UPDATE tokens SET role = 'panel' WHERE role = 'participant' AND participant = 'P001'",
         f"tokens of P001, sha256 {'1' * 12}: is not as recorded"),
        ("UPDATE cycles SET start = '{}' WHERE participant = 'P001'",
         "cycles of P001, trial 1, practice 0, cycle 1: is not as recorded"),
        ("DELETE FROM ticks WHERE participant = 'P001' AND tick = 29",
         "ticks of P001, trial 1, tick 29: is missing; it was recorded"),
        ("DELETE FROM events WHERE kind = 'rejected'", "events of P001: has 3 rows; 4 were recorded"),
        ("INSERT INTO events SELECT 999, participant, trial, tick, utc, kind, source, data FROM events LIMIT 1",
         "events of P001, row 5: was not recorded by the lab: the chain does not have it"),
        ("UPDATE ticks SET tick = 31 WHERE tick = 29 AND participant = 'P002'",
         "ticks of P002, trial 1, tick 31: was not recorded by the lab, or is there twice: the chain does not have it"),
        ("UPDATE chain SET content = hash WHERE participant = 'P001' AND seq = 20",
         "chain of P001, link 20: its hash does not fit what it says of ticks of P001, trial 1, tick "),
        ("DELETE FROM chain WHERE participant = 'P001' AND seq = 20",
         "chain of P001, link 21: the link before it has number 19"),
        ("UPDATE studies SET text = text || ' '", "studies, "),
    ],
)  # fmt: skip
def test_what_somebody_changed_is_named(filled: DataPlace, statement: str, found: str) -> None:
    findings = changed(filled, statement)
    assert any(finding.startswith(found) for finding in findings), findings


def test_a_count_of_the_numbers_that_was_changed_is_found(filled: DataPlace) -> None:
    where = "sqlite_sequence" if filled.url is None else "meta"
    which = "" if filled.url is None else " WHERE name = 'numbers_given_out'"
    assert changed(filled, f"DELETE FROM {where}{which}") == [
        f"{where}: says that 0 numbers of participants were given out, not 2"
    ]


def test_a_row_whose_participant_is_gone_is_found(filled: DataPlace) -> None:
    findings = changed(filled, "UPDATE identities SET participant = 'P404' WHERE participant = 'P002'")
    assert any(finding.endswith("belongs to a row of sessions that is missing") for finding in findings)


def test_a_participant_who_is_gone_without_an_erasure_is_missed(filled: DataPlace) -> None:
    tables = ("ticks", "practice_ticks", "trials", "tasks", "alerts", "survey_answers", "events", "participants")
    own = ("certificates", "chain", "cycles", "submissions", "identities", "tokens", "sessions")
    changed_in(filled, *(f"DELETE FROM {table} WHERE participant = 'P002'" for table in (*tables, *own)))
    (finding,) = verify_data(filled).findings
    assert str(finding) == "sessions: participant number 2 is missing, and was not erased"


def test_an_erased_participant_leaves_a_tombstone_over_no_content(filled: DataPlace) -> None:
    with open_store(filled, exclusive=True) as store:
        store.erase("P002", UTC)
        with store.snapshot() as left:
            assert {link.participant for link in left.rows("chain")} == {WHO}
    assert verify_data(filled).findings == ()
    found = changed(filled, "UPDATE erasures SET utc = '2027-01-01T00:00:00.000Z'")
    assert "erasures, P002: the mark is not as it was made" in found


def test_later_acts_leave_what_was_so_before_provable(filled: DataPlace) -> None:
    with open_store(filled, must_exist=True) as store:
        with store.snapshot() as recorded:
            links = recorded.rows_of("chain", WHO, row_table="trials")
        (row,) = store.rows_of("trials", WHO)
    before = replace(row, quality_override=None, quality_reason=None)
    from study.integrity.content import content_of

    assert [link.content for link in links] == [content_of("trials", vars(one)) for one in (before, row)]


def test_what_no_export_holds_cannot_be_guessed_from_its_hash(filled: DataPlace) -> None:
    from study.integrity.content import content_of

    with open_store(filled, must_exist=True) as store, store.snapshot() as recorded:
        links = [recorded.rows_of("chain", who, row_table="identities") for who in ("P001", "P002")]
    guesses = {content_of("identities", {"participant": who, "kind": "label", "value": "somebody"})
               for who in ("P001", "P002")}  # fmt: skip
    assert not guesses & {link.content for found in links for link in found}


@pytest.mark.parametrize("schema", [one for one in SCHEMAS if one < migration.CHAINED_SINCE])
def test_data_of_before_get_a_chain_that_says_when_it_began(schema: str, tmp_path: Path) -> None:
    data = recorded_data("kinematic", tmp_path, schema)
    (note,) = verify_data(data).notes
    assert f"schema {schema} has no chain yet" in note
    with open_store(data, exclusive=True) as store, store.snapshot() as recorded:
        first = [recorded.rows_of("chain", who, seq=1)[0] for who in ("P001", "P002", "T004", "D005")]
    assert {link.row_table for link in first} == {"begun"}
    assert all(link.row_key.endswith(f", schema {schema}") for link in first)
    verdict = verify_data(data)
    assert not verdict.findings and not verdict.notes
    assert verdict.participants == 4
    assert migration.HEAD >= migration.CHAINED_SINCE


def test_the_command_says_what_does_not_fit_and_ends_with_status_1(
    filled: DataPlace, capsys: pytest.CaptureFixture[str]
) -> None:
    status, told, _ = run(capsys, "verify", "--data", typed(filled))
    assert status == 0 and "as recorded: 2 participants" in told
    changed(filled, "UPDATE ticks SET digest = 'x' WHERE participant = 'P002' AND tick = 3")
    status, told, _ = run(capsys, "verify", "--data", typed(filled))
    assert status == 1
    assert "ticks of P002, trial 1, tick 3: column digest is not as recorded" in told
    status, _, error = run(capsys, "verify", "--data", str(filled.folder.parent / "absent"))
    assert status == 1 and "no lab data here" in error


def flips(raw: bytes, count: int) -> Iterator[tuple[int, bytes]]:
    """The file with one bit of one byte changed, and where."""
    for seed in range(count):
        rng = random.Random(seed)
        place = rng.randrange(len(raw))
        yield place, raw[:place] + bytes([raw[place] ^ 1 << rng.randrange(8)]) + raw[place + 1 :]


def rows_in(data: Path) -> list[tuple[object, ...]] | None:
    """Every row of every table; None when they cannot be read."""
    try:
        with closing(sqlite3.connect(data / "lab.sqlite")) as connection:
            names = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
            return [row for name in names for row in connection.execute(f"SELECT * FROM {name} ORDER BY rowid")]
    except sqlite3.Error:
        return None


def test_every_flipped_bit_of_a_lab_at_rest_is_found_and_its_page_named(data: Path, tmp_path: Path) -> None:
    open_store(data, exclusive=True).close()
    raw = (data / "lab.sqlite").read_bytes()
    for place, flipped in flips(raw, 60):
        (data / "lab.sqlite").write_bytes(flipped)
        for ending in ("-wal", "-shm"):
            (data / f"lab.sqlite{ending}").unlink(missing_ok=True)
        found = [str(finding) for finding in verify_data(data).findings]
        page = rf"lab\.sqlite.*: page {place // 4096 + 1} is not as the lab left it|cannot be read"
        assert any(re.match(page, line) or "cannot be read" in line for line in found), (place, found)
    (data / "lab.sqlite").write_bytes(raw)
    assert not verify_data(data).findings


def test_a_flipped_bit_that_changes_what_is_read_is_found(recorded: bytes, tmp_path: Path) -> None:
    found = 0
    (tmp_path / "whole").mkdir()
    (tmp_path / "whole" / "lab.sqlite").write_bytes(recorded)
    whole = rows_in(tmp_path / "whole")
    for place, raw in flips(recorded, 60):
        data = tmp_path / str(place)
        data.mkdir()
        (data / "lab.sqlite").write_bytes(raw)
        findings = verify_data(data).findings
        found += bool(findings)
        assert findings or rows_in(data) == whole, place
    assert found > 10
