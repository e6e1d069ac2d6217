"""The roster over HTTP: the grid, links, and what an experimenter does to participants."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import sqlalchemy as sql

from app.web.roster_api import enrolment
from app.wire import Note, Welcome
from study.store import open_store
from tests.support.lab_server import LabServer
from tests.support.study_samples import UTC, shipped_study
from tests.support.wire_client import events, invite, read, stored, visit, write_study


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabServer]:
    """A lab of this file's own: its roster is counted."""
    from tests.support import lab_server as labs

    folder = tmp_path_factory.mktemp("roster")
    arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", str(write_study(folder)))
    with labs.start(folder / "data", *arguments) as running:
        yield running


@pytest.fixture(scope="module")
def client(lab: LabServer) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=lab.base_url, headers=lab.headers, trust_env=False, timeout=30.0) as client:
        yield client


def roster(client: httpx.Client, **query: Any) -> dict[str, Any]:
    answer = client.get("/api/roster", params=query)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def line(client: httpx.Client, participant: str) -> dict[str, Any]:
    return next(each for each in roster(client, search=participant)["lines"] if each["participant"] == participant)


def cells(client: httpx.Client) -> dict[tuple[str, ...], list[str]]:
    return {tuple(row["order"]): [cell["participant"] for cell in row["cells"]] for row in roster(client)["grid"]}


def holders(client: httpx.Client) -> set[str]:
    return {name for names in cells(client).values() for name in names}


def post(client: httpx.Client, path: str, body: dict[str, Any] | None = None) -> httpx.Response:
    return client.post(path, json=body)


def opened(link: str) -> int:
    return httpx.get(link, trust_env=False, timeout=30.0).status_code


def exported(client: httpx.Client, **query: Any) -> zipfile.ZipFile:
    return zipfile.ZipFile(io.BytesIO(client.get("/api/export", params=query).content))


def next_order(client: httpx.Client) -> tuple[str, ...]:
    (marked,) = [tuple(row["order"]) for row in roster(client)["grid"] if row["next"]]
    return marked


def test_the_next_order_is_the_one_the_next_participant_gets(client: httpx.Client, lab: LabServer) -> None:
    for _ in range(7):
        expected = next_order(client)
        made = invite(lab)["participant"]
        assert made in cells(client)[expected]
        assert line(client, made)["order"] == list(expected)


def test_pilots_and_demos_are_marked_and_hold_no_cell(client: httpx.Client, lab: LabServer) -> None:
    before = cells(client)
    pilot, demo = invite(lab, kind="pilot"), invite(lab, demo=True)
    assert (pilot["kind"], pilot["participant"][0], demo["kind"]) == ("pilot", "T", "demo")
    assert cells(client) == before
    assert {each["participant"] for each in roster(client, show="pilot")["lines"]} == {pilot["participant"]}
    assert line(client, pilot["participant"])["why_not"]["reject"].startswith("A pilot participant holds no cell")


async def test_opening_a_link_again_never_makes_a_second_participant(client: httpx.Client, lab: LabServer) -> None:
    made = invite(lab)
    total = roster(client)["total"]
    for _ in range(2):
        async with visit(made["link"]) as player:
            assert player.heard(Welcome)
    assert roster(client)["total"] == total


def test_a_scanner_that_fetches_links_changes_nothing(client: httpx.Client, lab: LabServer) -> None:
    made = invite(lab)
    before = roster(client), (lab.data_dir / "lab.sqlite-wal").read_bytes()
    with httpx.Client(trust_env=False, follow_redirects=True, headers={"User-Agent": "scanner"}) as scanner:
        for link in (made["link"], made["panel_link"], lab.demo_link):
            assert scanner.get(link).status_code == 200  # the page itself, behind the redirect
            assert scanner.head(link).status_code == 200
    assert (roster(client), (lab.data_dir / "lab.sqlite-wal").read_bytes()) == before
    assert events(lab, made["participant"]) == []
    with stored(lab) as store:
        assert store.identities(made["participant"]) == ()


async def test_the_demo_link_makes_its_participant_when_its_page_connects(client: httpx.Client, lab: LabServer) -> None:
    before = roster(client)["counts"]["demo"]
    for _ in range(2):
        async with visit(lab.demo_link):
            assert roster(client)["counts"]["demo"] == before + 1


def test_a_lost_link_is_replaced_for_the_same_participant(client: httpx.Client, lab: LabServer) -> None:
    made = invite(lab)
    fresh = post(client, f"/api/participants/{made['participant']}/link").json()["link"]
    assert fresh != made["link"]
    places = [httpx.get(link, trust_env=False, timeout=30.0).headers["location"] for link in (fresh, made["link"])]
    assert places[0] == places[1]


def test_a_link_is_drawn_as_a_qr_code_and_nothing_else_is(client: httpx.Client, lab: LabServer) -> None:
    link = invite(lab)["link"]
    drawn = post(client, "/api/qr", {"link": link})
    assert drawn.headers["content-type"] == "image/svg+xml"
    assert drawn.text.startswith("<svg") and "<path" in drawn.text and "<script" not in drawn.text
    assert drawn.text != post(client, "/api/qr", {"link": invite(lab)["link"]}).text
    other = post(client, "/api/qr", {"link": "https://elsewhere.example/p/x"})
    assert other.status_code == 422 and lab.base_url in other.json()["detail"]


def make_done(lab: LabServer, participant: str) -> None:
    """As if the session had been completed; the lab does not have it live."""
    with sql.create_engine(f"sqlite:///{lab.data_dir / 'lab.sqlite'}").begin() as connection:
        text = connection.execute(
            sql.text("SELECT session FROM sessions WHERE participant = :who"), {"who": participant}
        ).scalar_one()
        session = json.dumps({**json.loads(text), "state": "done", "outcome": "done"})
        connection.execute(
            sql.text("UPDATE sessions SET session = :session, state = 'done' WHERE participant = :who"),
            {"who": participant, "session": session},
        )


def test_a_rejected_participants_cell_is_given_out_again_and_the_data_stay(
    client: httpx.Client, lab: LabServer
) -> None:
    who = invite(lab)["participant"]
    place = f"/api/participants/{who}/reject"
    early = post(client, place, {"reason": "no sound"})
    assert early.status_code == 409 and "The session is not over" in early.json()["detail"]
    make_done(lab, who)
    for reason in ("", "  ", None):
        assert post(client, place, {"reason": reason}).status_code == 422
    order = tuple(line(client, who)["order"])
    assert who in cells(client)[order]
    assert post(client, place, {"reason": "no <b>sound</b>"}).status_code == 200
    again = post(client, place, {"reason": "no sound"})  # the second of two experimenters
    assert again.status_code == 409 and "Rejected already" in again.json()["detail"]
    assert who not in cells(client)[order]
    assert line(client, who)["rejected"] is True
    assert read(lab, who, "rejected") == [("rejected", {"by": "experimenter", "text": "no <b>sound</b>"})]


async def test_a_withdrawn_participants_session_ends_and_the_cell_is_free(client: httpx.Client, lab: LabServer) -> None:
    made = invite(lab)
    who = made["participant"]
    async with visit(made["link"]) as player:
        await player.reach_trial()
        await player.tick()
        answer = post(client, f"/api/participants/{who}/withdraw", {"reason": "by phone"})
        assert answer.json() == {"participant": who, "state": "withdrawn"}
        assert (await player.page("withdrawn")).content["text"]
        certificate = line(client, who)["certificate"]
        assert certificate["state"] == "unconfirmed" and certificate["ticks"] > 0 and len(certificate["head"]) == 64
        counts = {"acknowledged": certificate["messages"], "ticks": {"all of them": certificate["ticks"]}}
        await player.send(Note(id="report", name="received", data=counts))
        await player.in_step()
        assert line(client, who)["certificate"]["state"] == "complete"
    assert who not in holders(client)
    assert ("withdraw", {"by": "experimenter", "text": "by phone"}) in read(lab, who)
    with stored(lab) as store:
        assert len(store.rows_of("ticks", who)) == 1  # kept, as the consent text says
    stale = post(client, f"/api/participants/{who}/withdraw", {})
    assert stale.status_code == 409 and "The session is over" in stale.json()["detail"]


async def test_whoever_withdraws_and_wants_nothing_kept_is_erased(client: httpx.Client, lab: LabServer) -> None:
    made = invite(lab, label="Secret Name")
    who = made["participant"]
    async with visit(made["link"]) as player:
        await player.reach_trial()
        answer = post(client, f"/api/participants/{who}/withdraw", {"keep": False})
        assert answer.json()["state"] == "erased"
        await player.ended()
    assert line(client, who)["state"] == "erased"


async def test_erasing_ends_the_live_session_and_leaves_only_a_mark(client: httpx.Client, lab: LabServer) -> None:
    made = invite(lab, label="Ada of the Dentist")
    who = made["participant"]
    place = f"/api/participants/{who}/erase"
    async with visit(made["link"]) as player:
        await player.reach_trial()
        await player.tick()
        for confirm in ("", who.lower(), "P000"):
            refused = post(client, place, {"confirm": confirm})
            assert refused.status_code == 422 and who in refused.json()["detail"]
        assert post(client, place, {"confirm": who}).json() == {"participant": who, "overwritten": True}
        await player.ended()
    mark = line(client, who)
    assert (mark["state"], mark["label"], mark["order"]) == ("erased", None, []) and mark["erased_utc"]
    assert who not in holders(client)
    assert opened(made["link"]) == 403
    for file in lab.data_dir.iterdir():
        assert b"Ada of the Dentist" not in file.read_bytes(), file.name
    with exported(client, include_pilot=True) as archive:
        assert not [name for name in archive.namelist() if who.encode() in archive.read(name)]
    assert post(client, place, {"confirm": who}).status_code == 404
    assert invite(lab)["participant"] != who


def test_acts_on_nobody_are_404(client: httpx.Client) -> None:
    for act, body in (("reject", {"reason": "x"}), ("withdraw", {}), ("erase", {"confirm": "P999999"}), ("link", None)):
        answer = post(client, f"/api/participants/P999999/{act}", body)
        assert answer.status_code == 404 and "P999999" in answer.json()["detail"], act


def test_the_roster_takes_the_same_number_of_queries_for_many(tmp_path: Path) -> None:
    def queries(people: int) -> int:
        made: list[str] = []
        with open_store(tmp_path / "data") as store:
            for number in range(len(store.sessions()), people):
                label = {"label": f"<script>{number}</script>"}
                store.create_participant(
                    shipped_study(), seed=number, public_id=f"{number:x}", utc=UTC, identities=label
                )
            sql.event.listen(store._database.engine, "before_cursor_execute", lambda *call: made.append(call[2]))
            sessions, labels, _, erased, _ = enrolment(store)
            assert (len(sessions), len(labels), erased) == (people, people, ())
        return len(made)

    assert queries(3) == queries(15) < 12  # one a person would be twelve more
