"""The view of a page of one's own, in the browser: `docs/examples/08_page`, served from its own folder."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.support.lab_server import LabServer
from tests.support.page_example import ENVIRONMENT, PROGRAM, example_flow
from tests.support.wire_client import invite, read, visit, write_study

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def test_it_is_shown_says_what_is_refused_and_leads_on(
    page: Page, start_lab: Callable[..., LabServer], tmp_path: Path, screenshot_dir: Path
) -> None:
    arguments = ("--robot", "kinematic", "--no-scene", "--study", str(write_study(tmp_path)))
    lab = start_lab(*arguments, environment=ENVIRONMENT, program=PROGRAM)
    made = invite(lab)

    async def go() -> None:
        async with visit(made["link"], flow=example_flow()) as player:
            await player.reach("comfort")

    with ThreadPoolExecutor(1) as pool:  # a loop of its own: the browser's runs in this thread
        pool.submit(asyncio.run, go()).result(60)
    page.goto(made["link"])
    page.get_by_test_id("page-comfort").wait_for(state="visible")
    assert page.get_by_role("heading", name="Before round 1").count() == 1
    go_on = page.get_by_test_id("comfort-submit")
    go_on.click()
    page.get_by_text("Please choose a point of the scale.").wait_for(state="visible")
    page.get_by_role("radio", name="3").check()
    page.get_by_role("radio", name="1").check()
    go_on.click()
    page.get_by_text("Please say what is hard, so that we can help.").wait_for(state="visible")
    page.screenshot(path=screenshot_dir / "page_of_ones_own.png")
    page.get_by_test_id("comfort-hard").fill("Seeing how far away things are.")
    go_on.click()
    page.get_by_test_id("page-drive").wait_for(state="visible")
    page.wait_for_function("salab.socket.outbox.waiting().length === 0")  # what it sent after that is on disk too
    ((_, said),) = read(lab, made["participant"], "step_comfort")
    assert said == {"text": "Seeing how far away things are."}
    ((_, noted),) = read(lab, made["participant"], "page.own.changed")
    assert noted == {"times": 1, "role": "participant"}
