"""A whole study by the scripted client, and what it leaves behind: the contract of the export, row by row."""

from __future__ import annotations

import asyncio
import contextlib
import csv
import itertools
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from app.__main__ import main
from app.simulated.bot import Bot, BotReport, PanelBot
from app.simulated.clumsy import Finding
from app.simulated.connection import Wire, enter, open_wire
from app.simulated.received import Received
from app.wire import Ack, Error, Input, Instruction, Message, Note, Page, Status, Submit, Tick, World
from study.flow.answers import validate_surveys
from study.flow.facts import as_read
from study.records import TABLES, columns
from tests.support import lab_server
from tests.support.lab_server import LabServer
from tests.support.study_samples import BINS, OBJECTS, shipped_study
from tests.support.wire_client import SHORT, invite, visit, write_study

Row = dict[str, str]
AXES = "xyz"


class RecordingWire(Wire):
    """Keeps every frame that a page receives."""

    def __init__(self, wire: Wire) -> None:
        super().__init__(wire._connection)
        self.frames: list[str] = []

    async def receive_raw(self) -> str | bytes:
        frame = await super().receive_raw()
        self.frames.append(frame if isinstance(frame, str) else frame.decode())
        return frame


@dataclass(frozen=True)
class Run:
    """A finished study: the bot's report, the frames its pages received, the exported tables."""

    lab: LabServer
    participant: str
    report: BotReport
    frames: list[str]
    tables: dict[str, list[Row]]

    def rows(self, table: str, **equal: object) -> list[Row]:
        wanted = {name: str(value) for name, value in equal.items()}
        return [row for row in self.tables[table] if all(row[name] == value for name, value in wanted.items())]


async def play(link: str, panel_link: str | None) -> tuple[BotReport, list[str]]:
    async with contextlib.AsyncExitStack() as stack:
        wires = []
        if panel_link is not None:
            panel_wire = await stack.enter_async_context(open_wire(await enter(panel_link), "panel"))
            wires.append(RecordingWire(panel_wire))
        page_wire = await stack.enter_async_context(open_wire(await enter(link), "bot", telemetry=True))
        wires.append(RecordingWire(page_wire))
        panel = PanelBot(wires[0]) if panel_link is not None else None
        report = await Bot(wires[-1], None, panel).run()
        return report, [frame for wire in wires for frame in wire.frames]


async def look_around(link: str) -> None:
    """A demo visitor who drives a little and leaves: nothing of theirs may be exported."""
    async with visit(link) as player:
        await player.reach("demographics")


def run(folder: Path, study: Path | None, with_panel: bool) -> Iterator[Run]:
    arguments = ["--robot", "kinematic", "--pace", "lockstep", *(["--study", str(study)] if study else [])]
    with lab_server.start(folder / "data", *arguments) as lab:
        made = invite(lab)
        asyncio.run(look_around(invite(lab, demo=True)["link"]))
        report, frames = asyncio.run(play(made["link"], made["panel_link"] if with_panel else None))
        assert main(["export", "--data", str(lab.data_dir), "--out", str(folder / "out")]) == 0
        tables = {}
        for table in TABLES:
            with (folder / "out" / f"{table}.csv").open(newline="", encoding="utf-8") as file:
                tables[table] = list(csv.DictReader(file))
        yield Run(lab, made["participant"], report, frames, tables)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """The shipped study."""
    yield from run(tmp_path_factory.mktemp("whole"), None, with_panel=False)


@pytest.fixture(scope="module")
def second_device(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """The short study with its readings on a second device."""
    folder = tmp_path_factory.mktemp("second")
    changes = {**SHORT, 'placement = "same_page_away" ': 'placement = "second_device" '}
    yield from run(folder, write_study(folder, changes), with_panel=True)


pytestmark = pytest.mark.slow


def test_the_bot_sees_every_page_in_order(whole: Run) -> None:
    each = ["practice_ready", "practice", "trial_ready", "trial", "survey"]
    forms = ["consent", "demographics", "setup", "instructions"]
    assert whole.report.pages == [*forms, *each, "break", *each, "break", *each, "debrief", "done"]
    assert whole.report.surveys == 3
    (participant,) = whole.tables["participants"]
    assert participant["state"] == "done"
    assert participant["consent_hash"] == as_read(shipped_study()).consent.hash
    assert participant["created_utc"] <= participant["consent_utc"] <= participant["finished_utc"]


def test_every_column_of_the_codebook_is_there(whole: Run) -> None:
    for table in TABLES:
        assert list(whole.tables[table][0]) == [info.name for info in columns(table)]


def test_nobody_else_is_in_the_export(whole: Run) -> None:
    for table, rows in whole.tables.items():
        assert {row["participant"] for row in rows} == {whole.participant}, table


def test_eighteen_tasks_with_their_outcomes(whole: Run) -> None:
    tasks = whole.tables["tasks"]
    assert [(row["trial"], row["task"]) for row in tasks] == [
        (str(trial), str(task)) for trial in range(1, 4) for task in range(1, 7)
    ]
    order = whole.tables["participants"][0]["condition_order"].split(">")
    assert sorted(order) == ["balanced", "goal_oriented", "teleoperation"]
    for row in tasks:
        assert row["condition"] == order[int(row["trial"]) - 1]
        assert row["kind"] == ("pickup" if int(row["task"]) % 2 else "dropoff")
        assert row["goal"] in (OBJECTS if row["kind"] == "pickup" else BINS)
        assert row["object"] in OBJECTS
        assert row["outcome"] in ("success", "failure", "not_run")
        assert (row["reason"] == "") == (row["outcome"] == "success")
        assert (row["first_tick"] == "") == (row["outcome"] == "not_run")
    for pickup, dropoff in zip(tasks[::2], tasks[1::2], strict=True):
        assert pickup["object"] == dropoff["object"] == pickup["goal"]
        assert (dropoff["outcome"] == "not_run") == (pickup["outcome"] == "failure")
    for trial in "123":
        assert len({row["object"] for row in tasks if row["trial"] == trial}) == 3
    assert sum(row["outcome"] == "success" for row in tasks) >= 15  # the pilot is no fool


def test_trials_tell_what_was_run(whole: Run) -> None:
    for row in whole.tables["trials"]:
        assert row["outcome"] == "completed"
        assert int(row["ticks"]) == len(whole.rows("ticks", trial=row["trial"]))
        assert row["started_utc"] < row["finished_utc"]
        assert json.loads(row["parameters"]) and json.loads(row["placement"])
    assert [row["trial"] for row in whole.tables["trials"]] == ["1", "2", "3"]


def test_ticks_run_from_zero_without_gaps(whole: Run) -> None:
    for table in ("ticks", "practice_ticks"):
        for trial in "123":
            rows = whole.rows(table, trial=trial)
            assert [int(row["tick"]) for row in rows] == list(range(len(rows)))
            assert [float(row["trial_s"]) for row in rows] == [0.5 * tick for tick in range(len(rows))]
            assert rows
    acknowledged = [json.loads(frame) for frame in whole.frames if '"type":"tick"' in frame]
    assert len(acknowledged) == whole.report.ticks
    assert len(whole.tables["ticks"]) + len(whole.tables["practice_ticks"]) == whole.report.ticks


def vector(row: Row, name: str) -> tuple[float, ...] | None:
    parts = [row[f"{name}_{axis}"] for axis in AXES]
    assert len({part == "" for part in parts}) == 1, (name, row)
    return None if parts[0] == "" else tuple(float(part) for part in parts)


def test_input_action_and_source_agree_in_every_tick(whole: Run) -> None:
    sources = set()
    for row in whole.tables["ticks"]:
        user, action, source = vector(row, "user"), vector(row, "action"), row["source"]
        sources.add(source)
        assert user is None or set(user) <= {-1, 0, 1}
        assert action is None or set(action) <= {-1, 0, 1}
        if source == "user":
            assert user is not None
            assert action == user
        elif source == "robot":
            assert user is None and action is not None
            assert row["condition"] != "teleoperation"
        elif source == "idle":
            assert user is None and action is None
            assert row["condition"] == "teleoperation"
        else:
            assert action is None
            assert source in ("gripper", "reset")
        assert row["blocked"] in "01"
        assert (row["blocked"] == "1") == (row["blocked_reason"] != "") or row["blocked_reason"]
        assert row["late_ms"] == ""
    assert sources == {"user", "robot", "idle", "gripper", "reset"}


def test_resets_belong_to_no_task_and_everything_else_does(whole: Run) -> None:
    for row in whole.tables["ticks"]:
        blank = [row[name] == "" for name in ("task", "kind", "goal")]
        assert set(blank) == {row["source"] == "reset"}
    for task in whole.tables["tasks"]:
        if task["outcome"] != "not_run":
            rows = whole.rows("ticks", trial=task["trial"], task=task["task"])
            assert (rows[0]["tick"], rows[-1]["tick"]) == (task["first_tick"], task["last_tick"])
            assert {row["goal"] for row in rows} == {task["goal"]}
            assert {row["kind"] for row in rows} == {task["kind"]}
            assert len(json.loads(rows[0]["goals"])) == int(task["goals"])


def test_the_belief_is_a_distribution_over_the_goals_and_the_entropy_is_its_own(whole: Run) -> None:
    held = ""
    for row in whole.tables["ticks"]:
        goals, belief = json.loads(row["goals"]), json.loads(row["belief"])
        assert set(goals) == set(belief)
        held_before, held = held, row["held"]
        if row["source"] == "reset":
            continue
        assert set(goals) == set(BINS) if held_before else set(goals) <= set(OBJECTS), row
        if bool(held_before) == (row["kind"] == "dropoff"):  # else the goals have switched, the task has not
            assert row["goal"] in belief, row
        assert sum(belief.values()) == pytest.approx(1.0, abs=1e-9)
        count = len(belief)
        bits = -sum(p * math.log(p) for p in belief.values() if p > 0)
        assert float(row["entropy"]) == pytest.approx(bits / math.log(count) if count > 1 else 0.0, abs=1e-9)


def test_the_belief_moves_only_with_input_and_starts_uniform(whole: Run) -> None:
    moved = 0
    for before, row in itertools.pairwise(whole.tables["ticks"]):
        if (before["trial"], before["task"]) != (row["trial"], row["task"]) or row["source"] in ("gripper", "reset"):
            continue
        if set(json.loads(before["goals"])) != set(json.loads(row["goals"])):
            continue
        same = before["belief"] == row["belief"]
        if vector(row, "user") is None:
            assert same, row
        moved += not same
    assert moved > 100


def test_momentum_is_what_was_executed_in_the_tick_before(whole: Run) -> None:
    kept = 0
    for trial in "123":
        rows = whole.rows("ticks", trial=trial)
        assert vector(rows[0], "m") == (0, 0, 0)
        for before, row in itertools.pairwise(rows):
            action, momentum = vector(before, "action"), vector(row, "m")
            assert momentum is not None
            stopped = before["source"] in ("gripper", "reset", "idle") or before["blocked"] == "1"
            if stopped or before["cycle"] != row["cycle"]:
                assert momentum == (0, 0, 0), (before, row)
            else:
                assert action is not None
                length = math.sqrt(sum(part * part for part in action)) or 1.0
                assert momentum == pytest.approx([part / length for part in action], abs=1e-9)
                kept += 1
    assert kept > 300


def test_every_reading_came_when_due_and_was_logged(whole: Run) -> None:
    practices = len(whole.rows("trials"))  # each has one, which stands in no table
    assert whole.report.alerts == len(whole.tables["alerts"]) + practices
    for trial in "123":
        alerts = whole.rows("alerts", trial=trial)
        ran_s = 0.5 * len(whole.rows("ticks", trial=trial))
        due = [10.0 + 20.0 * number for number in range(100)]
        expected = [due_s for due_s in due if due_s <= ran_s]
        assert [float(row["due_trial_s"]) for row in alerts] == expected[: len(alerts)]
        assert len(expected) - len(alerts) <= (expected[-1] == ran_s)  # none after the trial's last tick
        for row in alerts:
            if row["status"] == "answered":
                assert row["answer"] == row["reading"] and row["correct"] == "1"
                assert row["shown_utc"] and row["heard_utc"] and row["answered_utc"]
                assert float(row["due_trial_s"]) <= float(row["answered_trial_s"])
            else:
                # In the last tick nobody can answer any more.
                assert row["status"] == "trial_ended" and ran_s - float(row["due_trial_s"]) in (0.0, 0.5)
        away = [float(row["due_trial_s"]) for row in alerts]
        for row in whole.rows("ticks", trial=trial):
            if any(due_s <= float(row["trial_s"]) < due_s + 5.0 for due_s in away):
                assert vector(row, "user") is None and row["gripper_input"] == ""
    logged = [row for row in whole.tables["alerts"] if row["status"] == "answered"]
    assert len(logged) >= len(whole.tables["alerts"]) - 3


def test_every_answer_is_kept(whole: Run) -> None:
    study = shipped_study()
    answers = whole.tables["survey_answers"]
    for trial in "123":
        given = {
            name: {
                row["item"]: int(row["value"]) for row in answers if row["trial"] == trial and row["instrument"] == name
            }
            for name in study.surveys
        }
        assert sum(len(items) for items in given.values()) == 16
        assert validate_surveys(study, given) == ()
    assert len([row for row in answers if row["trial"]]) == 48
    demographics = {row["item"]: row["value"] for row in answers if row["instrument"] == "demographics"}
    assert set(demographics) == {item.id for item in study.demographics if item.required}
    comprehension = [row for row in answers if row["instrument"] == "comprehension"]
    for question in study.instructions.questions:
        tries = [row["value"] for row in comprehension if row["item"] == question.id]
        assert tries[-1] == question.correct
    assert len(comprehension) > len(study.instructions.questions)  # wrong tries are kept too
    wrong = [row for row in whole.tables["events"] if row["kind"] == "answers_not_right"]
    assert len(comprehension) == (len(wrong) + 1) * len(study.instructions.questions)


def test_the_pages_never_learn_condition_belief_or_scores(whole: Run, second_device: Run) -> None:
    secret = [*shipped_study().condition_ids, "belief", "entropy", "score", "posterior", "alpha", "condition"]
    for finished in (whole, second_device):
        assert len(finished.frames) > 100
        for frame in finished.frames:
            found = [word for word in secret if word in frame.lower()]
            assert not found, frame[:500]


def test_with_a_second_device_the_readings_go_there_and_nowhere_else(second_device: Run) -> None:
    assert second_device.report.pages[-1] == "done"
    assert len(second_device.tables["tasks"]) == 6
    alerts = second_device.tables["alerts"]
    assert alerts and {row["placement"] for row in alerts} == {"second_device"}
    assert {row["status"] for row in alerts} <= {"answered", "trial_ended"}
    assert {row["correct"] for row in alerts if row["status"] == "answered"} == {"1"}
    welcomes = [index for index, frame in enumerate(second_device.frames) if '"type":"welcome"' in frame]
    panel, page = second_device.frames[: welcomes[1]], second_device.frames[welcomes[1] :]
    assert len([frame for frame in panel if '"type":"alert"' in frame]) == len(alerts)
    assert not [frame for frame in page if '"type":"alert' in frame]
    assert not [frame for frame in panel if '"type":"tick"' in frame]
    driven = [row for row in second_device.tables["ticks"] if vector(row, "user") is not None]
    while_open = [
        row for row in driven if any(0 <= float(row["trial_s"]) - float(alert["due_trial_s"]) < 5.0 for alert in alerts)
    ]
    assert while_open  # nothing is locked: the readings themselves are across the room


def test_the_command_line_bot_completes_the_short_study(
    quick_lab: LabServer, capsys: pytest.CaptureFixture[str]
) -> None:
    made = invite(quick_lab)
    assert main(["bot", "--url", made["link"]]) == 0
    printed = capsys.readouterr().out
    assert "trial (trial 3 of 3)" in printed
    assert printed.splitlines()[-1].startswith("done: ")
    assert main(["bot", "--url", made["link"], "--quiet"]) == 0  # a finished study has nothing left to do
    assert capsys.readouterr().out == "done: 0 ticks, 0 alerts answered, 0 surveys\n"


def test_a_clumsy_bot_comes_to_the_end_and_finds_nothing(
    quick_lab: LabServer, capsys: pytest.CaptureFixture[str]
) -> None:
    made = invite(quick_lab)
    assert main(["bot", "--url", made["link"], "--clumsy", "--seed", "3"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("done: ")


def test_what_a_clumsy_bot_finds_is_told_and_is_its_exit_status(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def found(url: str, **options: object) -> BotReport:
        assert options["clumsy_seed"] == 5
        return BotReport(ticks=9, findings=[Finding("jam", 4, "(0, 0, 1) moved the arm 0.1 mm in two ticks")])

    monkeypatch.setattr("app.simulated.bot.run_bot", found)
    assert main(["bot", "--url", "http://127.0.0.1:9/p/x", "--quiet", "--clumsy", "--seed", "5"]) == 1
    assert "jam at tick 4: (0, 0, 1) moved the arm 0.1 mm in two ticks" in capsys.readouterr().out


async def test_a_clumsy_bot_finds_what_a_tick_says_in_two_ways() -> None:
    task = Instruction(text="Pick up.", kind="pickup", object="a", object_label="a", bin=None, bin_label=None)
    told: dict[str, Any] = {"instruction": task, "done_tasks": 0, "tasks": 6, "holding": False}
    world = World(
        position_m=(0.7, 0.0, 0.9),
        held=None,
        gripper="open",
        objects_m={"a": (0.8, 0.0, 0.85)},
        bins_m={"b": (0.5, 0.5, 0.9)},
    )
    wire = ScriptedWire(
        Page(state="practice_ready", trial=1, trials=3, content={}),
        Page(state="practice", trial=1, trials=3, content={}),
        world,
        Status(status="running"),
        Tick(tick=0, seq=1, status="running", gripper="open", blocked=False, **told),
        world,
        Tick(tick=2, seq=1, status="running", gripper="closed", blocked=True, **told),
        Page(state="done", trial=None, trials=3, content={}),
    )
    report = await Bot(wire, None, clumsy_seed=1).run()
    assert {finding.kind for finding in report.findings} == {
        "tick lost",
        "unacknowledged",
        "gripper told in two ways",
        "hint without blocked, or blocked without hint",
    }


LOOKS_LIKE = "is no link; one looks like http://127.0.0.1:8000/p/TOKEN"


@pytest.mark.parametrize(
    ("url", "told"),
    [
        ("http://127.0.0.1:9/p/secret", "http://127.0.0.1:9/p/…: ConnectError"),
        ("http://127.0.0.1:9/p/secret/", "http://127.0.0.1:9/p/…: ConnectError"),
        ("http://[", LOOKS_LIKE),
        ("http://127.0.0.1:port/p/secret", LOOKS_LIKE),
        ("http://127.0.0.1\n/p/secret", LOOKS_LIKE),
        ("nonsense", f"'nonsense' {LOOKS_LIKE}"),
        ("", f"'' {LOOKS_LIKE}"),
        ("localhost:8000/p/secret", f"'localhost:8000/p/…' {LOOKS_LIKE}"),
        ("127.0.0.1:8000/p/secret", LOOKS_LIKE),
        ("http:///p/secret", LOOKS_LIKE),
        ("ftp://127.0.0.1/p/secret", f"'ftp://127.0.0.1/p/…' {LOOKS_LIKE}"),
    ],
)
def test_a_bot_that_finds_nothing_says_so_in_one_line(url: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bot", "--url", url]) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith("salab: ") and printed.err.count("\n") == 1
    assert told in printed.err and "secret" not in printed.err
    assert printed.out == ""


def test_a_bot_with_a_wrong_link_or_in_real_time_says_so(
    quick_lab: LabServer, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bot", "--url", f"{quick_lab.base_url}/p/wrong"]) == 1
    assert "403" in capsys.readouterr().err
    made = invite(quick_lab, pace="real_time")
    assert main(["bot", "--url", made["link"], "--quiet"]) == 1
    assert "lockstep" in capsys.readouterr().err


class ScriptedWire(Wire):
    """The lab's part, line by line: what the bot sends is kept."""

    def __init__(self, *lab: Message) -> None:
        self._lab = iter(lab)
        self._name, self._numbers, self._submit = "x", itertools.count(1), Submit
        self._received = Received()
        self.sent: list[Message] = []

    async def send(self, message: Message) -> None:
        self.sent.append(message)

    async def receive(self) -> Message:
        said = next(self._lab, None)
        if said is None:  # it is over: what else is noted is saved
            assert isinstance(self.sent[-1], Note)
            return Ack(id=self.sent[-1].id)
        return said


async def test_the_bot_waits_while_a_worker_is_replaced() -> None:
    refused = Error(code="illegal", field="type", message="no tick can run in state 'trial' now; the input was ignored")
    wire = ScriptedWire(
        Page(state="trial", trial=1, trials=3, content={}),
        Status(status="running"),
        refused,
        Status(status="recovering"),
        Status(status="running"),
        Page(state="done", trial=None, trials=3, content={}),
    )
    await Bot(wire, None).run()
    assert [message.seq for message in wire.sent if isinstance(message, Input)] == [1, 2]
    assert [type(message) for message in wire.sent] == [Input, Input, Note, Note]


async def test_the_bot_resumes_once_however_often_it_is_told_of_the_pause() -> None:
    wire = ScriptedWire(
        Page(state="paused", trial=1, trials=3, content={"can_resume": True}),
        Status(status="paused"),
        Status(status="paused"),
        Ack(id="bot-x-1"),
        Status(status="paused"),  # told again when the robot is there
        Page(state="trial", trial=1, trials=3, content={}),
        Page(state="paused", trial=1, trials=3, content={"can_resume": True}),
        Status(status="paused"),
        Page(state="done", trial=None, trials=3, content={}),
    )
    await Bot(wire, None).run()
    assert [message.step for message in wire.sent if isinstance(message, Submit)] == ["resume", "resume"]
