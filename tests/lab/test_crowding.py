"""Who is counted as taking part, when the dashboard warns, and whom the open link lets in."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.config import LabConfig
from app.lab.crowding import COMES_WITHIN_S, Crowding, Doorkeeper, takes_room
from app.lab.lab import Lab
from app.lab.open_enrolment import Offer, OpenEnrolment
from app.sizing import capacity
from app.sizing.machine import machine
from study.flow.protocol import Event
from study.store import Batch, Store
from tests.support.wire_client import write_study


def live(state: str = "trial", **changes: Any) -> Any:
    """As much of a live session as is counted."""
    given: dict[str, Any] = {"participant": "P001", "pace": "real_time", "worker": False, "page": False} | changes
    return SimpleNamespace(
        enrolment=SimpleNamespace(participant=given["participant"], pace=given["pace"]),
        session=SimpleNamespace(is_over=state in ("done", "withdrawn"), place=state),
        has_worker=given["worker"],
        connected=given["page"],
    )


@pytest.mark.parametrize(
    ("session", "counts"),
    [
        (live("trial", worker=True, page=True), True),
        (live("trial", worker=True), True),  # they may be back in a moment
        (live("survey"), True),
        (live("survey", page=True), True),
        (live("consent", page=True), True),
        (live("eligibility", page=True), True),
        (live("consent"), False),  # they closed the tab
        (live("done", page=True), False),
        (live("withdrawn"), False),
        (live("trial", worker=True, page=True, pace="lockstep"), False),
    ],
)
def test_whoever_keeps_the_machine_busy_is_counted(session: Any, counts: bool) -> None:
    assert takes_room(session) is counts


@pytest.mark.parametrize(
    ("running", "most", "level", "has_room"),
    [
        (500, None, "well", True),
        (0, 10, "well", True),
        (7, 10, "well", True),
        (8, 10, "near", True),
        (9, 10, "near", True),
        (10, 10, "full", False),
        (11, 10, "beyond", False),
        (0, 1, "well", True),
        (1, 1, "full", False),
    ],
)
def test_the_dashboard_is_told_before_it_is_full(running: int, most: int | None, level: str, has_room: bool) -> None:
    found = Crowding(running, most)
    assert (found.level, found.has_room) == (level, has_room)
    assert bool(found.text) is (level != "well")
    if level != "well":
        assert str(running) in found.text and ("asks others to come back" in found.text) is not has_room


def test_whoever_is_on_their_way_has_room_until_they_are_there_or_stay_away() -> None:
    sessions: list[Any] = []
    now_s = [100.0]
    door = Doorkeeper(2, lambda: sessions, lambda: now_s[0])
    door.let_in("P001")
    door.let_in("P001")
    assert door.crowding() == Crowding(1, 2)
    sessions.append(live("consent", page=True))
    assert door.crowding() == Crowding(1, 2), "nobody is counted twice"
    door.let_in("P002")
    assert not door.crowding().has_room
    now_s[0] += COMES_WITHIN_S
    assert door.crowding() == Crowding(1, 2)


RECRUITING = {
    "open = false ": "open = true ",
    "quota = 0 ": "quota = 3\nplace_lapses_min = 30 ",
    "practice = true ": "practice = false ",
}


@pytest.fixture
async def lab(tmp_path: Path) -> AsyncIterator[Lab]:
    """A lab that recruits three people, and takes one at once; it looks after nothing by itself."""
    study = write_study(tmp_path, RECRUITING)
    made = Lab(LabConfig(data_dir=tmp_path / "data", study_file=study, robot="kinematic", scene=False, capacity=1))
    made.prepare()
    yield made
    await made.close()


async def join(lab: Lab, person: str, token: str = "") -> Offer:
    return await OpenEnrolment(lab).join({"PROLIFIC_PID": [person]}, token)


async def looked(lab: Lab, person: str, token: str = "") -> str:
    return (await OpenEnrolment(lab).look({"PROLIFIC_PID": [person]}, token)).answer


async def held(lab: Lab) -> int:
    return await lab.store.read(lambda store: store.cells_held())


async def test_who_is_asked_to_come_back_takes_no_place_and_gets_one_when_there_is_room(lab: Lab) -> None:
    assert await looked(lab, "ann") == "enrol"
    first = await join(lab, "ann")
    assert (first.answer, await held(lab)) == ("enrol", 1)
    for _ in range(3):
        assert (await join(lab, "ben")).answer == await looked(lab, "ben") == "busy"
    assert (await held(lab), len(await lab.stored_sessions())) == (1, 1)
    lab.door.most = 2
    assert await looked(lab, "ben") == "enrol"
    assert ((await join(lab, "ben")).answer, await held(lab)) == ("enrol", 2)
    assert (await join(lab, "cleo")).answer == "busy"


async def test_who_has_begun_and_who_was_invited_are_let_in_however_full_it_is(lab: Lab) -> None:
    ann = await join(lab, "ann")
    assert (await join(lab, "ann")).answer == "back", "from another browser, before they agreed"
    (stored,) = await lab.stored_sessions()

    def agree(store: Store) -> None:
        session, _ = lab.flow.advance(store.session(stored.participant).session, Event("consent_given"), 0.0)
        store.commit(Batch(session=session))

    await lab.store.run(agree)
    token = await lab.new_token(stored.participant)
    assert await looked(lab, "ann", token) == "back" == (await join(lab, "ann", token)).answer
    assert await looked(lab, "ann") == "busy", "who is not known is told nothing of ann"
    assert (await join(lab, "ann")).answer == "elsewhere"
    invited = await lab.invite()
    assert await lab.admit(invited.participant_token) is not None
    assert ann.public_id


async def test_a_study_without_places_says_so_rather_than_asking_people_back(lab: Lab) -> None:
    for _ in range(3):
        await lab.invite()
    await join(lab, "ann")
    lab.door.let_in("P001")
    assert await looked(lab, "ben") == "full" == (await join(lab, "ben")).answer


async def test_a_place_that_lapsed_is_not_given_back_into_a_lab_that_is_full(lab: Lab) -> None:
    await join(lab, "ann")
    (stored,) = await lab.stored_sessions()
    assert await lab.lapsing.sweep(lab.now_unix_s() + 31 * 60.0) == (stored.participant,)
    await lab.invite()
    lab.door.let_in("P002")
    assert (await join(lab, "ann")).answer == "busy"
    assert [one.session.state for one in await lab.stored_sessions()] == ["lapsed", "consent"]
    lab.door.most = None
    assert (await join(lab, "ann")).answer == "back"


@pytest.mark.parametrize(
    ("given", "kept_robot", "most", "said"),
    [
        (None, None, None, ""),
        (None, "kinematic", 16, ""),
        (5, "kinematic", 5, ""),
        (0, "kinematic", None, ""),
        (None, "bullet", None, "was measured with the robot bullet, here kinematic moves"),
    ],
)
def test_the_lab_keeps_to_the_number_it_was_given_or_that_was_measured_here(
    tmp_path: Path, given: int | None, kept_robot: str | None, most: int | None, said: str
) -> None:
    data = tmp_path / "data"
    if kept_robot is not None:
        capacity.write(data, capacity.Capacity(16, 24, kept_robot, True, "2026-11-27T20:00:00Z", "0.1.0", machine()))
    lab = Lab(LabConfig(data_dir=data, robot="kinematic", scene=False, capacity=given))
    lab.prepare()
    try:
        assert lab.door.most == most
        assert said in lab.door.note and bool(said) is bool(lab.door.note)
    finally:
        lab.store.store.close()


async def test_a_number_that_is_not_used_is_told_in_the_log(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / capacity.NAME).write_text("{}", encoding="utf-8")
    lab = Lab(LabConfig(data_dir=tmp_path / "data", robot="kinematic", scene=False))
    lab.prepare()
    with caplog.at_level(logging.WARNING):
        await lab.open()
    await lab.close()
    (record,) = [one for one in caplog.records if "how many people" in one.getMessage()]
    assert "measure again" in str(vars(record))
