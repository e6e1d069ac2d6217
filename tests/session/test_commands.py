"""What an experimenter does with a session: when each act is possible, what it leaves, and that words stay apart."""

from __future__ import annotations

import io
import json
import os
import signal
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.session.commands import ACTS, EVENTS, Circumstances, why_not
from app.simulated.bot import Bot
from app.simulated.connection import enter, open_wire
from app.wire import Error, Heartbeat, Notice, Page, Status
from study.flow.flow import FLOW
from study.flow.protocol import TERMINAL, Event, Session
from study.records import EventRow, TickRow
from tests.session.test_pages import every_session
from tests.support.lab_server import LabServer
from tests.support.wire_client import (
    command,
    events,
    invite,
    read,
    seen_by_experimenter,
    stored,
    visit,
    worker_pids,
    write_study,
)

# --- when --------------------------------------------------------------------------------------------------------


def test_an_act_is_offered_just_where_the_protocol_takes_it() -> None:
    sessions = every_session()
    assert {session.state for session in sessions} >= TERMINAL
    for session in sessions:
        now = Circumstances(session, connected=True, ready=True)
        for act, event in EVENTS.items():
            again = act == "pause" and "experimenter" in session.causes  # taken, but of no use
            possible = event in FLOW.allowed(session) and not again
            assert (why_not(act, now) == "") == possible, (session, act)
        for offered in ACTS:
            reason = why_not(offered, now)
            assert reason == "" or (reason[0].isupper() and reason.endswith(".")), reason


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, ""),
        ({"ready": False}, "robot"),
        ({"connected": False}, "page is not connected"),
        ({"lacks_panel": True}, "second device"),
        ({"session": Session("P001", 3, "trial")}, "started already"),
        ({"session": Session("P001", 3, "survey")}, "Nothing waits"),
        ({"session": FLOW.advance(Session("P001", 3, "trial_ready"), "experimenter_pause", 0.0)[0]}, "Resume it first"),
        ({"session": FLOW.advance(FLOW.new_session("P001", 3), "abort", 0.0)[0]}, "over"),
    ],
)
def test_a_start_needs_page_robot_and_second_device(changes: dict[str, Any], says: str) -> None:
    now = Circumstances(Session("P001", 3, "trial_ready"), connected=True, ready=True)
    reason = why_not("start", replace(now, **changes))
    assert says in reason and bool(says) == bool(reason)


# --- start and abort a trial ---------------------------------------------------------------------------------------


async def test_the_experimenter_starts_a_trial_for_the_participant(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    early = await command(quick_lab, participant, "start")
    assert early.status_code == 409 and "Nothing waits to be started" in early.json()["detail"]
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        await player.status("ready")
        assert seen_by_experimenter(quick_lab, participant)["why_not"]["start"] == ""
        started = await command(quick_lab, participant, "start")
        assert started.json() == {"participant": participant, "state": "trial"}
        await player.page("trial")
        await player.status("running")
        assert (await player.tick()).tick == 0
        again = await command(quick_lab, participant, "start")
        assert again.status_code == 409 and "started already" in again.json()["detail"]
    assert events(quick_lab, participant, "start") == [("start", {"by": "experimenter"})]


async def test_an_aborted_trial_is_kept_marked_and_the_session_goes_on(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    for reason in (None, "  "):
        assert (await command(quick_lab, participant, "abort_trial", reason)).status_code == 422
    early = await command(quick_lab, participant, "abort_trial", "stuck")
    assert early.status_code == 409 and "No trial is under way" in early.json()["detail"]
    async with visit(made["link"]) as player:
        await player.reach_trial()
        for _ in range(20):  # ten seconds of trial time: the first reading
            last = await player.tick()
        for focused in (True, False):
            await player.send(Heartbeat(seq=0, direction=None, focused=focused))
        await player.in_step()
        answer = await command(quick_lab, participant, "abort_trial", "the robot is stuck")
        assert answer.json()["state"] == "survey"
        await player.reach("trial_ready")
        assert [page.state for page in player.heard(Page)][-3:] == ["survey", "break", "trial_ready"]
        assert ["ended early" in notice.text for notice in player.heard(Notice)] == [True]
        await player.status("ready")
        await player.done("start")
        await player.status("running")
        assert (await player.tick()).tick == 0
    with stored(quick_lab) as store:
        first, second = store.rows_of("trials", participant)
        (alert,) = store.rows_of("alerts", participant, trial=1)
    assert (first.outcome, first.ticks, second.outcome) == ("aborted", last.tick + 1, "running")
    assert first.finished_utc and first.quality
    assert first.focus_losses == len(events(quick_lab, participant, "focus_lost")) == 1  # no tick came after it
    assert alert.status == "trial_ended"
    assert read(quick_lab, participant, "abort_trial") == [
        ("abort_trial", {"by": "experimenter", "text": "the robot is stuck"})
    ]
    (row,) = [row for row in all_events(quick_lab, participant) if row.kind == "abort_trial"]
    assert (row.trial, row.tick, row.source) == (1, last.tick, "experimenter")


def all_events(lab: LabServer, participant: str) -> tuple[EventRow, ...]:
    with stored(lab) as store:
        rows: tuple[EventRow, ...] = store.rows_of("events", participant)
    return rows


# --- repeat practice -----------------------------------------------------------------------------------------------


class Pupil(Bot):
    """A bot that drives practices and stops before the trial."""

    async def until(self, state: str, ticks: int = 0) -> None:
        """Go on until the page of this state is there, or so many ticks have run in it."""
        before = self.report.ticks
        while self.report.pages[-1:] != [state] or self.report.ticks - before < ticks:
            await self._handle(await self._wire.receive())

    async def _on_status(self, status: Status) -> None:
        if self.report.pages[-1:] != ["trial_ready"]:
            await super()._on_status(status)

    async def _on_error(self, error: Error) -> None:
        if error.id is not None or error.code != "illegal":  # an input that came when the worker was gone
            await super()._on_error(error)


@pytest.mark.slow
async def test_practice_once_more_goes_on_in_the_record_whatever_is_killed(
    start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    study = str(write_study(tmp_path, {"pickups_per_trial = 3 ": "pickups_per_trial = 1 "}))
    arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", study)
    lab = start_lab(*arguments, data_dir=tmp_path / "data")
    made = invite(lab)
    participant = made["participant"]
    async with open_wire(await enter(made["link"]), "pupil", telemetry=True) as wire:
        pupil = Pupil(wire, None)
        await pupil.until("trial_ready")
        first = practice_ticks(lab, participant)
        seen = seen_by_experimenter(lab, participant)
        assert seen["why_not"]["repeat_practice"] == ""
        again = await command(lab, participant, "repeat_practice", "did not find the fingers")
        assert again.json()["state"] == "practice_ready"
        await pupil.until("practice", ticks=5)
        (pid,) = worker_pids(lab)
        os.kill(pid, signal.SIGKILL)  # the next one re-runs this practice and not the first
        await pupil.until("trial_ready")
        refused = await command(lab, participant, "repeat_practice", "once more")
        assert refused.status_code == 200  # as often as it takes
        await pupil.until("practice", ticks=3)
        lab.kill()
    lab = start_lab(*arguments, data_dir=tmp_path / "data")
    link = lab.base_url + "/p/" + made["link"].rpartition("/")[2]
    async with open_wire(await enter(link), "pupil", telemetry=True) as wire:
        await Pupil(wire, None).until("trial_ready")
    rows = practice_ticks(lab, participant)
    assert rows[: len(first)] == first
    assert [row.tick for row in rows] == list(range(len(rows)))
    starts = [row.tick for row in rows if row.cycle != rows[max(row.tick - 1, 0)].cycle]
    assert len(starts) == 2 and starts[0] == len(first)
    assert rows[-1].cycle == 3
    assert read(lab, participant, "repeat_practice") == [
        ("repeat_practice", {"by": "experimenter", "text": "did not find the fingers"}),
        ("repeat_practice", {"by": "experimenter", "text": "once more"}),
    ]
    assert not events(lab, participant, "replay_mismatch")


def practice_ticks(lab: LabServer, participant: str) -> tuple[TickRow, ...]:
    with stored(lab) as store:
        rows: tuple[TickRow, ...] = store.rows_of("practice_ticks", participant)
    return rows


# --- who, and in what words ----------------------------------------------------------------------------------------

GONE = "Ada B. cannot hear"
NAME = "Jane Roe (p. 12) <b>é</b>"


def test_two_experimenters_are_told_apart_by_their_initials(quick_lab: LabServer) -> None:
    participant = invite(quick_lab)["participant"]
    url = f"{quick_lab.base_url}/api/sessions/{participant}"
    with httpx.Client(headers=quick_lab.headers, trust_env=False, timeout=30.0) as client:
        assert client.post(f"{url}/pause", json={}, headers={"Salab-Who": "%C3%89B"}).status_code == 200
        late = client.post(f"{url}/pause", json={}, headers={"Salab-Who": "CD"})
        assert (late.status_code, late.json()["detail"].partition(".")[0]) == (
            409,
            "An experimenter has paused it already",
        )
        assert client.post(f"{url}/resume", json={}, headers={"Salab-Who": "CD"}).status_code == 200
        for wrong in ("x" * 21, "%00"):
            refused = client.post(f"{url}/note", json={"text": "x"}, headers={"Salab-Who": wrong})
            assert refused.status_code == 422 and "Salab-Who" in refused.json()["detail"]
    told = events(quick_lab, participant, "experimenter_pause", "experimenter_resume")
    assert [data for _, data in told] == [{"by": "ÉB"}, {"by": "CD"}]


async def test_no_words_of_anybody_stand_in_an_export_and_the_dashboard_still_shows_them(quick_lab: LabServer) -> None:
    made = invite(quick_lab, kind="pilot")
    participant = made["participant"]
    url = f"{quick_lab.base_url}/api"
    async with (
        httpx.AsyncClient(headers=quick_lab.headers, trust_env=False, timeout=30.0) as client,
        visit(made["link"]) as player,
    ):
        await player.reach_trial()
        await player.done("help", {"text": NAME})
        for path, body in [
            ("note", {"text": NAME}),
            ("mark", {"text": NAME}),
            ("message", {"text": NAME}),
            ("pause", {"reason": NAME}),
            ("resume", {"reason": NAME}),
            ("abort_trial", {"reason": NAME}),
        ]:
            said = await client.post(f"{url}/sessions/{participant}/{path}", json=body)
            assert said.status_code == 200, said.text
        gone = await client.post(f"{url}/participants/{participant}/withdraw", json={"reason": NAME})
        assert gone.status_code == 200
        package = await client.get(f"{url}/export", params={"include_pilot": True})
    with zipfile.ZipFile(io.BytesIO(package.content)) as archive:
        found = [name for name in archive.namelist() if "Jane Roe" in archive.read(name).decode("utf-8", "replace")]
        listed = archive.read(next(name for name in archive.namelist() if name.endswith("events.csv"))).decode()
    assert found == []
    assert listed.count(f'""characters"": {len(NAME)}') == 8
    told = [data["text"] for _, data in read(quick_lab, participant) if "text" in data]
    assert told == [NAME] * 8
    with stored(quick_lab) as store:
        (session,) = [each for each in store.sessions() if each.participant == participant]
        assert session.session.reason is None
        kept = [json.loads(row.data) for row in store.rows_of("events", participant)]
    assert not [data for data in kept if "Jane" in json.dumps(data)]


def test_the_words_of_a_rejection_are_gone_with_the_participant(quick_lab: LabServer) -> None:
    from tests.web.test_roster_api import make_done

    participant = invite(quick_lab)["participant"]
    make_done(quick_lab, participant)
    with httpx.Client(base_url=quick_lab.base_url, headers=quick_lab.headers, trust_env=False, timeout=30.0) as client:
        place = f"/api/participants/{participant}"
        assert client.post(f"{place}/reject", json={"reason": GONE}).status_code == 200
        assert read(quick_lab, participant, "rejected") == [("rejected", {"by": "experimenter", "text": GONE})]
        assert client.post(f"{place}/erase", json={"confirm": participant}).json()["overwritten"] is True
    for path in quick_lab.data_dir.iterdir():
        assert b"Ada B." not in path.read_bytes()


def test_an_event_of_the_protocol_takes_no_words_from_here() -> None:
    """What the lab itself says about a pause is kept with the state; nobody else's words are."""
    reason = "the robot's process keeps ending"
    paused, _ = FLOW.advance(FLOW.new_session("P001", 1), Event("experimenter_pause", reason), 0.0)
    assert paused.reason == "the robot's process keeps ending"
