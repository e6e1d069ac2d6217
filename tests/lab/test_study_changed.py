"""The study file is changed while people take part: each goes on with the study they agreed to."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest

from app.simulated.connection import BotError
from tests.support.lab_server import LabServer
from tests.support.wire_client import SHORT, asked, invite, seen_by_experimenter, stored, visit, write_study

pytestmark = pytest.mark.slow

CHANGES = {
    "another title": {'title = "Moving': 'title = "Changed: moving'},
    "another layout": {'layout = "arc"': 'layout = "rows"'},
    "fewer objects": {', "sponge_pack"]': "]"},
    "another consent": {'on_withdrawal = "keep"': 'on_withdrawal = "erase"'},
}


@pytest.fixture
def launch(start_lab: Callable[..., LabServer], tmp_path: Path) -> Callable[..., LabServer]:
    """Starts a lab with the short study and these changes to its text, always on the same data folder."""

    def start(changes: dict[str, str]) -> LabServer:
        study = str(write_study(tmp_path, {**SHORT, **changes}))
        arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", study)
        return start_lab(*arguments, data_dir=tmp_path / "data")

    return start


@pytest.mark.parametrize("what", sorted(CHANGES))
async def test_who_was_enrolled_before_a_change_goes_on(launch: Callable[..., LabServer], what: str) -> None:
    lab = launch({})
    made = {kind: invite(lab, kind=kind) for kind in ("study", "pilot", "demo")}
    ticks = {}
    for kind, invitation in made.items():
        async with visit(invitation["link"]) as player:
            await player.reach_trial()
            for _ in range(3):
                ticks[kind] = (await player.tick((1, 0, 0))).tick
    waiting = {kind: invite(lab, kind=kind) for kind in ("study", "pilot", "demo")}  # not begun
    with stored(lab) as store:
        before = {row.participant: row.study_hash for row in store.sessions()}
    lab.close()

    lab = launch(CHANGES[what])
    new = invite(lab)
    for kind, invitation in made.items():
        async with visit(lab.base_url + urlsplit(invitation["link"]).path) as player:
            await player.page("paused")
            await player.done("resume")
            await player.status("running")
            assert (await player.tick((1, 0, 0))).tick == ticks[kind] + 1
        assert seen_by_experimenter(lab, invitation["participant"])["place"] == "trial"
    for invitation in (*waiting.values(), new):
        async with visit(lab.base_url + urlsplit(invitation["link"]).path) as player:
            await player.reach_trial()
            assert (await player.tick()).tick == 0
    with stored(lab) as store:
        after = {row.participant: row.study_hash for row in store.sessions()}
    assert {who: after[who] for who in before} == before
    assert after[new["participant"]] not in before.values()
    for route in ("summary", "roster", "sessions", "export"):
        response = asked(lab, "GET", route)
        assert response.status_code == 200, (route, response.text)


async def test_withdrawing_is_as_the_consent_they_gave_said(launch: Callable[..., LabServer]) -> None:
    lab = launch({})
    before = invite(lab)["participant"]
    lab.close()
    lab = launch(CHANGES["another consent"])
    after = invite(lab)["participant"]
    for who, state in ((before, "withdrawn"), (after, "erased")):
        response = asked(lab, "POST", f"participants/{who}/withdraw", {})
        assert response.json() == {"participant": who, "state": state}


async def test_a_study_that_this_version_cannot_read_hurts_nobody_else(launch: Callable[..., LabServer]) -> None:
    lab = launch({})
    before = invite(lab)
    lab.close()
    with closing(sqlite3.connect(lab.data_dir / "lab.sqlite")) as database, database:
        database.execute("UPDATE studies SET text = 'of_another_time = 1' || char(10) || text")
    lab = launch(CHANGES["another layout"])
    after = invite(lab)
    refused = asked(lab, "POST", f"sessions/{before['participant']}/pause", {"reason": None})
    assert refused.status_code == 503
    assert "cannot read the study they were enrolled with" in refused.json()["detail"]
    for route in ("summary", "roster", "sessions"):
        assert asked(lab, "GET", route).status_code == 200, route
    with pytest.raises(BotError, match="403"):
        async with visit(lab.base_url + urlsplit(before["link"]).path):
            raise AssertionError("was let in")
    async with httpx.AsyncClient(trust_env=False, follow_redirects=True) as browser:
        page = await browser.get(lab.base_url + urlsplit(before["link"]).path)
        told = await browser.get(f"{page.url}why")
        assert (page.status_code, told.json()) == (200, {"why": "unusable"}), (
            "its page must not say Connecting for ever"
        )
    async with httpx.AsyncClient(trust_env=False, timeout=30.0) as stranger:
        assert (await stranger.get(f"{page.url}why")).status_code == 403
    async with visit(lab.base_url + urlsplit(after["link"]).path) as player:
        await player.reach_trial()
    assert "Traceback" not in lab.log()
