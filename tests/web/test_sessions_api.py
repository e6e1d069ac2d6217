"""The HTTP API of the experimenter: participants, commands, export; and the documentation that needs no internet."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.config import LabConfig
from app.lab.lab import Lab
from app.web.live_api import live_reply
from app.web.sessions_api import session_reply
from study.store import open_store
from tests.support.lab_server import LabServer
from tests.support.route_table import EXPERIMENTERS_ROUTES, OPEN_ROUTES
from tests.support.study_samples import UTC, shipped_study
from tests.support.wire_client import command, events, invite, read, seen_by_experimenter, stored, visit


@pytest.fixture(scope="module")
def client(quick_lab: LabServer) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=quick_lab.base_url, headers=quick_lab.headers, trust_env=False, timeout=30.0) as client:
        yield client


# --- documentation -----------------------------------------------------------------------------------------------


def test_the_documentation_needs_no_internet(client: httpx.Client) -> None:
    page = client.get("/docs")
    assert page.status_code == 200
    assert re.findall(r"https?://|//[a-z]", page.text.replace(str(client.base_url), "")) == []
    parts = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert parts
    for part in parts:
        answer = client.get(part)
        assert answer.status_code == 200 and answer.content, part


def test_every_route_of_the_api_is_documented_with_a_sentence(client: httpx.Client) -> None:
    paths = client.get("/openapi.json").json()["paths"]
    assert set(paths) == OPEN_ROUTES | {path for _, path in EXPERIMENTERS_ROUTES}
    for path, methods in paths.items():
        for method, route in methods.items():
            assert route.get("description"), (method, path)


def test_the_protocol_is_told_as_schemas(client: httpx.Client) -> None:
    told = client.get("/api/protocol").json()
    assert set(told["client"]["discriminator"]["mapping"]) >= {"hello", "input", "heartbeat", "submit", "note"}
    assert set(told["server"]["discriminator"]["mapping"]) >= {"welcome", "page", "tick", "error", "ack"}


# --- participants ------------------------------------------------------------------------------------------------


def test_participants_get_links_and_the_least_filled_order(client: httpx.Client, quick_lab: LabServer) -> None:
    made = invite(quick_lab, count=12, label="pilot")
    created = made["created"]
    assert len({item["participant"] for item in created}) == 12
    assert len({item["link"] for item in created} | {item["panel_link"] for item in created}) == 24
    assert made["participant"] == created[0]["participant"]
    listed = {item["participant"]: item for item in client.get("/api/sessions").json()}
    orders = [tuple(listed[item["participant"]]["order"]) for item in created]
    assert {orders.count(order) for order in orders} == {2}  # six orders, twice each
    assert listed[created[2]["participant"]]["label"] == "pilot 3"
    assert listed[created[0]["participant"]]["state"] == "consent"


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"count": 0}, "count"),
        ({"count": 201}, "count"),
        ({"count": "many"}, "count"),
        ({"demo": "perhaps"}, "demo"),
        ({"kind": "visitor"}, "kind"),
        ({"pace": "slow"}, "pace"),
        ({"label": "x" * 201}, "label"),
        ({"name": "x"}, "name"),
        ([], "body"),
    ],
)
def test_what_is_wrong_with_an_invitation_is_named(client: httpx.Client, body: Any, field: str) -> None:
    before = len(client.get("/api/sessions").json())
    response = client.post("/api/participants", json=body)
    assert response.status_code == 422
    assert field in response.json()["detail"]
    assert len(client.get("/api/sessions").json()) == before


async def test_demo_visitors_take_no_cell_and_stay_out_of_the_export(
    quick_lab: LabServer,
) -> None:
    demo, label = invite(quick_lab, demo=True), "Ada Lovelace, +44 1234"
    real = invite(quick_lab, label=label)
    for made in (demo, real):
        async with visit(made["link"]) as player:
            assert player.messages[0].model_dump()["demo"] is made["demo"]
            await player.reach("demographics")
            assert await player.done("help", {"text": None})
    assert seen_by_experimenter(quick_lab, demo["participant"])["demo"] is True
    assert seen_by_experimenter(quick_lab, real["participant"])["demo"] is False
    assert events(quick_lab, demo["participant"])  # recorded all the same
    async with httpx.AsyncClient(
        base_url=quick_lab.base_url, headers=quick_lab.headers, trust_env=False, timeout=30.0
    ) as client:
        response = await client.get("/api/export")
    assert response.status_code == 200
    assert "attachment" in response.headers["content-disposition"]
    whole = zipfile.ZipFile(io.BytesIO(response.content))
    assert whole.testzip() is None
    texts = {name: whole.read(name).decode("utf-8", "replace") for name in whole.namelist()}
    enrolled = {row["participant"] for row in csv.DictReader(io.StringIO(text_of(texts, "participants.csv")))}
    assert real["participant"] in enrolled and demo["participant"] not in enrolled
    recorded = {row["participant"] for row in csv.DictReader(io.StringIO(text_of(texts, "events.csv")))}
    assert real["participant"] in recorded and demo["participant"] not in recorded
    assert not [name for name, text in texts.items() if label in text or demo["participant"] in text.split(",")]


def text_of(texts: dict[str, str], name: str) -> str:
    return next(text for path, text in texts.items() if path.endswith(name))


# --- commands ----------------------------------------------------------------------------------------------------


async def test_commands_to_nobody_are_404(quick_lab: LabServer) -> None:
    for name in ("start", "pause", "resume", "free_arm", "repeat_practice", "abort_trial", "abort"):
        answer = await command(quick_lab, "P999999", name, "because")
        assert answer.status_code == 404
        assert "P999999" in answer.json()["detail"]


async def test_an_abort_must_say_why(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    for reason in (None, "", "   "):
        answer = await command(quick_lab, made["participant"], "abort", reason)
        assert answer.status_code == 422
        assert "reason" in answer.json()["detail"]
    assert seen_by_experimenter(quick_lab, made["participant"])["state"] == "consent"


async def test_pause_resume_and_abort_from_outside_a_trial(quick_lab: LabServer) -> None:
    participant = invite(quick_lab)["participant"]
    refused = await command(quick_lab, participant, "resume")
    assert refused.status_code == 409
    assert refused.json()["detail"] == (
        "The session is not paused. Now it is in 'consent'; possible: pause, abort, withdraw."
    )
    paused = await command(quick_lab, participant, "pause", "lunch")
    assert (paused.status_code, paused.json()["state"]) == (200, "paused")
    seen = seen_by_experimenter(quick_lab, participant)
    assert (seen["place"], seen["causes"]) == ("consent", ["experimenter"])
    assert "experimenter_resume" in seen["allowed"]
    resumed = await command(quick_lab, participant, "resume")
    assert (resumed.status_code, resumed.json()["state"]) == (200, "consent")
    ended = await command(quick_lab, participant, "abort", "did not come")
    assert (ended.status_code, ended.json()["state"]) == (200, "aborted")
    for name in ("pause", "resume", "abort"):
        over = await command(quick_lab, participant, name, "again")
        assert over.status_code == 409
        assert over.json()["detail"] == "The session is over."
    told = [(kind, data["by"], data.get("text")) for kind, data in read(quick_lab, participant) if kind != "state"]
    assert told == [
        ("experimenter_pause", "experimenter", "lunch"),
        ("experimenter_resume", "experimenter", None),
        ("abort", "experimenter", "did not come"),
    ]


async def test_an_abort_in_the_middle_of_a_trial_closes_what_is_open(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    async with visit(made["link"]) as player:
        await player.reach_trial()
        for _ in range(20):  # ten seconds of trial time: the first reading
            last = await player.tick()
        answer = await command(quick_lab, participant, "abort", "the fire alarm")
        assert answer.json()["state"] == "aborted"
        page = await player.page("aborted")
        assert page.content["text"]
    with stored(quick_lab) as store:
        (trial,) = store.rows_of("trials", participant)
        (alert,) = store.rows_of("alerts", participant)
        ticks = store.rows_of("ticks", participant)
    assert (trial.outcome, trial.ticks) == ("aborted", last.tick + 1) == ("aborted", len(ticks))
    assert trial.finished_utc >= trial.started_utc
    assert alert.status == "trial_ended"
    seen = seen_by_experimenter(quick_lab, participant)
    assert (seen["state"], seen["allowed"]) == ("aborted", [])


def test_an_aborted_participants_cell_is_given_back(client: httpx.Client, quick_lab: LabServer) -> None:
    first = invite(quick_lab, count=6)["created"]
    lost = first[2]["participant"]
    order = seen_by_experimenter(quick_lab, lost)["order"]
    client.post(f"/api/sessions/{lost}/abort", json={"reason": "withdrew by phone"})
    taken = [tuple(item["order"]) for item in client.get("/api/sessions").json() if countable(item)]
    fewest = min(taken.count(each) for each in {*taken, tuple(order)})  # which may be nobody's now
    assert taken.count(tuple(order)) == fewest
    again = invite(quick_lab)["participant"]
    got = tuple(seen_by_experimenter(quick_lab, again)["order"])
    assert taken.count(got) == fewest


def countable(item: dict[str, Any]) -> bool:
    return not item["demo"] and item["state"] not in ("aborted", "withdrawn")


def test_a_session_whose_line_cannot_be_made_is_a_line_that_says_so(tmp_path: Path) -> None:
    lab = Lab(LabConfig(data_dir=tmp_path))
    with open_store(tmp_path) as store:
        fine = store.create_participant(shipped_study(), seed=1, public_id="a", utc=UTC)
    odd = replace(fine, order=())  # its trial has no condition
    for line in (session_reply(lab, odd, "Ann"), live_reply(lab, odd, "Ann")):
        assert (line.participant, line.label, line.state) == (odd.participant, "Ann", "unreadable")
        assert line.problem == "IndexError: tuple index out of range"
        assert [act for act, why in line.why_not.items() if not why] == ["abort", "withdraw"]
    for line in (session_reply(lab, fine, None), live_reply(lab, fine, None)):
        assert (line.problem, line.state) == (None, fine.session.state)
