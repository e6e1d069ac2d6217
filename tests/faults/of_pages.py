"""What happens to a page in a real browser: the lab goes, the lid is closed, the renderer hangs, the browser dies."""

from __future__ import annotations

import asyncio
import time

from tests.faults import processes
from tests.faults.of_storage import FULL_S, STALLED, disk_full
from tests.faults.page import PagePerson
from tests.faults.row import TOLD_S, Fault, Setup, board, line, one_sign, sign, trouble, unreachable
from tests.faults.stage import Stage
from tests.support.wire_client import SHORT

LID_S = 8.0
HANGS_S = 5.0
GONE_S = 3.0
QUIET = {**SHORT, "enabled = true": "enabled = false"}
"""No readings: the keyboard belongs to the arm."""


def _at_page(stage: Stage) -> PagePerson:
    assert isinstance(stage.person, PagePerson)
    return stage.person


async def page_kill_web(stage: Stage) -> None:
    """The lab is killed and started again."""
    began_s = time.monotonic()
    stage.lab.kill()
    await stage.start()
    stage.spent_s = time.monotonic() - began_s


async def page_lid_closed(stage: Stage) -> None:
    """Everything of the browser stands still with a key held down, and the key is let go of where nobody hears it."""
    person = _at_page(stage)
    person.keys_work = False
    (browser,) = await person.process_ids("browser")
    asleep = [browser, *processes.descendants(browser)]
    for pid in asleep:
        processes.stop(pid)
    await asyncio.sleep(LID_S)
    for pid in reversed(asleep):
        processes.go_on(pid)
    person.keys_work = True
    stage.spent_s = LID_S


async def page_renderer_hangs(stage: Stage) -> None:
    """The page's process stands still, as on a computer that swaps."""
    renderers = await _at_page(stage).process_ids("renderer")
    for pid in renderers:
        processes.stop(pid)
    await asyncio.sleep(HANGS_S)
    for pid in renderers:
        processes.go_on(pid)
    stage.spent_s = HANGS_S


async def page_killed(stage: Stage) -> None:
    """The browser's process is killed; the link is opened in another one."""
    person = _at_page(stage)
    (pid,) = await person.process_ids("browser")
    processes.kill(pid)
    person.leave()
    await asyncio.sleep(GONE_S)
    stage.spent_s = GONE_S
    person.begin()


async def page_two_tabs(stage: Stage) -> None:
    """The link is opened in another tab; then the first takes the session back."""
    person = _at_page(stage)
    other = await person.another_tab()
    await person.until(lambda: person.sign == "superseded", 5.0)
    await other.close()
    assert person.tab is not None
    await person.tab.bring_to_front()
    await person.tab.get_by_test_id("take-over").click(timeout=5_000)


AT_PAGE = Setup(study=QUIET, in_page=True)

ROWS = (
    Fault(
        "page_kill_web",
        "at a page: the lab is killed and started again",
        page_kill_web,
        downtime_s=12.0,
        part="states",
        participant=(sign("lost", TOLD_S), sign("paused", 30.0, "connection")),
        experimenter=(unreachable(TOLD_S), board("Not up to date", 6.0)),
        setup=AT_PAGE,
    ),
    Fault(
        "page_lid_closed",
        "at a page: the computer sleeps for 8 s with a key held down",
        page_lid_closed,
        downtime_s=3.0,
        part="states",
        experimenter=(line(TOLD_S, held=True), board("robot holds", TOLD_S + 1.0)),
        setup=AT_PAGE,
    ),
    Fault(
        "page_renderer_hangs",
        "at a page: its process hangs for 5 s",
        page_renderer_hangs,
        downtime_s=3.0,
        part="states",
        experimenter=(line(TOLD_S, held=True),),
        setup=AT_PAGE,
    ),
    Fault(
        "page_killed",
        "at a page: the browser is killed, and opened again after 3 s",
        page_killed,
        downtime_s=12.0,
        part="states",
        participant=(sign("paused", 30.0, "connection"),),
        experimenter=(line(TOLD_S, connected=False), board("Not connected", TOLD_S + 1.0)),
        setup=AT_PAGE,
    ),
    Fault(
        "page_two_tabs",
        "at a page: another tab takes over, and the first takes it back",
        page_two_tabs,
        downtime_s=6.0,
        part="states",
        participant=(sign("superseded", 3.0),),
        setup=AT_PAGE,
    ),
    Fault(
        "page_disk_full",
        f"at a page: the disk is full for {FULL_S:g} s",
        disk_full,
        downtime_s=3.0,
        part="states",
        participant=(one_sign(STALLED, TOLD_S),),
        experimenter=(trouble(("full",), TOLD_S), board("full", TOLD_S + 1.0)),
        setup=Setup(study=QUIET, in_page=True, disk="small"),
    ),
)
