"""A certificate says what was acknowledged, what is stored and where the chain ended; whoever changes it is found."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from study.export.export import export
from study.export.verification import verify_export
from study.flow.flow import FLOW
from study.integrity.certificate import state_of
from study.integrity.signing import KEY_NAME, key_problem, public_key
from study.records import CertificateRow, EventRow
from study.store import Batch, DataPlace, Store, Submission, open_store, verify_data
from tests.support.data_places import changed_in, typed
from tests.support.study_samples import UTC, answer_row, shipped_study, tick_row, trial_row
from tests.support.typed_command import run


@pytest.fixture
def store(place: DataPlace) -> Iterator[Store]:
    with open_store(place, exclusive=True) as opened:
        yield opened


def session(store: Store, *, ticks: int = 5, messages: int = 3) -> str:
    """Somebody who drove, answered and withdrew; the last of their messages ended them."""
    made = store.create_participant(shipped_study(), seed=1, public_id="x", utc=UTC)
    who = made.participant
    store.commit(
        Batch(
            trials=(trial_row(who),),
            ticks=tuple(tick_row(who, n) for n in range(ticks)),
            practice_ticks=(tick_row(who, 0),),
        )
    )
    for number in range(messages):
        store.commit(Batch(answers=(answer_row(who),), submission=Submission(who, f"tab.1.{number}")))
    refused = {"code": "invalid", "problems": [["data", "no"]]}
    store.commit(Batch(submission=Submission(who, "tab.1.refused", refused)))
    ended = FLOW.advance(made.session, "withdraw", 1.0)[0]
    store.commit(Batch(session=ended, finished_utc=UTC, submission=Submission(who, "tab.1.last")))
    return who


def report(store: Store, who: str, client: str = "tab", **counts: Any) -> None:
    data = json.dumps({"acknowledged": 4, "ticks": {"trial 1": 5, "practice 1": 1}, "client": client, **counts})
    event = EventRow(who, None, None, UTC, "page.received", "participant", data)
    store.commit(Batch(events=(event,), submission=Submission(who, f"{client}.1.report")))


def certified(store: Store) -> CertificateRow:
    (row,) = store.rows("certificates")
    assert isinstance(row, CertificateRow)
    return row


def test_who_ends_is_certified_and_a_report_of_their_page_completes_it(
    store: Store, place: DataPlace, tmp_path: Path
) -> None:
    who = session(store)
    first = certified(store)
    assert (first.ticks, first.practice_ticks, first.answers, first.messages) == (5, 1, 3, 4)
    assert state_of(first) == "unconfirmed"
    report(store, who)
    second = certified(store)
    assert (second.told_ticks, second.told_messages, second.messages) == (6, 4, 4)
    assert state_of(second) == "complete"
    assert second.links > first.links and second.key == first.key
    assert (place.folder / "lab.key").stat().st_mode & 0o077 == 0
    assert not verify_data(place).findings
    export(store, tmp_path / "export")
    assert not verify_export(tmp_path / "export").findings


@pytest.mark.parametrize(
    ("counts", "state"),
    [({"acknowledged": 3}, "less"), ({"ticks": {"trial 1": 4, "practice 1": 1}}, "less"),
     ({"acknowledged": 5}, "more"), ({"ticks": {"trial 1": 6, "practice 1": 1}}, "more")],
)  # fmt: skip
def test_pages_that_were_told_of_less_or_of_more_than_is_stored(
    store: Store, place: DataPlace, tmp_path: Path, counts: dict[str, Any], state: str
) -> None:
    report(store, session(store), **counts)
    assert state_of(certified(store)) == state
    found = [str(finding) for finding in verify_data(place).findings]
    assert found == (["certificate of P001: pages were told that more is saved than is stored"] * (state == "more"))


def test_reports_of_two_tabs_count_together(store: Store) -> None:
    who = session(store)
    report(store, who, "tab", acknowledged=3, ticks={"practice 1": 1, "trial 1": 2})
    report(store, who, "other", acknowledged=1, ticks={"trial 1": 5})
    assert state_of(certified(store)) == "complete"


def test_nobody_is_certified_before_they_end(store: Store) -> None:
    who = store.create_participant(shipped_study(), seed=1, public_id="x", utc=UTC).participant
    report(store, who)
    assert not list(store.rows("certificates"))


def test_later_acts_leave_the_certificate_valid(store: Store, place: DataPlace, tmp_path: Path) -> None:
    who = session(store)
    store.reject(who, EventRow(who, None, None, UTC, "rejected", "experimenter", "{}"))
    assert not verify_data(place).findings


@pytest.mark.parametrize(
    "statement",
    ["UPDATE certificates SET ticks = 4", "UPDATE certificates SET head = substr(head, 2) || '0'",
     "UPDATE certificates SET signature = substr(signature, 3) || '00'"],
)  # fmt: skip
def test_a_changed_certificate_is_found(store: Store, place: DataPlace, statement: str) -> None:
    session(store)
    changed_in(place, statement)
    found = [str(finding) for finding in verify_data(place).findings]
    assert "certificate of P001: its signature does not fit what it says" in found


def test_a_key_that_cannot_be_used_keeps_nobody_from_ending_and_is_told(
    store: Store, place: DataPlace, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (place.folder / "lab.key").write_text("no key")
    assert store.session(session(store)).session.state == "withdrawn"
    assert not list(store.rows("certificates"))
    assert "participant P001 has no certificate: the data folder's key cannot be used" in caplog.text


def test_the_command_prints_what_to_keep_elsewhere(
    store: Store, place: DataPlace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report(store, session(store))
    store.create_participant(shipped_study(), seed=2, public_id="y", utc=UTC)
    status, said, _ = run(capsys, "certificate", "--data", typed(place))
    first, second, key, everything = said.splitlines()
    with store.snapshot() as recorded:
        heads = recorded.heads()
    assert status == 0
    assert first.startswith("P001") and heads["P001"].hash in first and "complete, signed at link" in first
    assert second.startswith("P002") and second.endswith("no certificate")
    assert certified(store).key in key and everything.startswith("all       2  ")


def test_a_key_that_cannot_be_used_is_told(tmp_path: Path) -> None:
    assert key_problem(tmp_path) == ""  # it is made when it is needed
    public_key(tmp_path)
    assert key_problem(tmp_path) == ""
    for damaged in ("", "garbage", "00"):
        (tmp_path / KEY_NAME).write_text(damaged)
        assert str(tmp_path / KEY_NAME) in key_problem(tmp_path)
