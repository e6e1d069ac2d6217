"""A distractor that is not the readings, live: N-back on both placements, its answers, a restart, a scripted client."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest

from app.simulated.bot import run_bot
from app.wire import Alert, AlertClosed, Page, Welcome
from study.records import AlertRow
from tests.support.lab_server import LabServer
from tests.support.wire_client import SHORT, Player, events, invite, stored, visit, write_study

NBACK = {
    **SHORT,
    "first_s = 10.0 ": "first_s = 1.0 ",
    "every_s = 20.0": "every_s = 4.0",
    "answer_within_s = 20.0": "answer_within_s = 3.0",
    "away_min_s = 5.0 ": "away_min_s = 1.0 ",
    "digits = 4\ndecimals = 1": 'kind = "nback"\nn = 1\nletters = "AB"\ntarget_rate = 0.5',
}
SECOND_DEVICE = {'placement = "same_page_away" ': 'placement = "second_device" '}
TICKS_BETWEEN = 8

Launch = Callable[..., LabServer]


@pytest.fixture
def launch(start_lab: Launch, tmp_path: Path) -> Launch:
    """Starts a lab with the short study and N-back, always on the same data folder."""

    def start(changes: dict[str, str] = NBACK) -> LabServer:
        study = str(write_study(tmp_path, changes))
        arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", study)
        return start_lab(*arguments, data_dir=tmp_path / "data")

    return start


def alerts(lab: LabServer, participant: str) -> tuple[AlertRow, ...]:
    with stored(lab) as store:
        rows: tuple[AlertRow, ...] = store.rows_of("alerts", participant)
    return rows


async def until_letter(player: Player, ticks: int = TICKS_BETWEEN) -> Alert:
    for _ in range(ticks):
        await player.tick((0, 1, 0) if player.seq % 2 else (0, -1, 0))
    return await player.until(Alert)


def right(shown: list[str]) -> str:
    return "same" if shown[-1:] == shown[-2:-1] else "different"


async def test_letters_on_the_same_page_answered_right_wrong_empty_and_late(launch: Launch) -> None:
    lab = launch()
    made = invite(lab)
    async with visit(made["link"]) as player:
        words = player.heard(Welcome)[0].stimuli
        assert words is not None and (words.one, words.many) == ("letter", "letters")
        await player.reach_trial()
        first = await until_letter(player, 2)
        assert first.prompt == "Is this letter the same as the one before?"
        assert [(choice.id, choice.label, choice.key) for choice in first.choices] == [
            ("same", "Same", "1"),
            ("different", "Different", "2"),
        ]
        assert (first.reading in "AB", first.answer_within_s, first.away_min_s) == (True, 3.0, 1.0)
        assert first.right_answer is None  # a page is never told
        for value in ("", "  ", None):
            empty = await player.refused("alert_answer", {"alert": 1, "value": value})
            assert (empty.field, empty.message) == ("data.value", "Please give an answer.")
        none = await player.refused("alert_answer", {"alert": 1, "value": "perhaps"})
        assert (none.code, none.field) == ("invalid", "data.value")
        assert none.message == "'perhaps' is none of the answers: same, different"
        assert (
            "no letter 2 has been shown" in (await player.refused("alert_answer", {"alert": 2, "value": "x"})).message
        )
        await player.done("alert_answer", {"alert": 1, "value": "different"})
        closed = await player.until(AlertClosed)
        assert (closed.status, closed.release_in_s) == ("answered", 1.0)
        second = await until_letter(player)
        wrong = {"same": "different", "different": "same"}[right([first.reading, second.reading])]
        await player.done("alert_answer", {"alert": 2, "value": wrong})
        await player.done("alert_answer", {"alert": 2, "value": "same"})  # taken note of, changes nothing
        third = await until_letter(player)
        for _ in range(6):
            await player.tick()
        assert (await player.until(AlertClosed, lambda end: end.alert == 3)).status == "expired"
        await player.done("alert_answer", {"alert": 3, "value": right([second.reading, third.reading])})
    rows = alerts(lab, made["participant"])
    assert [(row.reading, row.answer, row.correct, row.status) for row in rows] == [
        (first.reading, "different", 1, "answered"),
        (second.reading, wrong, 0, "answered"),
        (third.reading, None, None, "expired"),
    ]
    results = [data["result"] for _, data in events(lab, made["participant"], "alert_answer")]
    assert results == ["accepted", "accepted", "duplicate", "late"]


async def test_only_a_scripted_client_in_lockstep_is_told_the_answer(launch: Launch) -> None:
    lab = launch()
    scripted, person = invite(lab), invite(lab, pace="real_time")
    async with visit(scripted["link"], telemetry=True) as player:
        await player.reach_trial()
        assert (await until_letter(player, 2)).right_answer == "different"
    async with visit(person["link"], telemetry=True) as player:  # as a curious participant might
        await player.reach("trial_ready")
        await player.status("ready")
        async with player.beating():
            await player.done("start")
            assert (await player.until(Alert)).right_answer is None


async def test_letters_on_the_second_device(launch: Launch) -> None:
    lab = launch({**NBACK, **SECOND_DEVICE})
    made = invite(lab)
    async with visit(made["link"], name="page") as player:
        setup = await player.reach("setup")
        async with visit(setup.content["panel_link"], name="laptop") as panel:
            words = panel.heard(Welcome)[0].stimuli
            assert words is not None and words.many == "letters"
            await panel.until(Page)
            await player.done("setup", {"device": "keyboard", "sound": True})
            await player.reach_trial()
            for _ in range(2):
                await player.tick((0, 1, 0))
            shown = await panel.until(Alert)
            assert len(shown.choices) == 2
            refused = await player.refused("alert_answer", {"alert": 1, "value": "different"})
            assert refused.message == "in this study letters are shown and logged on: second_device"
            await panel.done("alert_answer", {"alert": 1, "value": "different"})
            assert (await panel.until(AlertClosed)).status == "answered"
            assert not player.heard(Alert)
    (row,) = alerts(lab, made["participant"])
    assert (row.placement, row.correct) == ("second_device", 1)


@pytest.mark.slow
async def test_a_restart_in_mid_trial_remembers_the_letters_before(launch: Launch) -> None:
    lab = launch()
    made = invite(lab)
    shown: list[str] = []
    async with visit(made["link"]) as player:
        await player.reach_trial()
        for number in range(1, 4):
            letter = await until_letter(player, 2 if number == 1 else TICKS_BETWEEN)
            shown.append(letter.reading)
            if number < 3:
                await player.done("alert_answer", {"alert": number, "value": right(shown)})
    lab.kill()
    again = launch()
    async with visit(again.base_url + urlsplit(made["link"]).path) as player:
        back = await player.until(Alert)
        assert (back.alert, back.reading, len(back.choices)) == (3, shown[-1], 2)
        await player.page("paused")
        await player.done("resume")
        await player.status("running")
        await player.done("alert_answer", {"alert": 3, "value": right(shown)})
        for number in range(4, 7):
            shown.append((await until_letter(player)).reading)
            await player.done("alert_answer", {"alert": number, "value": right(shown)})
    rows = alerts(again, made["participant"])
    assert [row.reading for row in rows] == shown
    assert [row.correct for row in rows] == [1] * 6
    assert [row.answer for row in rows] == [right(shown[:number]) for number in range(1, 7)]


def certificates(lab: LabServer) -> list[str]:
    """What the dashboard says of each."""
    roster = httpx.get(f"{lab.base_url}/api/roster", headers=lab.headers, trust_env=False, timeout=30.0).json()
    return [line["certificate"]["state"] for line in roster["lines"]]


@pytest.mark.slow
@pytest.mark.parametrize("placement", ["same_page_away", "second_device"])
async def test_a_scripted_client_answers_every_letter_right(launch: Launch, placement: str) -> None:
    lab = launch({**NBACK, **(SECOND_DEVICE if placement == "second_device" else {})})
    made = invite(lab)
    report = await run_bot(made["link"], made["panel_link"] if placement == "second_device" else None)
    rows = alerts(lab, made["participant"])
    answered = [row for row in rows if row.status == "answered"]
    assert report.pages[-1] == "done"
    assert report.alerts == len(rows) > 10
    assert len(answered) >= len(rows) - 3  # the last of each of the three trials may be cut off
    assert {row.correct for row in answered} == {1}
    assert {row.answer for row in answered} <= {"same", "different"}
    assert certificates(lab) == ["complete"], "it was told of all that is saved, over both sockets"
