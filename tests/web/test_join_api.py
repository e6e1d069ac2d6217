"""The open link over HTTP: who is enrolled, who comes back, who is told what; all of it behind a proxy with a path."""

from __future__ import annotations

import io
import itertools
import json
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.limits import Limits
from app.simulated.bot import run_bot
from app.simulated.connection import PageAccess, open_wire
from app.wire import Error, Ping
from study.flow.eligibility import PINGS
from tests.support import lab_server as labs
from tests.support.lab_server import LabServer
from tests.support.wire_client import (
    OPEN,
    SHORT,
    Player,
    asked,
    command,
    events,
    invite,
    stored,
    write_study,
)

numbers = itertools.count(1)


def new_id() -> str:
    return f"5f3c9a1b2d4e6f70{next(numbers):08x}"


@pytest.fixture
def someone(open_lab: LabServer) -> Iterator[httpx.Client]:
    """A browser that was never here."""
    with httpx.Client(base_url=open_lab.base_url, trust_env=False, timeout=30.0) as browser:
        yield browser


def join(browser: httpx.Client, person: str | None, **others: str) -> httpx.Response:
    ids = {"PROLIFIC_PID": person} if person is not None else {}
    # Each test is a stranger to the next one's limit: the proxy's word for where somebody comes from is believed.
    headers = {"X-Forwarded-For": f"192.0.2.{next(numbers) % 250}"}
    return browser.post("/join", json={"parameters": {**ids, **others}}, headers=headers)


def offered(browser: httpx.Client, person: str) -> httpx.Response:
    return browser.get("/join/offer", params={"PROLIFIC_PID": person})


def exported(lab: LabServer) -> list[bytes]:
    export = httpx.get(f"{lab.base_url}/api/export", headers=lab.headers, trust_env=False, timeout=30.0)
    with zipfile.ZipFile(io.BytesIO(export.content)) as package:
        return [package.read(name) for name in package.namelist()]


def people(lab: LabServer, search: str = "") -> list[dict[str, Any]]:
    answer = httpx.get(
        f"{lab.base_url}/api/roster", params={"search": search}, headers=lab.headers, trust_env=False, timeout=30.0
    )
    found: list[dict[str, Any]] = answer.json()["lines"]
    return found


def recruitment(lab: LabServer) -> dict[str, Any]:
    found: dict[str, Any] = httpx.get(
        f"{lab.base_url}/api/roster", headers=lab.headers, trust_env=False, timeout=30.0
    ).json()
    told: dict[str, Any] = found["recruitment"]
    return told


def page_access(lab: LabServer, browser: httpx.Client, reply: dict[str, Any]) -> PageAccess:
    page_url = str(httpx.URL(lab.base_url).join(reply["page"]))
    return PageAccess(page_url, "; ".join(f"{name}={value}" for name, value in browser.cookies.items()))


# ---- the link


def test_fetching_the_link_enrols_nobody(open_lab: LabServer, someone: httpx.Client) -> None:
    person = new_id()
    before = recruitment(open_lab)["held"]
    for _ in range(3):
        page = someone.get("/join", params={"PROLIFIC_PID": person})
        assert page.status_code == 200 and "text/html" in page.headers["content-type"]
        assert offered(someone, person).json()["state"] == "begin"
    assert someone.head("/join", params={"PROLIFIC_PID": person}).status_code == 200
    assert recruitment(open_lab)["held"] == before
    assert not someone.cookies
    assert people(open_lab, person) == []


@pytest.mark.parametrize(
    ("query", "says"),
    [
        ("", "PROLIFIC_PID is missing"),
        ("STUDY_ID=64a1", "PROLIFIC_PID is missing"),
        ("PROLIFIC_PID=", "PROLIFIC_PID is missing"),
        ("PROLIFIC_PID=a&PROLIFIC_PID=b", "stands 2 times"),
        ("PROLIFIC_PID=%7B%7B%25PROLIFIC_PID%25%7D%7D", "still a placeholder"),
        ("PROLIFIC_PID=" + "7" * 5000, "not filled in"),
        ("PROLIFIC_PID=%00%ff%3Cscript%3E", "still a placeholder"),
        ("PROLIFIC_PID=%00%ff", "not filled in"),
        ("PROLIFIC_PID=ab&SESSION_ID=a%0ab", "SESSION_ID is not filled in"),
    ],
    ids=range(9),
)
def test_a_link_that_is_not_in_order_is_a_page_that_says_so(someone: httpx.Client, query: str, says: str) -> None:
    page = someone.get(f"/join?{query}")
    assert (page.status_code, page.headers["content-type"]) == (400, "text/html; charset=utf-8")
    offer = someone.get(f"/join/offer?{query}")
    assert (offer.status_code, offer.json()["state"]) == (400, "bad_link")
    assert says in " ".join(offer.json()["lines"])
    assert "script" not in offer.text


def test_a_bad_request_to_join_is_refused_and_enrols_nobody(open_lab: LabServer, someone: httpx.Client) -> None:
    before = recruitment(open_lab)["held"]
    assert join(someone, None).status_code == 400
    assert join(someone, "{{%PROLIFIC_PID%}}").json()["state"] == "bad_link"
    assert someone.post("/join", content=b"{").status_code == 422
    assert someone.post("/join", json={"parameters": {"PROLIFIC_PID": "x" * 1001}}).status_code == 422
    assert someone.post("/join", json={"parameters": {str(n): "" for n in range(51)}}).status_code == 422
    foreign = someone.post("/join", json={"parameters": {}}, headers={"Origin": "https://elsewhere.example"})
    assert foreign.status_code == 403
    assert recruitment(open_lab)["held"] == before


def test_a_lab_that_does_not_recruit_says_so_and_enrols_nobody(quick_lab: LabServer) -> None:
    with httpx.Client(base_url=quick_lab.base_url, trust_env=False, timeout=30.0) as browser:
        assert browser.get("/join?PROLIFIC_PID=ab").status_code == 404
        assert browser.get("/join").status_code == 404
        reply = join(browser, "ab")
        assert (reply.status_code, reply.json()["state"], reply.json()["page"]) == (404, "closed", None)
    assert people(quick_lab, "ab") == []


def test_a_proxy_that_leaves_the_path_in_place_is_understood_too(open_lab: LabServer) -> None:
    with httpx.Client(base_url=f"http://127.0.0.1:{open_lab.port}", trust_env=False, timeout=30.0) as proxy:
        for path in ("/study/join?PROLIFIC_PID=ab", "/study/static/join/join.js", "/study/api/health", "/study/"):
            assert proxy.get(path).status_code == 200, path
        assert 'src="/study/static/join/join.js"' in proxy.get("/study/join").text
        assert proxy.get("/studies/").status_code == 404


# ---- enrolling and coming back


def test_whoever_begins_is_enrolled_once_under_the_next_order(open_lab: LabServer, someone: httpx.Client) -> None:
    person = new_id()
    reply = join(someone, person, STUDY_ID="64a1", SESSION_ID="64b2", utm_source="mail")
    assert (reply.status_code, reply.json()["state"]) == (200, "begin")
    assert reply.json()["page"].startswith("/study/s/")
    assert someone.get(reply.json()["page"].removeprefix("/study")).status_code == 200
    again = join(someone, person)
    assert (again.json()["state"], again.json()["page"]) == ("back", reply.json()["page"])
    (line,) = people(open_lab, person)
    assert (line["label"], line["kind"], line["state"]) == (person, "study", "eligibility")
    assert line["ids"] == {"PROLIFIC_PID": person, "STUDY_ID": "64a1", "SESSION_ID": "64b2"}
    assert [found["participant"] for found in people(open_lab, "64b2")] == [line["participant"]]
    assert [kind for kind, _ in events(open_lab, line["participant"])] == ["joined"]


def test_the_cookies_are_for_the_labs_own_path_and_out_of_reach_of_scripts(someone: httpx.Client) -> None:
    cookies = join(someone, new_id()).headers.get_list("set-cookie")
    paths = sorted(next(part for part in cookie.split("; ") if part.startswith("Path=")) for cookie in cookies)
    assert paths[0] == "Path=/study/join" and paths[1].startswith("Path=/study/s/")
    assert all("HttpOnly" in cookie and "SameSite=lax" in cookie for cookie in cookies)


def test_two_presses_at_once_make_one_participant(open_lab: LabServer) -> None:
    person = new_id()

    def press(_: int) -> str:
        with httpx.Client(base_url=open_lab.base_url, trust_env=False, timeout=30.0) as browser:
            page: str = join(browser, person).json()["page"]
            return page

    with ThreadPoolExecutor(4) as pool:
        assert len(set(pool.map(press, range(4)))) == 1
    assert len(people(open_lab, person)) == 1


async def test_an_id_opens_nothing_in_another_browser_once_its_owner_has_agreed(
    open_lab: LabServer, someone: httpx.Client
) -> None:
    person = new_id()
    reply = join(someone, person).json()
    with httpx.Client(base_url=open_lab.base_url, trust_env=False, timeout=30.0) as other:
        # The check of the device may ask for another browser: until consent the id is enough.
        assert join(other, person).json()["page"] == reply["page"]
        place = str(httpx.URL(open_lab.base_url).join(reply["page"]))
        # One browser at a time: nobody else is left there when the owner agrees.
        assert [browser.get(place).status_code for browser in (someone, other)] == [403, 200]
        assert join(someone, person).json()["page"] == reply["page"]
        assert [browser.get(place).status_code for browser in (someone, other)] == [200, 403]
    async with open_wire(page_access(open_lab, someone, reply), "tab") as wire:
        await Player(wire).reach("demographics")
    with httpx.Client(base_url=open_lab.base_url, trust_env=False, timeout=30.0) as other:
        told = join(other, person)
        assert (told.status_code, told.json()["state"], told.json()["page"]) == (409, "elsewhere", None)
        assert not other.cookies
        other.cookies.set("salab_join_0", "wrong")
        assert join(other, person).status_code == 409
        own = join(other, new_id())  # somebody else's key opens nothing either
        assert own.status_code == 200
        assert join(other, person).status_code == 409
    assert join(someone, person).json()["page"] == reply["page"]
    assert offered(someone, person).json()["state"] == "back"


# ---- places


async def test_when_all_places_are_taken_nobody_new_comes_in_until_one_is_given_back(
    open_lab: LabServer, someone: httpx.Client
) -> None:
    first, late = new_id(), new_id()
    assert join(someone, first).status_code == 200
    places = recruitment(open_lab)
    made = invite(open_lab, count=places["quota"] - places["held"])["created"]  # personal links hold places too
    try:
        assert (offered(someone, late).status_code, offered(someone, late).json()["state"]) == (409, "full")
        told = join(someone, late)
        assert (told.status_code, told.json()["state"]) == (409, "full")
        assert told.json()["link"] == f"http://127.0.0.1:9/full?of={late}"
        assert "all the participants" in " ".join(told.json()["lines"])
        assert join(someone, first).json()["state"] == "back"  # whoever is in stays in
        with httpx.Client(base_url=open_lab.base_url, trust_env=False, timeout=30.0) as other:
            assert offered(other, first).json()["state"] == "begin"
        assert (await command(open_lab, made[0]["participant"], "abort", "a place for the next")).status_code == 200
        assert join(someone, late).json()["state"] == "begin"
        assert join(someone, new_id()).status_code == 409
    finally:
        for one in made[1:]:
            await command(open_lab, one["participant"], "abort", "the test is over")


def test_too_many_at_once_from_one_address_have_to_wait(open_lab: LabServer, someone: httpx.Client) -> None:
    headers = {"X-Forwarded-For": "198.51.100.7"}
    body = {"parameters": {"PROLIFIC_PID": "{{%PROLIFIC_PID%}}"}}
    most = Limits().joins_per_min
    answers = [someone.post("/join", json=body, headers=headers) for _ in range(most + 1)]
    assert [answer.status_code for answer in answers] == [400] * most + [429]
    assert 0 < int(answers[-1].headers["retry-after"]) <= 60
    assert "try again in" in answers[-1].json()["detail"]


# ---- the check of the device


async def test_a_device_that_does_not_fit_is_screened_out_with_its_reason_in_the_data(
    open_lab: LabServer, someone: httpx.Client
) -> None:
    person = new_id()
    reply = join(someone, person).json()
    held = recruitment(open_lab)["held"]
    async with open_wire(page_access(open_lab, someone, reply), "tab") as wire:
        player = Player(wire)
        page = await player.page("eligibility")
        assert page.content["checks"] == ["window", "webgl", "round_trip"]
        assert (await player.refused("leave")).code == "illegal"
        hasty = await player.refused("eligibility", {"width_px": 1280, "height_px": 600, "has_webgl": True})
        assert (hasty.field, hasty.code) == ("round_trip", "invalid")  # what the lab has not measured is not believed
        await player.measured()
        assert [ping.left for ping in player.heard(Ping) if ping.left is not None][-PINGS:] == [*range(PINGS)][::-1]
        first = await player.refused("eligibility", {"width_px": 640, "height_px": 480, "has_webgl": False})
        second = await player.next()
        assert isinstance(second, Error)
        assert [error.field for error in (first, second)] == ["window", "webgl"]
        assert "640 pixels wide" in first.message
        await player.done("leave")
        out = await player.page("screened_out")
        assert out.content["completion_link"] == f"http://127.0.0.1:9/out?of={person}"
    (line,) = people(open_lab, person)
    assert line["state"] == "screened_out"
    assert recruitment(open_lab)["held"] == held - 1
    logged = [data for kind, data in events(open_lab, line["participant"]) if kind == "device_not_fit"]
    assert logged[-1]["lacking"] == ["window", "webgl"]
    with stored(open_lab) as store:
        (row,) = store.rows_of("participants", line["participant"])
    assert (row.state, json.loads(row.screened_out or "")) == ("screened_out", ["window", "webgl"])


async def test_a_device_that_fits_goes_on_and_no_export_knows_whose_it_was(
    open_lab: LabServer, someone: httpx.Client
) -> None:
    person, session = new_id(), "64b2feedfacecafe"
    reply = join(someone, person, SESSION_ID=session).json()
    async with open_wire(page_access(open_lab, someone, reply), "tab") as wire:
        player = Player(wire)
        await player.reach("setup")
        assert not player.heard(Error)
    (line,) = people(open_lab, person)
    ((_, passed),) = events(open_lab, line["participant"], "step_eligibility")
    assert passed["has_webgl"] is True and 0 < passed["round_trip_ms"] < 2000
    texts = exported(open_lab)
    assert any(line["participant"].encode() in text for text in texts)
    assert not any(person.encode() in text or session.encode() in text for text in texts)


async def test_a_scripted_client_passes_the_check_and_completes_the_study(open_lab: LabServer) -> None:
    made = invite(open_lab, pace="lockstep")  # over a personal link: there is no id to send back
    report = await run_bot(made["link"])
    assert (report.pages[0], report.pages[-1]) == ("eligibility", "done")
    ((_, passed),) = events(open_lab, made["participant"], "step_eligibility")
    assert 0 < passed["round_trip_ms"] < 2000


# ---- a lab that takes one at once


def test_whoever_comes_when_there_is_no_room_is_asked_back_and_takes_no_place(tmp_path: Path) -> None:
    study = write_study(tmp_path, {**SHORT, **OPEN})
    arguments = ("--robot", "kinematic", "--study", str(study), "--capacity", "1")
    with (
        labs.start(tmp_path / "data", *arguments) as lab,
        httpx.Client(base_url=lab.base_url, trust_env=False, timeout=30.0) as another,
        httpx.Client(base_url=lab.base_url, trust_env=False, timeout=30.0) as someone,
    ):
        assert join(another, new_id()).json()["state"] == "begin"
        late = new_id()
        for answer in (offered(someone, late), join(someone, late)):
            reply = answer.json()
            assert (answer.status_code, reply["state"], reply["page"], reply["again_s"]) == (503, "busy", None, 30)
            assert answer.headers["retry-after"] == "30" and not someone.cookies
        page = someone.get("/join", params={"PROLIFIC_PID": late})
        assert (page.status_code, page.headers["retry-after"]) == (503, "30") and "join.js" in page.text
        assert (recruitment(lab)["held"], people(lab, late)) == (1, [])
        health = someone.get("/api/health").json()
        assert (health["people"], health["capacity"], health["capacity_note"]) == (1, 1, "")
        metrics = someone.get("/api/metrics", headers=lab.headers).text.splitlines()
        assert {"salab_people 1.0", "salab_people_capacity 1.0"} <= set(metrics)
        first = people(lab)[0]["participant"]
        assert asked(lab, "POST", f"sessions/{first}/abort", {"reason": "the test goes on"}).status_code == 200
        assert offered(someone, late).json()["state"] == "begin"
        assert join(someone, late).json()["page"].startswith("/s/")
        invited = invite(lab)
        with httpx.Client(trust_env=False, timeout=30.0) as own_link:
            assert own_link.get(invited["link"]).status_code == 303, "whoever has a link of their own is let in"
