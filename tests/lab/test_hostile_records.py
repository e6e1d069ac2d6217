"""A record that nobody would have written: every event that the lab goes by, with data that cannot be, and sessions
that cannot be read. Whoever it is about can go on and be ended, and nobody else notices."""

from __future__ import annotations

import contextlib
import itertools
import sqlite3
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest

from app.lab.resuming import cycle_under_way, resumed
from app.trial.guarded_distractor import GuardedDistractor
from app.trial.setup import study_setup
from app.worker.time_limit import TimeLimit
from study.flow.quality import measure
from study.flow.recorded import READ_BACK
from study.records import EventRow
from study.store import Batch, SessionUnreadable, open_store
from study.store.database import FILE_NAME
from tests.support.dashboard_client import dashboard
from tests.support.hostile_records import HOSTILE_DATA, HOSTILE_TIMES
from tests.support.lab_server import LabServer
from tests.support.study_samples import UTC, shipped_study
from tests.support.wire_client import asked, command, events, invite, stored, visit, write_study

OLD_NAMES = ("round_trip", "step_setup", "clock_set", "arm_freed", "page_hidden", "abort", "note")


def hostile(participant: str, trial: int | None, utc: str) -> tuple[EventRow, ...]:
    """Every kind with every source, each with one of the data in turn; as a note of before, with all of them."""
    data = itertools.cycle(HOSTILE_DATA)
    kinds = {event.kind for event in READ_BACK} | {event.kind.removeprefix("page.") for event in READ_BACK}
    found = [
        EventRow(participant, trial, None, utc, kind, source, next(data))
        for kind in sorted(kinds)
        for source in ("participant", "experimenter", "lab", "robot", "nobody")
        for _ in range(3)
    ]
    noted = ['{"role": "participant"}', '{"sound": "xyz", "role": "participant"}', '{"ms": [], "role": "panel"}']
    found += [EventRow(participant, trial, 1, utc, kind, "participant", one) for kind in OLD_NAMES for one in noted]
    found += [EventRow(participant, trial, 1, when, "connected", "participant", "{}") for when in HOSTILE_TIMES]
    return tuple(found)


def test_a_record_of_hostile_events_is_read_as_if_they_were_not_there(tmp_path: Path) -> None:
    study = shipped_study()
    with open_store(tmp_path / "data") as store:
        stored_session = store.create_participant(study, seed=1, public_id="a", utc=UTC)
        who = stored_session.participant
        store.commit(Batch(events=hostile(who, 1, UTC)))
        setup = study_setup(study, False)
        where = resumed(store, stored_session, GuardedDistractor(setup.distractor.inner, TimeLimit))
        assert (where.sound, where.frees) == (None, 0)
        assert where.last_unix_s > 0
        cycle_under_way(store, who, 1, "trial")
        row = store.rows_of("events", who)
        found = measure(row, started_utc=UTC, ended_utc=UTC, missed_ticks=0, unanswered_alerts=0)
        assert (found.round_trip_ms, found.clock_set_s) == (None, ())


def damage(data: Path, *statements: tuple[str, Iterable[Any]]) -> None:
    """Write into the database as the lab never would."""
    with contextlib.closing(sqlite3.connect(data / FILE_NAME)) as file:
        for statement, values in statements:
            assert file.execute(statement, tuple(values)).rowcount == 1, statement
        file.commit()


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("session", ""),
        ("session", "{}"),
        ("session", "[" * 50_000),
        ("session", '{"participant": 1}'),
        ("condition_order", "balanced"),
        ("kind", "guest"),
        ("seed", "seven"),
    ],
)
def test_one_session_that_cannot_be_read_is_told_apart_from_the_others(tmp_path: Path, column: str, value: str) -> None:
    with open_store(tmp_path) as store:
        first, second = (
            store.create_participant(shipped_study(), seed=1, public_id=name, utc=UTC).participant for name in "ab"
        )
    damage(tmp_path, (f"UPDATE sessions SET {column} = ? WHERE participant = ?", (value, first)))
    with open_store(tmp_path) as store:
        assert [one.participant for one in store.sessions()] == [second]
        (lost,) = store.unreadable_sessions()
        assert lost.participant == first and lost.reason and not lost.lacks_page
        with pytest.raises(SessionUnreadable, match=first):
            store.session(first)
        assert store.erase(first, UTC)
        assert store.unreadable_sessions() == ()


@pytest.mark.slow
async def test_whoever_has_such_a_record_goes_on_and_nobody_else_notices(
    start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", str(write_study(tmp_path)))
    lab = start_lab(*arguments, data_dir=tmp_path / "data")
    driving, aborted, withdrawn, lost, unshown, fine = (invite(lab) for _ in range(6))
    async with visit(driving["link"]) as player:
        await player.reach_trial()
        for _ in range(3):
            await player.tick((0, 1, 0))
    for other in (aborted, withdrawn, fine):
        async with visit(other["link"]) as player:
            await player.page("consent")
    lab.close()
    with open_store(tmp_path / "data") as store:
        for one in (driving, aborted, withdrawn):
            trial = 1 if one is driving else None
            utc = store.rows_of("events", one["participant"])[-1].utc
            store.commit(Batch(events=hostile(one["participant"], trial, utc)))
        last = len(store.sessions())
    damage(
        tmp_path / "data",
        ("UPDATE sessions SET session = '?' WHERE participant = ?", (lost["participant"],)),
        ("UPDATE sessions SET created_utc = ? WHERE participant = ?", ("yesterday", unshown["participant"])),
    )
    lab = start_lab(*arguments, data_dir=tmp_path / "data")

    everybody = [one["participant"] for one in (driving, aborted, withdrawn, lost, unshown, fine)]
    shown = {line["participant"]: line for line in asked(lab, "GET", "sessions").json()}
    assert list(shown) == everybody and len(shown) == last
    assert "not a stored session" in shown[lost["participant"]]["problem"]
    assert [name for name in everybody if shown[name]["problem"]] == [lost["participant"]]
    roster = asked(lab, "GET", "roster").json()
    assert {line["participant"] for line in roster["lines"]} == set(everybody)
    assert roster["counts"]["unreadable"] == 1
    async with dashboard(lab) as desk:
        for name in everybody:
            await desk.line(name)
            await desk.watch(name)
            news = await desk.news()
            assert "problem" not in news

    async with visit(lab.base_url + urlsplit(driving["link"]).path, name="again") as player:
        await player.status("paused")
        await player.done("resume")
        await player.status("running")
        await player.tick((0, 1, 0))
        ended = await command(lab, driving["participant"], "abort_trial", "seen enough")
        assert ended.status_code == 200, ended.text
        await player.page("survey")
    with stored(lab) as store:
        (trial,) = store.rows_of("trials", driving["participant"], trial=1)
    assert trial.outcome == "aborted" and trial.quality is not None
    assert (await command(lab, aborted["participant"], "abort", "enough")).status_code == 200
    assert asked(lab, "POST", f"participants/{withdrawn['participant']}/withdraw", {}).status_code == 200
    refused = await command(lab, lost["participant"], "pause")
    assert refused.status_code == 503 and f"what is stored of {lost['participant']}" in refused.text

    reading = [
        path.replace("{participant}", driving["participant"]).removeprefix("/api/")
        for path, acts in asked_document(lab)["paths"].items()
        if "get" in acts and path.startswith("/api/")
    ]
    answers = {path: asked(lab, "GET", path).status_code for path in reading}
    assert {path: status for path, status in answers.items() if status >= 500} == {}
    erased = asked(lab, "POST", f"participants/{lost['participant']}/erase", {"confirm": lost["participant"]})
    assert erased.status_code == 200, erased.text
    assert [line["problem"] for line in asked(lab, "GET", "sessions").json()] == [None] * 5
    assert events(lab, fine["participant"], "connected")


def asked_document(lab: LabServer) -> dict[str, Any]:
    """The lab's own description of its routes."""
    document: dict[str, Any] = httpx.get(f"{lab.base_url}/openapi.json", trust_env=False, timeout=30.0).json()
    return document
