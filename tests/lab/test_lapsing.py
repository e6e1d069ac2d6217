"""Places of people who close the tab before they agree to take part: when they lapse, and who gets them."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from app.config import LabConfig
from app.lab.lab import Lab
from app.lab.open_enrolment import Offer, OpenEnrolment
from study.flow.protocol import Event
from study.store import Batch, Store
from tests.support.wire_client import write_study

RECRUITING = {
    "open = false ": "open = true ",
    "quota = 0 ": "quota = 2\nplace_lapses_min = 30 ",
    "practice = true ": "practice = false ",
}
MIN = 60.0


@pytest.fixture
async def lab(tmp_path: Path) -> AsyncIterator[Lab]:
    """A lab that recruits two people and lets places lapse after half an hour; it looks after nothing by itself."""
    made = Lab(LabConfig(data_dir=tmp_path / "data", study_file=write_study(tmp_path, RECRUITING), robot="kinematic"))
    made.prepare()
    yield made
    await made.close()


async def join(lab: Lab, person: str, token: str = "") -> Offer:
    return await OpenEnrolment(lab).join({"PROLIFIC_PID": [person]}, token)


async def of(lab: Lab, public_id: str) -> str:
    """Whose page this is."""
    return next(one.participant for one in await lab.stored_sessions() if one.public_id == public_id)


async def states(lab: Lab) -> list[str]:
    return [one.session.state for one in await lab.stored_sessions()]


async def agree(lab: Lab, participant: str) -> None:
    def write(store: Store) -> None:
        session, _ = lab.flow.advance(store.session(participant).session, Event("consent_given"), 0.0)
        store.commit(Batch(session=session))

    await lab.store.run(write)


async def test_a_place_lapses_after_its_time_and_goes_to_the_next_who_comes(lab: Lab) -> None:
    first, second = [await join(lab, name) for name in ("ann", "ben")]
    assert (first.answer, second.answer) == ("enrol", "enrol")
    await agree(lab, await of(lab, second.public_id))
    assert (await join(lab, "cleo")).answer == "full"
    now = lab.now_unix_s()
    assert await lab.lapsing.sweep(now + 29 * MIN) == ()
    assert await lab.lapsing.sweep(now + 31 * MIN) == (await of(lab, first.public_id),)
    assert await lab.lapsing.sweep(now + 99 * MIN) == ()
    assert await states(lab) == ["lapsed", "demographics"]
    assert (await join(lab, "cleo")).answer == "enrol"
    assert (await join(lab, "ann")).answer == "full"
    assert (await lab.admit(first.token) or [None])[0] is not None  # their page opens, and says so
    assert await states(lab) == ["lapsed", "demographics", "consent"]


async def test_who_comes_back_while_there_is_a_place_begins_anew(lab: Lab) -> None:
    offer = await join(lab, "ann")
    who = await of(lab, offer.public_id)
    await lab.lapsing.sweep(lab.now_unix_s() + 31 * MIN)
    again = await join(lab, "ann", offer.token)
    assert (again.answer, again.public_id, again.token) == ("back", offer.public_id, offer.token)
    assert await states(lab) == ["consent"]
    told = [
        json.loads(row.data)
        for row in await lab.store.run(lambda store: store.rows_of("events", who))
        if row.kind == "state"
    ]
    assert [(one["event"], one["from"], one["to"]) for one in told] == [
        ("place_lapsed", "consent", "lapsed"),
        ("place_given", "lapsed", "consent"),
    ]


async def test_a_page_that_is_still_open_somewhere_gets_its_place_back_by_itself(lab: Lab) -> None:
    offer = await join(lab, "ann")
    await lab.lapsing.sweep(lab.now_unix_s() + 31 * MIN)
    assert await states(lab) == ["lapsed"]
    found = await lab.admit(offer.token)
    assert found is not None and found[0].session.state == "consent"


async def test_who_returns_gets_the_order_that_is_least_filled_then(lab: Lab) -> None:
    offer = await join(lab, "ann")
    before = (await lab.stored_session(await of(lab, offer.public_id))).order
    await lab.lapsing.sweep(lab.now_unix_s() + 31 * MIN)
    other = await join(lab, "ben")
    assert (await lab.stored_session(await of(lab, other.public_id))).order == before  # the freed one
    await join(lab, "ann")
    stored = await lab.stored_session(await of(lab, offer.public_id))
    assert stored.order != before and stored.session.trials == len(stored.order)
    (row,) = await lab.store.run(lambda store: store.rows_of("participants", stored.participant))
    assert (row.condition_order, row.state) == (">".join(stored.order), "consent")


async def test_nobody_loses_a_place_who_is_there_has_agreed_or_was_invited(lab: Lab) -> None:
    invited = await lab.invite()
    agreed = await join(lab, "ann")
    await agree(lab, await of(lab, agreed.public_id))
    assert await lab.lapsing.sweep(lab.now_unix_s() + 1e6) == ()
    await lab.erase(invited.participant)
    there = await join(lab, "ben")
    live = await lab.session(await lab.stored_session(await of(lab, there.public_id)))
    assert not live.deserted(5.0)  # somebody is about to connect
    assert await lab.lapsing.sweep(lab.now_unix_s() + 1e6) == ()
    assert await states(lab) == ["demographics", "consent"]


async def test_the_time_in_which_no_lab_ran_takes_nobody_s_place(tmp_path: Path) -> None:
    config = LabConfig(data_dir=tmp_path / "data", study_file=write_study(tmp_path, RECRUITING), robot="kinematic")
    earlier = Lab(config, now_unix_s=lambda: 1_000_000.0)
    earlier.prepare()
    await join(earlier, "ann")
    await earlier.close()
    later = Lab(config)
    later.prepare()
    assert await later.lapsing.sweep() == ()
    assert await later.lapsing.sweep(later.now_unix_s() + 31 * MIN) != ()
    await later.close()


async def test_a_study_that_does_not_say_so_lets_nobody_s_place_lapse(tmp_path: Path) -> None:
    changes = {**RECRUITING, "quota = 0 ": "quota = 2 "}
    made = Lab(LabConfig(data_dir=tmp_path / "data", study_file=write_study(tmp_path, changes), robot="kinematic"))
    made.prepare()
    await join(made, "ann")
    assert await made.lapsing.sweep(made.now_unix_s() + 1e7) == ()
    await made.close()
