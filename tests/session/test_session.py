"""A live session through its sockets: who drives, what a pause keeps, what a reading forces, what resends change."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from app.simulated.connection import BotError
from app.wire import Ack, Alert, AlertClosed, Error, Input, Message, Note, Page, Ping, Status, Superseded, Tick
from study.flow.recorded import READ_BACK
from study.records import AlertRow, TickRow
from tests.support.dashboard_client import dashboard
from tests.support.lab_server import LabServer
from tests.support.wire_client import (
    COMPREHENSION,
    SHORT,
    Player,
    command,
    events,
    invite,
    seen_by_experimenter,
    stored,
    visit,
    write_study,
)

RIGHT = (0, -1, 0)


def ticks(lab: LabServer, participant: str) -> tuple[TickRow, ...]:
    with stored(lab) as store:
        rows: tuple[TickRow, ...] = store.rows_of("ticks", participant)
    return rows


def alerts(lab: LabServer, participant: str) -> tuple[AlertRow, ...]:
    with stored(lab) as store:
        rows: tuple[AlertRow, ...] = store.rows_of("alerts", participant)
    return rows


def user(row: TickRow) -> tuple[int | None, ...]:
    return row.user_x, row.user_y, row.user_z


NONE = (None, None, None)


async def error_of(player: Player) -> Error:
    """Listen until something is refused."""
    while not isinstance(message := await player.next(), Error):
        pass
    return message


# --- coming and going --------------------------------------------------------------------------------------------


async def test_a_lost_connection_pauses_and_the_trial_goes_on_where_it_was(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"], name="a") as player:
        await player.reach_trial()
        for _ in range(3):
            await player.tick(RIGHT)
    async with visit(made["link"], name="b") as player:
        page = await player.until(Page)
        assert (page.state, page.content["can_resume"], page.content["causes"]) == ("paused", True, ["connection"])
        assert page.content["instruction"]["text"]  # the same trial behind the sign
        assert page.content["scene"] == ""  # a lab in lockstep draws none
        assert (await player.until(Status)).status == "paused"
        assert player.seq == 3  # inputs are numbered on from where they were
        await player.hands(RIGHT)
        assert (await error_of(player)).code == "illegal"  # nothing runs before it is resumed
        await player.done("resume")
        await player.status("running")
        resumed = await player.tick(RIGHT)
        assert resumed.tick == 3
    async with dashboard(quick_lab) as board:
        await board.line(made["participant"], lambda line: line["state"] == "paused" and not line["connected"])
    rows = ticks(quick_lab, made["participant"])
    assert [row.tick for row in rows] == [0, 1, 2, 3]
    assert [row.after_pause for row in rows] == [0, 0, 0, 1]
    assert (rows[2].m_y, rows[3].m_y) == (-1.0, 0.0)
    told = [(data["from"], data["to"], data["event"]) for _, data in events(quick_lab, made["participant"], "state")]
    assert told[-3:] == [
        ("trial", "paused", "connection_lost"),
        ("paused", "trial", "resume"),
        ("trial", "paused", "connection_lost"),
    ]


async def test_a_reload_comes_back_to_the_same_trial_without_a_pause(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"], name="tab") as old:
        await old.reach_trial()
        await old.tick(RIGHT)
        async with visit(made["link"], name="tab") as new:  # before the old socket is known to be gone
            assert (await new.page("trial")).trial == 1
            await new.status("running")
            assert (await new.tick(RIGHT)).tick == 1
    assert not [data for _, data in events(quick_lab, made["participant"], "state") if data["to"] == "paused"][1:]


async def test_a_second_tab_takes_over_and_the_first_is_told(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"], name="first") as first:
        await first.reach_trial()
        await first.tick(RIGHT)
        async with visit(made["link"], name="second") as second:
            await second.page("trial")
            await second.status("running")
            await first.until(Superseded)
            with contextlib.suppress(BotError):  # it may be closed already
                await first.hands((0, 0, 1))
                await first.send('{"type": "submit", "id": "late", "step": "withdraw", "data": {}}')
            assert "1000" in await first.ended()
            assert (await second.tick(RIGHT)).tick == 1
            await second.in_step()
    rows = ticks(quick_lab, made["participant"])
    assert [user(row) for row in rows] == [RIGHT, RIGHT]
    assert seen_by_experimenter(quick_lab, made["participant"])["place"] == "trial"
    assert events(quick_lab, made["participant"], "tab_taken_over")


async def test_a_lost_connection_between_trials_changes_nothing(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    for name in ("a", "b"):
        async with visit(made["link"], name=name) as player:
            page = await player.until(Page)
            if page.state == "consent":
                await player.done("consent", {"accepted": True, "hash": page.content["hash"]})
            else:
                assert page.state == "demographics"


# --- the experimenter --------------------------------------------------------------------------------------------


async def test_only_the_experimenter_ends_the_experimenters_pause(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    async with visit(made["link"]) as player:
        await player.reach_trial()
        await player.tick(RIGHT)
        assert (await command(quick_lab, participant, "pause", "a question")).status_code == 200
        page = await player.page("paused")
        assert (page.content["causes"], page.content["can_resume"]) == (["experimenter"], False)
        assert (await player.refused("resume")).code == "illegal"
        again = await command(quick_lab, participant, "pause", "again")  # the second of two experimenters
        assert again.status_code == 409 and "paused it already" in again.json()["detail"]
    async with visit(made["link"]) as player:
        page = await player.until(Page)
        assert page.content["causes"] == ["connection", "experimenter"]
        await player.done("resume")
        assert seen_by_experimenter(quick_lab, participant)["causes"] == ["experimenter"]
        answer = await command(quick_lab, participant, "resume")
        assert answer.json()["state"] == "trial"
        await player.status("running")
        assert (await player.tick(RIGHT)).tick == 1
        refused = await command(quick_lab, participant, "resume")
        assert refused.status_code == 409
        assert "The session is not paused" in refused.json()["detail"]


async def test_help_and_stop(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"]) as player:
        await player.reach_trial()
        last = await player.tick(RIGHT)
        await player.done("help", {"text": "where is the bin?"})
        assert seen_by_experimenter(quick_lab, made["participant"])["help_wanted"] is True
        assert (await player.tick(RIGHT)).tick == last.tick + 1  # help is only a call, nothing stops
        await player.done("withdraw", {"reason": None})
        page = await player.page("withdrawn")
        assert page.content["text"]
    with stored(quick_lab) as store:
        (trial,) = store.rows_of("trials", made["participant"])
    assert (trial.outcome, trial.ticks) == ("aborted", 2)
    async with visit(made["link"]) as player:  # the link shows the thanks again, and nothing else
        assert (await player.until(Page)).state == "withdrawn"
        assert (await player.refused("start")).code == "illegal"


async def test_a_view_is_switched_and_recorded(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"]) as player:
        page = await player.reach("trial_ready")
        names = [view["name"] for view in page.content["views"]]
        assert len(names) >= 2
        for name in names:
            await player.send(f'{{"type": "view", "name": "{name}"}}')
        await player.in_step()
    assert [data["name"] for _, data in events(quick_lab, made["participant"], "view")] == names


# --- resends -----------------------------------------------------------------------------------------------------


async def test_a_submission_that_is_sent_again_is_taken_once(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"]) as player:
        await player.reach("instructions")
        wrong = {"answers": {**COMPREHENSION, "on_sound": "stop"}}
        first = await player.refused("instructions", wrong, identifier="try-1")
        assert (first.code, first.field) == ("invalid", "answers.on_sound")
        assert await player.refused("instructions", wrong, identifier="try-1") == first
        # Even with other content the same id is the same submission.
        assert await player.refused("instructions", {"answers": COMPREHENSION}, identifier="try-1") == first
        await player.done("instructions", {"answers": COMPREHENSION}, identifier="try-2")
        await player.page("trial_ready")
        assert await player.done("instructions", {"answers": COMPREHENSION}, identifier="try-2")
        await player.done("help", {"text": "once"}, identifier="help")
    async with visit(made["link"], name="later") as player:
        await player.done("help", {"text": "once"}, identifier="help")
        await player.done("instructions", {"answers": COMPREHENSION}, identifier="try-2")
    participant = made["participant"]
    assert len(events(quick_lab, participant, "answers_not_right")) == 1
    assert len(events(quick_lab, participant, "step_instructions")) == 1
    assert len(events(quick_lab, participant, "step_help")) == 1
    with stored(quick_lab) as store:
        given = [row for row in store.rows_of("survey_answers", participant) if row.instrument == "comprehension"]
    assert len(given) == 2 * len(COMPREHENSION)


@pytest.mark.parametrize(
    "name", sorted({event.kind for event in READ_BACK} | {"abort", "own.step_setup", "page.hidden"})
)
async def test_a_note_cannot_pose_as_anything_else(quick_lab: LabServer, name: str) -> None:
    made = invite(quick_lab)
    async with visit(made["link"]) as player:
        await player.page("consent")
        data = {"role": "experimenter", "by": "me", "sound": "loud"}
        await player.send(json.dumps({"type": "note", "id": "n1", "name": name, "data": data}))
        refused = await player.until(Error)
        assert (refused.id, refused.field) == ("n1", "name")
    assert {kind for kind, _ in events(quick_lab, made["participant"])} <= {"connected", "disconnected"}


async def test_a_note_stands_in_a_namespace_of_its_own(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"]) as player:
        await player.page("consent")
        await player.send(Note(id="n1", name="pad_unplugged", data={"pad_id": "Pad"}))
        await player.until(Ack)
        await player.send(Note(id="n1", name="pad_unplugged", data={"pad_id": "Pad"}))  # resent
        await player.until(Ack)
    assert events(quick_lab, made["participant"], "page.pad_unplugged") == [
        ("page.pad_unplugged", {"pad_id": "Pad", "role": "participant"})
    ]


# --- readings on the same page -----------------------------------------------------------------------------------


async def until_reading(player: Player) -> Alert:
    """Ticks to the first reading, hands on the controls."""
    for _ in range(20):
        await player.tick(RIGHT if player.seq % 2 else (0, 1, 0))
    return await player.until(Alert)


async def test_while_a_reading_is_open_and_for_five_seconds_the_pad_is_ignored(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"]) as player:
        await player.reach_trial()
        reading = await until_reading(player)
        assert (reading.alert, reading.elapsed_s, reading.away_min_s) == (1, 0.0, 5.0)
        await player.tick((0, 0, 1), gripper="close")
        await player.tick((0, 0, 1))
        await player.done("alert_shown", {"alert": 1})
        await player.done("alert_heard", {"alert": 1})
        await player.done("alert_answer", {"alert": 1, "value": f" {reading.reading.replace('.', ',')} "})
        closed = await player.until(AlertClosed)
        assert (closed.status, closed.release_in_s) == ("answered", 4.0)
        for _ in range(8):
            await player.tick((0, 0, 1))
        await player.tick((0, 0, 1))
    rows = ticks(quick_lab, made["participant"])
    assert all(user(row) != NONE for row in rows[:20])
    assert [user(row) for row in rows[20:30]] == [NONE] * 10
    assert [row.gripper_input for row in rows] == [None] * 31
    assert user(rows[30]) == (0, 0, 1)
    (row,) = alerts(quick_lab, made["participant"])
    assert (row.status, row.correct, row.answered_trial_s) == ("answered", 1, 11.0)
    assert row.shown_utc and row.heard_utc and row.answered_utc


async def test_an_answer_after_the_five_seconds_frees_the_hands_at_once(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"]) as player:
        await player.reach_trial()
        await until_reading(player)
        for _ in range(15):
            await player.tick((0, 0, 1))
        await player.done("alert_answer", {"alert": 1, "value": "0.0"})
        closed = await player.until(AlertClosed)
        assert (closed.status, closed.release_in_s) == ("answered", 0.0)
        await player.tick((0, 0, 1))
    rows = ticks(quick_lab, made["participant"])
    assert [user(row) for row in rows[20:35]] == [NONE] * 15
    assert user(rows[35]) == (0, 0, 1)
    (row,) = alerts(quick_lab, made["participant"])
    assert (row.answer, row.correct) == ("0.0", 0)


async def test_answers_that_are_empty_unknown_duplicate_or_late(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    async with visit(made["link"]) as player:
        await player.reach_trial()
        first = await until_reading(player)
        assert first.entry == "number"
        for value in ("", "   ", None, "abc", "4 8", "1" * 41, "5\0", "x" * 5000):
            assert (await player.refused("alert_answer", {"alert": 1, "value": value})).field == "data.value"
        for number in (2, 2**53):
            assert (await player.refused("alert_answer", {"alert": number, "value": "1"})).field == "data.alert"
        for wrong, field in (({"value": "1"}, "alert"), ({"alert": "x"}, "alert"), ({"alert": 1, "v": 1}, "v")):
            assert (await player.refused("alert_answer", wrong)).field == f"data.{field}"
        typed = f" \u200e0{first.reading.replace('.', ',')}0"
        await player.done("alert_answer", {"alert": 1, "value": typed})
        await player.done("alert_answer", {"alert": 1, "value": "999.9"})  # taken note of, changes nothing
        for _ in range(40):
            await player.tick()
        second = await player.until(Alert)
        assert second.alert == 2
        for _ in range(40):
            await player.tick()
        expired = await player.until(AlertClosed, lambda closed: closed.status == "expired")
        assert expired.alert == 2
        await player.done("alert_answer", {"alert": 2, "value": second.reading})
    results = [data["result"] for _, data in events(quick_lab, made["participant"], "alert_answer")]
    assert results == ["accepted", "duplicate", "late"]
    rows = alerts(quick_lab, made["participant"])
    assert [(row.status, row.answer, row.correct, row.due_trial_s) for row in rows[:2]] == [
        ("answered", typed, 1, 10.0),
        ("expired", None, None, 30.0),
    ]


@pytest.mark.slow
async def test_readings_stand_still_while_paused_and_come_back_after_a_reload(quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    participant = made["participant"]
    async with visit(made["link"]) as player:
        await player.reach_trial()
        reading = await until_reading(player)
        await player.tick()
        await command(quick_lab, participant, "pause", "a long one")
        await player.page("paused")
        await player.until(Ping)  # two seconds of the wall clock at most, none of the trial's
        await player.until(Ping)
        await command(quick_lab, participant, "resume")
        await player.status("running")
    async with visit(made["link"]) as player:
        again = await player.until(Alert)
        assert (again.alert, again.reading, again.elapsed_s) == (1, reading.reading, 0.5)
        await player.done("resume")
        await player.status("running")
        await player.done("alert_answer", {"alert": 1, "value": reading.reading})
    (row,) = alerts(quick_lab, participant)
    assert (row.status, row.answered_trial_s) == ("answered", 10.5)


async def test_a_second_device_shows_the_readings_and_can_do_nothing_else(
    start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    changes = {**SHORT, 'placement = "same_page_away" ': 'placement = "second_device" '}
    study = str(write_study(tmp_path, changes))
    lab = start_lab("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", study)
    made = invite(lab)
    async with visit(made["link"], name="page") as player:
        setup = await player.reach("setup")
        assert setup.content["placement"] == "second_device"
        async with visit(setup.content["panel_link"], name="laptop") as panel:
            assert (await panel.until(Page)).state == "waiting"
            await player.done("setup", {"device": "keyboard", "sound": True})
            await player.reach_trial()
            await until_reading_on(player, panel)
            reading = panel.heard(Alert)[-1]
            assert not player.heard(Alert)
            refused = await player.refused("alert_answer", {"alert": 1, "value": reading.reading})
            assert (refused.code, refused.field) == ("illegal", "step")
            driven = await player.tick((0, 0, 1))
            for step in ("withdraw", "start", "help"):
                assert (await panel.refused(step)).code == "illegal"
            for frame in (
                Input(seq=9999, client_ms=0.0, direction=(0, 0, 1)).model_dump_json(),
                '{"type": "heartbeat", "seq": 9999, "direction": [0, 0, 1]}',
                '{"type": "view", "name": "side"}',
            ):
                await panel.send(frame)
                assert (await error_of(panel)).code == "illegal"
            await panel.done("alert_answer", {"alert": 1, "value": reading.reading})
            assert (await panel.until(AlertClosed)).status == "answered"
            assert (await player.tick((0, 0, 1))).tick == driven.tick + 1
            await command(lab, made["participant"], "abort", "enough")
            assert (await panel.until(Page, lambda page: page.state not in ("waiting", "trial"))).state == "aborted"
    rows = ticks(lab, made["participant"])
    assert user(rows[20]) == user(rows[21]) == (0, 0, 1)  # the walk to the laptop is what takes the hands off


async def until_reading_on(player: Player, panel: Player) -> None:
    for _ in range(20):
        await player.tick((0, 1, 0) if player.seq % 2 else RIGHT)
    await panel.until(Alert)


# --- against the clock -------------------------------------------------------------------------------------------


async def test_a_press_and_release_between_two_ticks_counts_once(quick_lab: LabServer) -> None:
    made = invite(quick_lab, pace="real_time")
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        async with player.beating():
            await player.status("ready")
            await player.done("start")
            await player.until(Tick)
            await player.hands(RIGHT)
            released = await player.hands(None)
            await player.until(Tick, lambda tick: tick.seq >= released)
            await player.until(Tick)
    rows = ticks(quick_lab, made["participant"])
    assert [user(row) for row in rows].count(RIGHT) == 1
    assert {user(row) for row in rows} == {RIGHT, NONE}
    assert all(row.late_ms is not None and row.started_utc for row in rows)


@pytest.mark.slow
async def test_a_missing_heartbeat_holds_the_robot_and_is_no_hands_off(quick_lab: LabServer) -> None:
    made = invite(quick_lab, pace="real_time")
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        await player.status("ready")
        async with player.beating((0, 0, 1)):
            await player.done("start")
            last = await player.until(Tick)
        while not isinstance(message := await player.next(), Status):
            last = message if isinstance(message, Tick) else last
        assert message.status == "held"
        while_held: list[Message] = []
        for _ in range(2):  # the lab's own probes, two seconds apart
            while not isinstance(message := await player.next(), Ping):
                while_held.append(message)
        assert not [message for message in while_held if isinstance(message, Tick)]
        assert seen_by_experimenter(quick_lab, made["participant"])["held"] is True
        async with player.beating((0, 0, 1)):
            await player.status("running")
            going_on = await player.until(Tick)
        assert going_on.tick == last.tick + 1
    rows = ticks(quick_lab, made["participant"])
    assert [row.tick for row in rows] == list(range(len(rows)))
    assert user(rows[going_on.tick]) == (0, 0, 1)
    assert [row.tick for row in rows if row.after_pause] == [going_on.tick] or rows[0].after_pause
    assert rows[going_on.tick].after_pause == 1
    kinds = [kind for kind, _ in events(quick_lab, made["participant"], "robot_held", "robot_released")]
    assert kinds[:2] == ["robot_held", "robot_released"]


@pytest.fixture
def hasty_lab(start_lab: Callable[..., LabServer], tmp_path: Path) -> LabServer:
    """Its first reading comes after one and a half seconds and covers the view for one."""
    changes = {**SHORT, "first_s = 10.0 ": "first_s = 1.5 ", "away_min_s = 5.0 ": "away_min_s = 1.0 "}
    study = str(write_study(tmp_path, changes))
    return start_lab("--robot", "kinematic", "--no-scene", "--study", study)


@pytest.mark.slow
async def test_against_the_clock_not_even_the_first_tick_of_a_reading_is_driven(hasty_lab: LabServer) -> None:
    made = invite(hasty_lab)
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        await player.status("ready")
        async with player.beating((0, 0, 1), every_s=0.03):
            await player.done("start")
            reading = await player.until(Alert)
            await player.until(Tick)
            await player.done("alert_answer", {"alert": 1, "value": reading.reading})
            closed = await player.until(AlertClosed)
            assert closed.status == "answered"
            await player.until(Tick, lambda tick: tick.tick >= 8)
    rows = ticks(hasty_lab, made["participant"])
    (alert,) = alerts(hasty_lab, made["participant"])
    assert alert.due_trial_s == 1.5
    assert alert.answered_trial_s is not None
    assert {user(row) for row in rows if 0.5 <= row.trial_s < 1.5} == {(0, 0, 1)}
    release_s = max(alert.answered_trial_s, alert.due_trial_s + 1.0)
    away = [user(row) for row in rows if 1.5 <= row.trial_s < release_s]
    assert away and set(away) == {NONE}
    assert user(next(row for row in rows if row.trial_s >= release_s + 1.0)) == (0, 0, 1)
