"""`salab reconcile` as it is typed."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from study.store import open_store
from tests.support.study_samples import UTC, shipped_study
from tests.support.typed_command import run


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Three who came over the open link and have not begun, one of them twice in the list."""
    with open_store(tmp_path / "data") as store:
        for name in ("x1", "x2", "x3"):
            store.create_participant(
                shipped_study(), seed=1, public_id=name, utc=UTC, identities={"id.PROLIFIC_PID": name, "label": name}
            )
    return tmp_path / "data"


def test_it_proposes_and_does_nothing_by_itself(data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    service, out = tmp_path / "list.csv", tmp_path / "findings.csv"
    service.write_text("\ufeffParticipant id,Status\nx1,RETURNED\nx2,ACTIVE\nx9,APPROVED\n", encoding="utf-8")
    status, told, _ = run(capsys, "reconcile", str(service), "--data", str(data), "--out", str(out))
    assert status == 0
    assert "x1  RETURNED / P001 (consent): gone at the service, and still holding a place in the lab." in told
    assert "x9  APPROVED / nobody: on the service's list, and not in the roster." in told
    assert "x3  not listed / P003 (consent)" in told
    assert "x2" not in told
    assert "places that could be freed: 2; say --apply" in told
    with out.open(encoding="utf-8", newline="") as lines:
        assert [line["kind"] for line in csv.DictReader(lines)] == [
            *("gone_there", "agrees", "unknown_here", "unknown_there"),
        ]
    with open_store(data) as store:
        assert {one.session.state for one in store.sessions()} == {"consent"}
    status, told, _ = run(capsys, "reconcile", str(service), "--data", str(data), "--apply")
    assert status == 0 and "P001: the place is free" in told and "P003: the place is free" in told
    with open_store(data) as store:
        assert [one.session.state for one in store.sessions()] == ["lapsed", "consent", "lapsed"]
        assert store.cells_held() == 1


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "cannot be read: No such file"),
        (b"a,b\nx,y\n", "no column with the id of a person is known; name one with --id-column: a, b"),
        (b"\xff\xfe\x00", "is UTF-16 text; save the file as UTF-8"),
        (b"", "holds no line beside its headings"),
    ],
)
def test_a_list_that_cannot_be_read_is_one_line(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes | None, says: str
) -> None:
    service = tmp_path / "list.csv"
    if content is not None:
        service.write_bytes(content)
    status, _, error = run(capsys, "reconcile", str(service), "--data", str(data))
    assert status != 0 and says in error and error.count("\n") == 1
