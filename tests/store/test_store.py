"""The store: what is acknowledged is on disk, what is refused leaves nothing behind, who is who stays apart."""

from __future__ import annotations

import asyncio
import hashlib
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from study.definition.study import orders
from study.flow.flow import FLOW
from study.records import SCHEMA_VERSION, TABLES, StudyError
from study.store import (
    AsyncStore,
    Batch,
    ConsentGiven,
    Cycle,
    DataPlace,
    Identity,
    Store,
    StoredSession,
    StoreError,
    Submission,
    machine_fingerprint,
    open_store,
)
from study.store.database import FILE_NAME
from tests.support.study_samples import (
    UTC,
    alert_row,
    answer_row,
    append_tick,
    event_row,
    shipped_study,
    task_row,
    tick_row,
    trial_row,
)

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture
def store(place: DataPlace) -> Iterator[Store]:
    with open_store(place) as opened:
        yield opened


@pytest.fixture
def file_store(tmp_path: Path) -> Iterator[Store]:
    """One whose file is looked at."""
    with open_store(tmp_path / "data") as opened:
        yield opened


def enrol(store: Store, **options: Any) -> StoredSession:
    with store.snapshot() as recorded:
        number = len(store.sessions()) + len(recorded.erasures())
    return store.create_participant(shipped_study(), seed=number, public_id=f"public{number}", utc=UTC, **options)


def reopened(store: Store, place: DataPlace) -> Store:
    store.close()
    return open_store(place)


# ---- enrolment


def test_participants_fill_the_orders_evenly_and_pilots_and_demos_take_no_cell(store: Store) -> None:
    for number in range(24):
        enrol(store, kind=("demo", "study", "study", "pilot")[number % 4])
    real = [session for session in store.sessions() if session.kind == "study"]
    assert Counter(session.order for session in real) == dict.fromkeys(orders(shipped_study()), 2)
    assert len({session.participant for session in store.sessions()}) == 24
    letters = {session.kind: session.participant[0] for session in store.sessions()}
    assert letters == {"study": "P", "pilot": "T", "demo": "D"}


@pytest.mark.parametrize("leave", ["withdraw", "abort", "reject", "erase"])
def test_the_cell_of_whoever_leaves_is_given_out_again(store: Store, leave: str) -> None:
    first = enrol(store)
    assert enrol(store).order != first.order
    if leave == "reject":
        assert store.reject(first.participant, event_row(first.participant, "rejected"))
        assert not store.reject(first.participant, event_row(first.participant, "rejected"))  # once
        assert [row.kind for row in store.rows("events")] == ["rejected"]
        assert store.session(first.participant).rejected
    elif leave == "erase":
        store.erase(first.participant, UTC)
    else:
        store.commit(Batch(session=FLOW.advance(first.session, leave, 1.0)[0], finished_utc=UTC))
    assert enrol(store).order == first.order


def test_a_given_order_is_taken_and_a_wrong_one_refused(store: Store) -> None:
    order = orders(shipped_study())[4]
    assert enrol(store, order=order).order == order
    with pytest.raises(StudyError, match="not a permutation"):
        enrol(store, order=("balanced",))
    assert len(store.sessions()) == 1


def test_a_token_is_found_by_its_hash_alone(store: Store) -> None:
    sha256 = hashlib.sha256(b"a secret of 128 bits").hexdigest()
    session = enrol(store, tokens={"participant": sha256})
    store.add_token(session.participant, "panel", "f" * 64, UTC)
    assert store.participant_for_token(sha256) == (session.participant, "participant")
    assert store.participant_for_token("f" * 64) == (session.participant, "panel")
    assert store.participant_for_token("0" * 64) is None
    with pytest.raises(StoreError):
        enrol(store, tokens={"participant": sha256})
    assert len(store.sessions()) == 1  # the refused one left nothing


def test_a_session_comes_back_as_it_was(store: Store, place: DataPlace) -> None:
    session = enrol(store, pace="lockstep")
    later, _ = FLOW.advance(session.session, "consent_given", 5.0)
    store.commit(Batch(session=later, consent=ConsentGiven(UTC, "c" * 64)))
    store = reopened(store, place)
    found = store.session(session.participant)
    assert (found.public_id, found.session, found.pace, found.order, found.seed) == (
        session.public_id,
        later,
        "lockstep",
        session.order,
        session.seed,
    )
    row = next(store.rows("participants"))
    assert (row.state, row.consent_hash, row.consent_utc, row.finished_utc) == ("demographics", "c" * 64, UTC, None)
    assert row.condition_order.split(">") == list(session.order)
    with pytest.raises(StoreError, match="no participant 'P999'"):
        store.session("P999")
    store.close()


# ---- rows


def test_every_row_comes_back_bit_for_bit(store: Store, place: DataPlace) -> None:
    who = enrol(store).participant
    rows: dict[str, Any] = {
        "ticks": [tick_row(who, 0), tick_row(who, 1, p_x=1 / 3, task=None, kind=None, goal=None, user_x=None)],
        "practice_ticks": [tick_row(who, 0, source="idle")],
        "trials": [trial_row(who)],
        "tasks": [task_row(who, 1), task_row(who, 2, outcome="not_run", reason="no object", first_tick=None)],
        "alerts": [alert_row(who, 1, answer="482,1", correct=1)],
        "answers": [answer_row(who, "effort"), answer_row(who, "comments", "two\nlines, and “quotes”")],
        "events": [event_row(who, "b"), event_row(who, "a", trial=None, tick=None)],
    }
    store.commit(Batch(**rows))
    store = reopened(store, place)
    for name, expected in rows.items():
        assert list(store.rows("survey_answers" if name == "answers" else name)) == expected
    store.close()


def test_numbers_of_numpy_are_stored_as_numbers(store: Store) -> None:
    who = enrol(store).participant
    append_tick(store, tick_row(who, tick=np.int64(4), p_x=np.float64(0.1), blocked=np.bool_(True)))
    row = next(store.rows("ticks"))
    assert (row.tick, row.p_x, row.blocked) == (4, 0.1, 1)
    assert [type(value) for value in (row.tick, row.p_x, row.blocked)] == [int, float, int]


def test_text_that_no_file_can_hold_is_made_harmless(store: Store) -> None:
    who = enrol(store, identities={"note": "a\ud800b"}).participant
    store.commit(
        Batch(
            answers=(answer_row(who, "comments", "half \udc00 pair\0!"),),
            identities=(Identity(who, "remark", "c\udc00d"),),
        )
    )
    assert next(store.rows("survey_answers")).value == "half ? pair!"
    assert store.identities(who) == (("note", "a?b"), ("remark", "c?d"))


def test_a_tick_and_what_happened_in_it_are_written_together_or_not_at_all(store: Store) -> None:
    who = enrol(store).participant
    append_tick(store, tick_row(who, 0), tasks=[task_row(who)], events=[event_row(who)], alerts=[alert_row(who)])
    with pytest.raises(StoreError):
        append_tick(store, tick_row(who, 0), tasks=[task_row(who, 2)], events=[event_row(who)])
    assert [len(list(store.rows(table))) for table in ("ticks", "tasks", "events", "alerts")] == [1, 1, 1, 1]
    with pytest.raises(StoreError):
        append_tick(store, tick_row(who, 1, entropy=float("nan")), events=[event_row(who)])
    with pytest.raises(StoreError):
        append_tick(store, tick_row("P404", 1))
    assert [len(list(store.rows(table))) for table in ("ticks", "events")] == [1, 1]


def test_practice_and_trial_ticks_are_apart(store: Store) -> None:
    who = enrol(store).participant
    append_tick(store, tick_row(who, 0), practice=True)
    append_tick(store, tick_row(who, 0, cycle=2))
    assert len(list(store.rows("ticks"))) == len(list(store.rows("practice_ticks"))) == 1


def test_what_is_under_way_is_replaced_by_what_became_of_it(store: Store) -> None:
    who = enrol(store).participant
    store.commit(Batch(alerts=(alert_row(who),), trials=(trial_row(who),)))
    store.commit(
        Batch(alerts=(alert_row(who, status="expired"),), trials=(trial_row(who, ticks=9, outcome="completed"),))
    )
    assert [row.status for row in store.rows("alerts")] == ["expired"]
    assert [(row.ticks, row.outcome) for row in store.rows("trials")] == [(9, "completed")]


def test_the_same_message_counts_once(store: Store) -> None:
    who = enrol(store).participant
    other = enrol(store).participant
    assert store.response(who, "m1") is None
    assert store.commit(Batch(submission=Submission(who, "m1", {"ok": 1}), answers=(answer_row(who),)))
    assert not store.commit(Batch(submission=Submission(who, "m1", {"ok": 2}), answers=(answer_row(who),)))
    assert store.response(who, "m1") == {"ok": 1}
    assert len(list(store.rows("survey_answers"))) == 1
    assert store.commit(Batch(submission=Submission(other, "m1", {"ok": 3})))  # ids are each participant's own


def test_a_cycle_can_be_run_again(store: Store) -> None:
    who = enrol(store).participant
    for number, cycle in enumerate((1, 1, 2, 2, 2)):
        start = [Cycle(who, 1, False, cycle, f'{{"cycle": {cycle}}}')] if number in (0, 2) else []
        append_tick(store, tick_row(who, number, cycle=cycle), cycles=start)
    assert store.last_cycle(who, 1) == Cycle(who, 1, False, 2, '{"cycle": 2}')
    assert [row.tick for row in store.ticks_of_attempt(who, 1, 2, 1)] == [2, 3, 4]
    assert store.last_cycle(who, 1, practice=True) is None
    assert store.ticks_of_attempt(who, 1, 2, 1, practice=True) == ()


def test_the_last_input_taken_into_account_is_known(store: Store) -> None:
    who = enrol(store).participant
    assert store.last_input_seq(who) == 0
    append_tick(store, tick_row(who, 0, input_seq=41), practice=True)
    append_tick(store, tick_row(who, 0, input_seq=None))
    assert store.last_input_seq(who) == 41
    append_tick(store, tick_row(who, 1, input_seq=57))
    assert store.last_input_seq(who) == 57


def test_demo_and_pilot_rows_are_read_only_when_asked_for(store: Store) -> None:
    for kind in ("demo", "study", "pilot"):
        append_tick(store, tick_row(enrol(store, kind=kind).participant))
    assert [row.participant[0] for row in store.rows("ticks")] == ["P"]
    assert [row.participant[0] for row in store.rows("ticks", include_demo=True)] == ["D", "P"]
    assert [row.participant[0] for row in store.rows("ticks", include_pilot=True)] == ["P", "T"]
    assert [row.kind for row in store.rows("participants", True, True)] == ["demo", "study", "pilot"]
    with pytest.raises(StudyError, match="tables are"):
        list(store.rows("identities"))


def test_erasing_leaves_a_mark_without_content(store: Store, place: DataPlace) -> None:
    secret = "recruited-through-the-dentist"
    gone = enrol(store, identities={"recruited": secret}, tokens={"participant": "a" * 64}).participant
    stays = enrol(store).participant
    for who in (gone, stays):
        store.commit(
            Batch(ticks=(tick_row(who),), answers=(answer_row(who, "comments", secret),) if who == gone else ())
        )
    assert store.erase(gone, UTC) is (True if place.url is None else None)
    found = [(table, row.participant) for table in TABLES for row in store.rows(table)]
    assert {who for _, who in found} == {stays}
    assert [table for table, _ in found if table != "chain"] == ["participants", "ticks"]
    assert store.participant_for_token("a" * 64) is None
    with store.snapshot() as recorded:
        assert recorded.erasures() == ((gone, UTC),)
    store.close()
    for file in place.folder.iterdir() if place.url is None else ():
        assert secret.encode() not in file.read_bytes(), file.name
    with open_store(place) as again:
        assert enrol(again).participant not in (gone, stays)


def test_a_snapshot_does_not_see_what_comes_later(store: Store) -> None:
    who = enrol(store).participant
    append_tick(store, tick_row(who, 0))
    with store.snapshot() as recorded:
        assert len(list(recorded.rows("ticks"))) == 1
        append_tick(store, tick_row(who, 1), events=[event_row(who)])
        assert len(list(recorded.rows("ticks"))) == 1
        assert list(recorded.rows("events")) == []


# ---- the file


def test_the_file_is_durable_and_says_what_it_is(file_store: Store) -> None:
    with file_store._database.read() as connection:
        settings = [
            connection.exec_driver_sql(f"PRAGMA {name}").scalar()
            for name in ("journal_mode", "synchronous", "foreign_keys")
        ]
    assert settings == ["wal", 2, 1]  # 2 is FULL
    with file_store.snapshot() as recorded:
        assert recorded.machines() == (machine_fingerprint(),)
    assert {"python", "numpy", "cpu", "blas", "pybullet", "mujoco", "viser", "app"} <= set(machine_fingerprint())


def test_another_schema_version_is_refused(file_store: Store) -> None:
    file_store.close()
    with sqlite3.connect(file_store.path) as connection:
        connection.execute("UPDATE meta SET value = '99' WHERE name = 'schema_version'")
    connection.close()
    with pytest.raises(StoreError, match=f"schema_version is 99, this version of the lab needs {SCHEMA_VERSION}"):
        open_store(file_store.path.parent)


@pytest.mark.parametrize("options", [{"must_exist": True}, {"exclusive": True}, {}])
def test_a_copy_that_lacks_its_log_is_not_taken_for_a_new_lab(tmp_path: Path, options: dict[str, Any]) -> None:
    with open_store(tmp_path / "running", exclusive=True) as store:
        enrol(store)
        (tmp_path / "copy").mkdir()
        shutil.copy(store.path, tmp_path / "copy")
    before = (tmp_path / "copy" / FILE_NAME).read_bytes()
    with pytest.raises(StoreError, match=r"no lab data here, .* file beside it that ends in -wal"):
        open_store(tmp_path / "copy", **options)
    assert (tmp_path / "copy" / FILE_NAME).read_bytes() == before


def test_a_foreign_database_is_refused(tmp_path: Path) -> None:
    connection = sqlite3.connect(tmp_path / FILE_NAME)
    connection.execute("CREATE TABLE recipes (name TEXT)")
    connection.commit()
    connection.close()
    with pytest.raises(StoreError, match="not one of this lab"):
        open_store(tmp_path)


@pytest.mark.parametrize("damage", ["not_sqlite", "overwritten"])
def test_a_damaged_file_is_one_clear_line(file_store: Store, damage: str) -> None:
    who = enrol(file_store).participant
    file_store.commit(Batch(ticks=tuple(tick_row(who, number) for number in range(200))))
    file_store.close()
    content = bytearray(file_store.path.read_bytes())
    if damage == "not_sqlite":
        content[:100] = b"x" * 100
    else:
        content[8192:] = os.urandom(len(content) - 8192)
    file_store.path.write_bytes(content)
    with pytest.raises(StoreError) as caught:
        open_store(file_store.path.parent)
    assert str(file_store.path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_folder_that_cannot_be_used_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be used as data folder"):
        open_store(tmp_path / "file" / "data")
    with pytest.raises(StoreError, match=r"no lab data here \(lab\.sqlite is missing\)"):
        open_store(tmp_path / "nothing", must_exist=True)
    assert not (tmp_path / "nothing").exists()
    (tmp_path / FILE_NAME).touch()
    with pytest.raises(StoreError, match="the database is empty"):
        open_store(tmp_path, must_exist=True)


def test_a_database_that_cannot_be_opened_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).mkdir()
    with pytest.raises(StoreError, match="is no regular file"):
        open_store(tmp_path)


def test_two_labs_cannot_serve_the_same_data_but_an_export_may_read_it(place: DataPlace) -> None:
    with open_store(place, exclusive=True):
        with pytest.raises(StoreError, match="another lab is running"):
            open_store(place, exclusive=True)
        with open_store(place, must_exist=True) as reader:
            assert reader.sessions() == ()
    open_store(place, exclusive=True).close()


def test_an_export_waits_for_no_writer_and_holds_none_up(place: DataPlace) -> None:
    with open_store(place, exclusive=True) as serving:
        who = enrol(serving).participant
        with serving._database.write(), open_store(place, must_exist=True) as reader:  # a write is under way
            assert len(reader.sessions()) == 1
        with open_store(place, must_exist=True) as reader, reader.snapshot():
            append_tick(serving, tick_row(who))


def test_a_killed_lab_has_every_acknowledged_tick(place: DataPlace) -> None:
    with open_store(place) as store:
        who = enrol(store).participant
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.support.store_writer", str(place.folder), who],
        cwd=REPOSITORY,
        env={**os.environ, **place.environment},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    acknowledged = [int(process.stdout.readline()) for _ in range(25)]
    os.kill(process.pid, signal.SIGKILL)
    acknowledged += [int(line) for line in process.stdout.read().splitlines()]
    process.stdout.close()
    assert process.wait() == -signal.SIGKILL
    with open_store(place, exclusive=True) as store:
        kept = [row.tick for row in store.rows("ticks")]
    assert kept[: len(acknowledged)] == acknowledged == list(range(len(acknowledged)))
    assert len(kept) - len(acknowledged) in (0, 1)  # at most the one that was not acknowledged yet


# ---- from asyncio


async def test_writes_happen_in_the_order_asked_even_for_one_who_left(place: DataPlace) -> None:
    store = AsyncStore(open_store(place))
    who = (await store.run(lambda opened: enrol(opened))).participant

    def write(number: int) -> Callable[[Store], None]:
        return lambda opened: append_tick(opened, tick_row(who, number))

    waiting = [asyncio.ensure_future(store.run(write(number))) for number in range(20)]
    await asyncio.sleep(0)  # let every task hand its write over
    waiting[19].cancel()
    await asyncio.gather(*waiting, return_exceptions=True)
    ticks = await store.run(lambda opened: [row.tick for row in opened.rows("ticks")])
    assert ticks == list(range(20))
    with pytest.raises(StoreError):
        await store.run(lambda opened: append_tick(opened, tick_row(who, 3)))
    await store.close()
