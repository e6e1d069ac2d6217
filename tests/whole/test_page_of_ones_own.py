"""A page of one's own, as `docs/examples/08_page` has it: in the flow, live, with simulated people; nothing edited."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.simulated.bot import run_bot
from app.simulated.participant import simulate_participant
from app.simulated.study import Plan
from app.simulated.variants import fitted_population
from app.trial.robots import make_robot
from app.trial.world import open_study
from study.export.export import read_table
from study.flow.page import PageContext, Refused, StepContext
from study.flow.protocol import Event, Session
from tests.support.lab_server import ROOT, LabDidNotStart, LabServer
from tests.support.page_example import ENVIRONMENT, PROGRAM, copied, example_flow
from tests.support.study_samples import shipped_study
from tests.support.wire_client import invite, read, visit, write_study

pytestmark = pytest.mark.slow

FLOW = example_flow()
SERVE = ("--pace", "lockstep", "--no-scene", "--robot", "kinematic")


@pytest.fixture
def start(start_lab: Callable[..., LabServer], tmp_path: Path) -> Callable[..., LabServer]:
    """Starts the lab of the example on a short study."""
    arguments = (*SERVE, "--study", str(write_study(tmp_path)))
    return partial(start_lab, *arguments, data_dir=tmp_path / "data", environment=ENVIRONMENT, program=PROGRAM)


# ---- without a lab


def test_it_stands_in_the_flow_and_says_what_it_shows_and_takes() -> None:
    assert FLOW.states[FLOW.states.index("practice") :][:3] == ("practice", "comfort", "trial_ready")
    session = Session("P001", 3, "comfort", trial=2)
    content = FLOW.page("comfort").content(session, PageContext(shipped_study()))
    assert json.loads(json.dumps(content)) == content
    assert content["round"] == 2
    assert FLOW.allowed(session)[0] == "comfort_done"
    context = StepContext(shipped_study(), session, "balanced", "2026-01-01T00:00:00.000Z")
    outcome = FLOW.steps["comfort"](context, {"sure": 5, "hard": "The depth."})
    assert (outcome.event, outcome.words) == (Event("comfort_done"), "The depth.")
    assert [(row.trial, row.condition, row.item, row.value) for row in outcome.answers] == [(2, None, "sure", "5")]
    for data, field in (({"sure": 8}, "data.sure"), ({"sure": 1}, "hard"), ({"sure": 5, "x": 1}, "data.x")):
        with pytest.raises(Refused) as caught:
            FLOW.steps["comfort"](context, data)
        assert [name for name, _ in caught.value.problems] == [field]


def test_simulated_participants_answer_it_and_nothing_else_of_theirs_changes() -> None:
    plan = Plan(open_study(None).source_text, 7, population=fitted_population())
    make = partial(make_robot, "kinematic")
    shipped = simulate_participant(plan.case(0), make)
    own = simulate_participant(replace(plan, flow=FLOW).case(0), make)
    comfort = [row for row in own["survey_answers"] if row.instrument == "comfort"]
    assert [(row.trial, row.item) for row in comfort] == [(1, "sure"), (2, "sure"), (3, "sure")]
    assert all(1 <= int(row.value) <= 7 for row in comfort)
    ours = [replace(row, answered_utc="") for row in own["survey_answers"] if row.instrument != "comfort"]
    assert ours == [replace(row, answered_utc="") for row in shipped["survey_answers"]]
    assert own["ticks"] == shipped["ticks"]
    entered = [json.loads(row.data)["to"] for row in own["events"] if row.kind == "state"]
    assert entered.count("comfort") == 3


# ---- with one


def test_a_bot_goes_through_it_live_and_the_export_has_its_answers(
    start: Callable[..., LabServer], tmp_path: Path
) -> None:
    lab = start()
    step = httpx.get(f"{lab.base_url}/api/protocol", trust_env=False, timeout=30.0).json()["client"]["$defs"]["Submit"]
    assert "comfort" in step["properties"]["step"]["enum"]
    report = asyncio.run(run_bot(invite(lab)["link"], flow=FLOW))
    assert report.pages[-1] == "done"
    of_trials = [state for state in report.pages if state in ("comfort", "trial_ready")]
    assert of_trials == ["comfort", "trial_ready"] * 3
    out = tmp_path / "out"
    command = [sys.executable, "-m", "app", "export", "--data", str(lab.data_dir), "--out", str(out)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, timeout=120)
    rows: list[Any] = [row for row in read_table(out, "survey_answers") if row.instrument == "comfort"]
    assert [(row.trial, row.condition, row.value) for row in rows] == [(1, None, "4"), (2, None, "4"), (3, None, "4")]


async def test_what_it_refuses_is_told_by_field_and_its_words_are_kept_apart(start: Callable[..., LabServer]) -> None:
    lab = start()
    made = invite(lab)
    async with visit(made["link"], flow=FLOW) as player:
        page = await player.reach("comfort")
        assert (page.trial, page.content["points"]) == (1, 7)
        refused = await player.refused("comfort", {"sure": 1})
        assert (refused.code, refused.field) == ("invalid", "hard")
        assert (await player.refused("comfort", {"sure": 9})).field == "data.sure"
        await player.done("comfort", {"sure": 1, "hard": "My left hand."})
    ((_, said),) = read(lab, made["participant"], "step_comfort")
    assert said == {"text": "My left hand."}


async def test_who_stands_on_it_is_there_again_after_a_restart_and_a_lab_without_it_says_why_it_does_not_start(
    start: Callable[..., LabServer], start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    lab = start()
    link = invite(lab)["link"]
    async with visit(link, flow=FLOW) as player:
        await player.reach("comfort")
    lab.kill()
    with pytest.raises(LabDidNotStart) as caught:
        start_lab(*SERVE, data_dir=tmp_path / "data")
    (line,) = str(caught.value).splitlines()[1:]
    said = line.removeprefix("salab: P001: ")
    assert said.startswith("stored session of 'P001': state = 'comfort' cannot be; pages are eligibility, ")
    again = start()
    token = link.rpartition("/")[2]
    async with visit(f"{again.base_url}/p/{token}", flow=FLOW) as player:
        assert (await player.reach("comfort")).content["round"] == 1


def test_a_page_without_its_view_is_one_line_and_no_half_started_lab(
    start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    file = copied(tmp_path)
    file.with_suffix(".js").unlink()
    with pytest.raises(LabDidNotStart) as caught:
        start_lab(*SERVE, environment=ENVIRONMENT, program=(str(file),))
    (line,) = str(caught.value).splitlines()[1:]
    assert line.startswith("salab: page 'comfort' of the flow has no view: there is no file ")
