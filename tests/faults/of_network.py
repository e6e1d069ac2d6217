"""The network between a page and the lab: cut, slow, losing; and pages that are there twice or no more."""

from __future__ import annotations

import asyncio

from tests.faults.person import Person
from tests.faults.proxy import GOOD, BadNetwork, Line
from tests.faults.row import TOLD_S, Fault, Setup, line, panel, sign
from tests.faults.stage import Stage

SHORT_CUT_S, CUT_S, LONG_CUT_S = 2.0, 20.0, 300.0
SLOW = Line(delay_s=0.080, jitter_s=0.020, loss=0.02)
SLOW_S = 20.0
AWAY_S = 6.0


def _network(stage: Stage) -> BadNetwork:
    assert stage.network is not None
    return stage.network


async def _cut(stage: Stage, for_s: float) -> None:
    network = _network(stage)
    network.cut()
    await asyncio.sleep(for_s)
    network.mend()
    stage.spent_s = for_s


async def cut_short(stage: Stage) -> None:
    """Nobody's connection is lost for so short a time; the robot holds."""
    await _cut(stage, SHORT_CUT_S)


async def cut(stage: Stage) -> None:
    """Longer than a page waits for a word."""
    await _cut(stage, CUT_S)


async def cut_long(stage: Stage) -> None:
    """Longer than anybody waits."""
    await _cut(stage, LONG_CUT_S)


async def slow(stage: Stage) -> None:
    """A bad radio link: both ways 80 ± 20 ms, and two pieces in a hundred are sent again."""
    network = _network(stage)
    network.line = SLOW
    await asyncio.sleep(1.0)
    for direction in ((1, 0, 0), None, (0, -1, 0), None, (0, 0, -1), None) * 2:
        await stage.person.hold(direction)
        await asyncio.sleep(SLOW_S / 12)
    network.line = GOOD
    stage.notes.append(f"{network.lost} pieces were sent again")


async def two_tabs(stage: Stage) -> None:
    """The link is opened a second time; the first tab then takes the session back."""
    first = stage.person
    second = Person(first.link, f"{first.name}-second", first.address)
    second.begin()
    taken = await first.until(lambda: first.sign == "superseded", 5.0)
    drives = await second.ticks(2, 10.0)
    await second.hold((1, 0, 0))
    drives = await second.ticks(2, 10.0) and drives
    await second.hold(None)
    await second.ticks(2, 5.0)
    assert taken, "the first tab was not told that another one took over"
    assert drives, f"the second tab did not drive; it says {second.sign!r}"
    first.take_back(second)
    await first.until(lambda: second.sign == "superseded", 5.0)
    await second.end()
    assert second.sign == "superseded", "the second tab was not told that the first took over"


async def second_device_lost(stage: Stage) -> None:
    """The laptop two metres away goes to sleep and wakes up again."""
    device = stage.person.second_device
    assert device is not None
    device.leave()
    await asyncio.sleep(AWAY_S)
    device.begin()


BAD_NETWORK = Setup(is_network_bad=True)

ROWS = (
    Fault(
        "cut_2s",
        "the network is cut for 2 s",
        cut_short,
        downtime_s=2.0,
        part="states",
        setup=BAD_NETWORK,
        way_s=0.1,
        experimenter=(line(TOLD_S, held=True),),
    ),
    Fault(
        "cut_20s",
        "the network is cut for 20 s",
        cut,
        downtime_s=12.0,
        part="states",
        setup=BAD_NETWORK,
        way_s=0.1,
        participant=(sign("lost", 12.0),),
        experimenter=(line(TOLD_S, held=True),),
    ),
    Fault(
        "cut_5min",
        "the network is cut for five minutes",
        cut_long,
        downtime_s=12.0,
        part="states",
        setup=BAD_NETWORK,
        way_s=0.1,
        participant=(sign("lost", 12.0),),
        experimenter=(line(TOLD_S, held=True), line(90.0, connected=False)),
        is_long=True,
    ),
    Fault(
        "slow",
        "both ways take 80 ± 20 ms and lose 2 %",
        slow,
        downtime_s=2.0,
        part="states",
        setup=BAD_NETWORK,
        way_s=1.2,
    ),
    Fault(
        "two_tabs",
        "the link is opened in a second tab, then in the first again",
        two_tabs,
        downtime_s=3.0,
        part="states",
        participant=(sign("superseded", TOLD_S),),
    ),
    Fault(
        "second_device_lost",
        "the second device is away for 6 s",
        second_device_lost,
        downtime_s=1.0,
        part="states",
        participant=(panel("gone", TOLD_S), panel("connected", 12.0)),
        experimenter=(line(TOLD_S, panel_missing=True),),
        setup=Setup(second_device=True),
    ),
)
