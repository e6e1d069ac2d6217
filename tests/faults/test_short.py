"""The faults that `make test` does, four of them to one lab. How long each takes, `make faults` measures."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.checker import breaches
from tests.faults.play import hit, settled
from tests.faults.row import Setup
from tests.faults.stage import staged
from tests.faults.table import FAULTS

pytestmark = pytest.mark.slow

SHORT = ("kill_worker", "locked", "kill_fork_server+worker", "kill_web")


async def test_a_lab_that_is_killed_and_locked_loses_nothing_doubles_nothing_and_moves_by_nothing_stale(
    tmp_path: Path,
) -> None:
    rows = {fault.name: fault for fault in FAULTS}
    assert {rows[name].setup for name in SHORT} == {Setup()}
    async with staged(Setup(), tmp_path) as stage:
        person = await stage.begin()
        for name in SHORT:
            done = await hit(stage, rows[name])
            assert done.problems == [], name
            for sight in rows[name].participant:
                seen = [one for one in person.memory.seen if one.at_s >= done.began_s and sight.is_it(one)]
                assert seen, f"{name}: the participant was never told: {sight.words}"
        memory, record = await settled(stage, person)
        assert breaches(memory, record) == []
        assert len(memory.ticks) > 10
        assert len(record.words) == 3 * len(SHORT)
