"""A lab whose study is in German, over HTTP and the wire: documents, pages, refusals, the open link."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest

from app.simulated.connection import PageAccess, enter
from app.wire import Alert, Welcome
from tests.support import lab_server as labs
from tests.support.lab_server import LabServer
from tests.support.wire_client import COMPREHENSION, SHORT, invite, visit, write_study

GERMAN = {
    **SHORT,
    'language = "en" ': 'language = "de" ',
    "english_questionnaires = [] ": 'english_questionnaires = ["sus_modified", "tlx_raw"] ',
    "open = false ": "open = true ",
    "quota = 0 ": "quota = 30 ",
    'placement = "same_page_away"': 'kind = "nback"\nplacement = "same_page_away"',
    "digits = 4\ndecimals = 1\n": "",
}
QUICK = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene")


@pytest.fixture(scope="module")
def german_lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabServer]:
    folder = tmp_path_factory.mktemp("german")
    study = write_study(folder, GERMAN)
    with labs.start(folder / "data", *QUICK, "--study", str(study)) as running:
        yield running


def document(access: PageAccess) -> httpx.Response:
    """The page that a link leads to."""
    return httpx.get(access.page_url, headers={"Cookie": access.cookie}, trust_env=False, timeout=30.0)


def catalogue(html: str) -> dict[str, Any]:
    """What the document brings for its modules."""
    (found,) = re.findall(r'<script type="application/json" id="catalogue">(.*?)</script>', html)
    read: dict[str, Any] = json.loads(found)
    return read


async def test_a_participants_document_is_in_german_and_brings_the_words(german_lab: LabServer) -> None:
    access = await enter(invite(german_lab)["link"])
    page = document(access)
    assert '<html lang="de" dir="ltr">' in page.text
    assert "Diese Seite braucht JavaScript." in page.text and "{{" not in page.text
    words = catalogue(page.text)
    assert (words["language"], words["decimal"]) == ("de", ",")
    assert words["texts"]["Agree and continue"] == "Zustimmen und weiter"
    assert set(words["plurals"]["1 more message"]) == {"one", "other"}


def test_the_other_documents_are_too_and_the_experimenters_is_not(german_lab: LabServer) -> None:
    def got(path: str) -> str:
        return httpx.get(german_lab.base_url + path, trust_env=False, timeout=30.0).text

    assert "<h1>Dieser Link funktioniert nicht</h1>" in got("/p/no-such-token")
    assert '<html lang="de"' in got("/join?PROLIFIC_PID=5f3c9a1b2d4e6f70aa")
    assert catalogue(got("/join?PROLIFIC_PID=5f3c9a1b2d4e6f70aa"))["texts"]["Begin"] == "Beginnen"
    assert '<html lang="en"' in got("/dashboard") and "catalogue" not in got("/dashboard")


def test_the_open_link_speaks_german(german_lab: LabServer) -> None:
    wrong = httpx.get(
        f"{german_lab.base_url}/join/offer", params={"STUDY_ID": "x"}, trust_env=False, timeout=30.0
    ).json()
    assert wrong["lines"] == ["PROLIFIC_PID fehlt im Link."]


async def test_what_the_lab_says_in_a_session_is_german(german_lab: LabServer) -> None:
    async with visit(invite(german_lab)["link"]) as player:
        (welcome,) = player.heard(Welcome)
        assert welcome.stimuli is not None
        assert (welcome.stimuli.one, welcome.stimuli.many) == ("Buchstabe", "Buchstaben")
        consent = await player.page("consent")
        refused = await player.refused("consent", {"accepted": True, "hash": "x"})
        assert (
            refused.message == "Der Text hat sich geändert, seit er angezeigt wurde. Bitte lesen Sie ihn noch einmal."
        )
        await player.done("consent", {"accepted": True, "hash": consent.content["hash"]})
        page = await player.reach("instructions")
        wrong = {question["id"]: question["options"][0]["id"] for question in page.content["questions"]}
        refused = await player.refused("instructions", {"answers": wrong})
        assert refused.message == "Das ist nicht die richtige Antwort. Bitte lesen Sie die Anleitung noch einmal."
        right = {question["id"]: COMPREHENSION[question["id"]] for question in page.content["questions"]}
        await player.done("instructions", {"answers": right})
        page = await player.reach("trial")
        assert [view["label"] for view in page.content["views"]][-1] == "Von oben"
        tick = await player.tick()
        assert tick.instruction.text == f"Nehmen Sie auf: {tick.instruction.object_label}."
        while not player.heard(Alert):
            await player.tick()
        (alert,) = player.heard(Alert)
        assert alert.prompt == "Ist dieser Buchstabe derselbe wie der vor 2 Buchstaben?"
        assert [choice.label for choice in alert.choices] == ["Gleich", "Anders"]


async def test_who_began_in_german_goes_on_in_german(tmp_path: Path) -> None:
    german = write_study(tmp_path, GERMAN)
    with labs.start(tmp_path / "data", *QUICK, "--study", str(german)) as running:
        token = urlsplit(invite(running)["link"]).path
    english = write_study(tmp_path)
    with labs.start(tmp_path / "data", *QUICK, "--study", str(english)) as running:
        access = await enter(running.base_url + token)
        page = document(access)
        assert '<html lang="de"' in page.text
        access = await enter(invite(running)["link"])
        page = document(access)
        assert '<html lang="en" dir="ltr">' in page.text and "catalogue" not in page.text
