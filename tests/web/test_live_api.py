"""What the experimenter sees while it happens, and says: pushed to whoever holds the token, and to nobody else."""

from __future__ import annotations

import asyncio
import io
import json
import zipfile
from typing import Any

import httpx
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Origin

from app.wire import Heartbeat, Notice
from study.flow.answers import MAX_TEXT_CHARACTERS
from tests.support.dashboard_client import Line, dashboard, socket_url
from tests.support.lab_server import LabServer
from tests.support.wire_client import MESSAGE_WITHIN_S, Player, command, events, invite, read, visit


async def say(lab: LabServer, participant: str, path: str, body: Any) -> httpx.Response:
    async with httpx.AsyncClient(base_url=lab.base_url, headers=lab.headers, trust_env=False, timeout=30.0) as client:
        return await client.post(f"/api/sessions/{participant}/{path}", json=body)


async def get(lab: LabServer, path: str) -> httpx.Response:
    async with httpx.AsyncClient(base_url=lab.base_url, headers=lab.headers, trust_env=False, timeout=30.0) as client:
        return await client.get(path)


async def heatmap(lab: LabServer, participant: str, kind: str) -> httpx.Response:
    async with httpx.AsyncClient(base_url=lab.base_url, headers=lab.headers, trust_env=False, timeout=30.0) as client:
        return await client.get(f"/api/sessions/{participant}/heatmap", params={"kind": kind})


async def drive(player: Player, ticks: int, direction: tuple[int, int, int] | None = (1, 0, 0)) -> int:
    """Number of the last tick."""
    last = -1
    for _ in range(ticks):
        last = (await player.tick(direction)).tick
    return last


# --- who may look ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "hello",
    [
        {"type": "hello", "token": "wrong"},
        {"type": "hello", "token": ""},
        {"type": "hello"},
        {"type": "watch", "participant": None},
        ["hello"],
    ],
)
async def test_without_the_token_nothing_is_told(quick_lab: LabServer, hello: Any) -> None:
    async with connect(socket_url(quick_lab), proxy=None) as wire:
        await wire.send(json.dumps(hello))
        with pytest.raises(ConnectionClosed) as closed:
            await asyncio.wait_for(wire.recv(), MESSAGE_WITHIN_S)
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 1008


async def test_another_sites_page_is_not_let_in(quick_lab: LabServer) -> None:
    with pytest.raises(InvalidStatus) as refused:
        async with connect(socket_url(quick_lab), proxy=None, origin=Origin("http://elsewhere.example")):
            pass
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("path", ["note", "mark", "message", "help_seen", "heatmap"])
def test_the_routes_want_the_token(quick_lab: LabServer, path: str) -> None:
    method = "GET" if path == "heatmap" else "POST"
    url = f"{quick_lab.base_url}/api/sessions/P001/{path}"
    assert httpx.request(method, url, json={"text": "x"}, trust_env=False, timeout=30.0).status_code == 403


# --- every session at a glance -----------------------------------------------------------------------------------


async def test_every_session_is_told_at_once_and_each_change_after_it(quick_lab: LabServer) -> None:
    first = invite(quick_lab, label="seat 4")["participant"]
    async with dashboard(quick_lab) as board:
        line = await board.line(first)
        assert (line["state"], line["label"], line["connected"], line["trial_s"]) == ("consent", "seat 4", False, None)
        made = invite(quick_lab)
        newcomer = made["participant"]
        assert (await board.line(newcomer))["state"] == "consent"
        async with visit(made["link"]) as player:
            await board.line(newcomer, lambda line: line["connected"])
            await player.reach_trial()
            line = await board.line(newcomer, lambda line: line["state"] == "trial")
            assert line["sound"] is not None
            last = await drive(player, 6)
            line = await board.line(newcomer, lambda line: line["trial_s"] == (last + 1) * 0.5)
            assert (line["tasks"], line["driving_share"]) == (2, 1.0)
            assert line["signals_per_s"] > 0.0
            assert line["instruction"].startswith("Pick up the ")
        line = await board.line(newcomer, lambda line: not line["connected"])
        assert (line["state"], line["causes"]) == ("paused", ["connection"])


async def test_a_dashboard_to_which_nothing_is_new_hears_that_the_lab_is_there(quick_lab: LabServer) -> None:
    async with dashboard(quick_lab) as board:
        await board.next()
        while (message := await board.next())["sessions"]:
            pass  # somebody else's
        assert message == {"type": "overview", "sessions": [], "gone": [], "trouble": None, "crowding": None}


async def test_focus_and_visibility_are_told_when_they_change(quick_lab: LabServer) -> None:
    made = invite(quick_lab, pace="real_time")
    async with dashboard(quick_lab) as board, visit(made["link"]) as player:
        for visible, focused in ((True, True), (True, False), (False, False)):
            beat = {"seq": 0, "direction": None, "visible": visible, "focused": focused, "device": "gamepad"}
            await player.send(Heartbeat.model_validate(beat))

            def is_so(line: Line, expected: tuple[bool, bool] = (visible, focused)) -> bool:
                return (line["visible"], line["focused"]) == expected

            assert (await board.line(made["participant"], is_so))["device"] == "gamepad"


# --- one session -------------------------------------------------------------------------------------------------


async def test_a_watched_session_tells_each_tick_and_nobody_elses(quick_lab: LabServer) -> None:
    made, other = invite(quick_lab), invite(quick_lab)
    participant = made["participant"]
    async with dashboard(quick_lab) as board, visit(made["link"]) as player, visit(other["link"]) as bystander:
        await player.reach_trial()
        await bystander.reach_trial()
        await drive(player, 4)
        await board.watch(participant)
        news = await board.news(lambda message: bool(message["ticks"]))
        assert news["since_start"] and [tick["tick"] for tick in news["ticks"]] == [0, 1, 2, 3]
        assert {event["kind"] for event in news["events"]} >= {"connected", "step_start", "state"}
        await drive(bystander, 3)
        last = await drive(player, 1)
        news = await board.news(lambda message: bool(message["ticks"]))
        assert (news["participant"], news["since_start"]) == (participant, False)
        (tick,) = news["ticks"]
        assert (tick["tick"], tick["source"], tick["user"], tick["action"]) == (last, "user", [1, 0, 0], [1, 0, 0])
        probabilities = [goal["probability"] for goal in tick["goals"]]
        assert len(probabilities) > 1 and sum(probabilities) == pytest.approx(1.0)
        assert sum(goal["instructed"] for goal in tick["goals"]) == 1
        assert all(goal["label"] and "_" not in goal["label"] for goal in tick["goals"])
        assert 0.0 <= tick["entropy"] <= 1.0
        scores = tick["explanation"]
        assert scores["score"] == pytest.approx(scores["weighted_information"] + scores["weighted_reward"])
        await board.watch(None)
        await drive(player, 1)
        await board.line(participant, lambda line: line["trial_s"] == (last + 2) * 0.5)


async def test_a_session_that_nobody_has_opened_shows_what_is_stored(quick_lab: LabServer) -> None:
    participant = invite(quick_lab)["participant"]
    async with dashboard(quick_lab) as board:
        await board.line(participant)
        await board.watch(participant)
        news = await board.news()
        assert (news["ticks"], news["since_start"]) == ([], True)
        await board.watch("P999999")
        while (message := await board.next())["type"] != "error":
            pass
        assert "P999999" in message["message"]


async def test_what_a_dashboard_should_not_send_is_answered(quick_lab: LabServer) -> None:
    async with dashboard(quick_lab) as board:
        for frame in ("[]", "{", json.dumps({"type": "watch"}), "x" * 5000):
            await board.wire.send(frame)
            while (message := await board.next())["type"] != "error":
                pass
            assert "watch" in message["message"]


async def test_the_participant_hears_nothing_of_what_the_experimenter_sees(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with dashboard(quick_lab) as board, visit(made["link"], telemetry=True) as player:
        await board.line(made["participant"])
        await board.watch(made["participant"])
        await player.reach_trial()
        await drive(player, 5)
        await drive(player, 5, None)
        await board.news(lambda message: any(tick["tick"] == 9 for tick in message["ticks"]))
        said = "\n".join(player.frames)
    for secret in ("belief", "entropy", "probability", "score", "condition", "information", "goal_oriented"):
        assert secret not in said


# --- heatmaps ----------------------------------------------------------------------------------------------------


async def test_the_heatmaps_are_those_of_the_last_tick(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    async with visit(made["link"]) as player:
        early = await heatmap(quick_lab, participant, "information")
        assert early.status_code == 409 and "no tick" in early.json()["detail"]
        await player.reach_trial()
        last = await drive(player, 5)
        for kind in ("information", "reward"):
            plane = (await heatmap(quick_lab, participant, kind)).json()
            assert (plane["kind"], plane["tick"]) == (kind, last)
            assert len(plane["values"]) == len(plane["x_m"])
            assert {len(line) for line in plane["values"]} == {len(plane["y_m"])}
            assert all(plane["x_m"][0] <= goal["position_m"][0] <= plane["x_m"][-1] for goal in plane["goals"])
            assert sum(goal["probability"] for goal in plane["goals"]) == pytest.approx(1.0)
    assert (await heatmap(quick_lab, participant, "sideways")).status_code == 422
    assert (await heatmap(quick_lab, "P999999", "reward")).status_code == 404


# --- remarks -----------------------------------------------------------------------------------------------------


async def test_notes_marks_and_messages_are_events_with_who_and_what(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    text = '<script>alert("x")</script>'
    async with dashboard(quick_lab) as board:
        away = await say(quick_lab, participant, "message", {"text": "hello?"})
        assert away.status_code == 409 and "not connected" in away.json()["detail"]
        early = await say(quick_lab, participant, "mark", {"text": "odd"})
        assert early.status_code == 409 and "task" in early.json()["detail"]
        assert (await say(quick_lab, participant, "note", {"text": f"  {text} "})).status_code == 200
        async with visit(made["link"]) as player:
            await player.reach_trial()
            assert (await say(quick_lab, participant, "message", {"text": text})).status_code == 200
            assert (await player.until(Notice)).text == text
            await drive(player, 2)
            line = await board.line(participant, lambda line: line["why_not"]["task_marked"] == "")
            assert line["why_not"]["message"] == "" and "help" in line["why_not"]["help_seen"]
            assert (await say(quick_lab, participant, "mark", {"text": "slipped"})).status_code == 200
        assert (await command(quick_lab, participant, "abort", "end of the test")).status_code == 200
        assert (await say(quick_lab, participant, "note", {"text": "afterwards"})).status_code == 200
    told = read(quick_lab, participant, "note", "message", "task_marked")
    assert told == [
        ("note", {"by": "experimenter", "text": f"  {text} "}),
        ("message", {"by": "experimenter", "text": text}),
        ("task_marked", {"by": "experimenter", "text": "slipped", "task": 1, "kind": "pickup"}),
        ("note", {"by": "experimenter", "text": "afterwards"}),
    ]


async def test_words_that_may_name_somebody_are_read_beside_their_event_and_stay_out_of_the_export(
    quick_lab: LabServer,
) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    async with dashboard(quick_lab) as board:
        await board.line(participant)
        await board.watch(participant)
        async with visit(made["link"]) as player:
            await player.done("help", {"text": "the screen of Ann Other is dark"})
            await say(quick_lab, participant, "note", {"text": "Ann Other called"})
            await player.done("help", {})
            await say(quick_lab, participant, "note", {"text": "and called again"})
            await player.done("withdraw", {"reason": "Ann Other has no time"})
        told: list[dict[str, Any]] = []
        while not any(event["kind"] == "step_withdraw" for event in told):
            told += (await board.news())["events"]
    kinds = ("step_help", "note", "step_withdraw")
    words = [(event["kind"], event["data"].get("text")) for event in told if event["kind"] in kinds]
    assert words == [
        ("step_help", "the screen of Ann Other is dark"),
        ("note", "Ann Other called"),
        ("step_help", None),
        ("note", "and called again"),
        ("step_withdraw", "Ann Other has no time"),
    ]
    exported = await get(quick_lab, "/api/export")
    with zipfile.ZipFile(io.BytesIO(exported.content)) as package:
        files = {name: package.read(name) for name in package.namelist()}
    assert participant.encode() in files["events.csv"]
    assert not [name for name, content in files.items() if b"Ann Other" in content or b"called again" in content]


async def test_a_call_for_help_stays_until_somebody_has_seen_it(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    async with dashboard(quick_lab) as board, visit(made["link"]) as player:
        await player.done("help", {"text": "the screen is dark"})
        await board.line(participant, lambda line: line["help_wanted"])
        assert (await say(quick_lab, participant, "help_seen", {})).status_code == 200
        await board.line(participant, lambda line: not line["help_wanted"])
        again = await say(quick_lab, participant, "help_seen", {})
        assert again.status_code == 409 and "does not ask" in again.json()["detail"]


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"text": ""},
        {"text": "   "},
        {"text": "x" * (MAX_TEXT_CHARACTERS + 1)},
        {"text": "a\0b"},
        {"words": "x"},
        [],
    ],
)
async def test_a_remark_without_words_is_refused(quick_lab: LabServer, body: Any) -> None:
    participant = invite(quick_lab)["participant"]
    for path in ("note", "mark", "message"):
        assert (await say(quick_lab, participant, path, body)).status_code == 422
    assert events(quick_lab, participant) == []


async def test_remarks_about_nobody_are_404(quick_lab: LabServer) -> None:
    for path, body in (("note", {"text": "x"}), ("mark", {"text": "x"}), ("message", {"text": "x"}), ("help_seen", {})):
        answer = await say(quick_lab, "P999999", path, body)
        assert answer.status_code == 404 and "P999999" in answer.json()["detail"]
