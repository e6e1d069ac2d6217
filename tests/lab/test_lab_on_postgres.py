"""A lab whose data a server keeps: a whole study, killed in mid-trial, and a server that is away for a while."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from app.__main__ import main
from app.simulated.bot import run_bot
from app.simulated.connection import BotError, enter, open_wire
from app.wire import Saves, Tick
from study.export.verification import verify_export
from study.store import DataPlace, copy, verify_data
from tests.lab.test_lab_restart import at, contiguous, drive, ticks
from tests.support.data_places import typed
from tests.support.lab_server import LabServer
from tests.support.local_lab import RIGHT
from tests.support.postgres_server import PostgresServer
from tests.support.wire_client import events, invite, seen_by_experimenter, visit, write_study

pytestmark = pytest.mark.slow
AWAY_S = 2.0


@pytest.fixture
def launch(
    start_lab: Callable[..., LabServer], tmp_path: Path, own_postgres: PostgresServer
) -> Callable[..., LabServer]:
    """Starts a lab with the short study, always on the same database."""
    study, url = str(write_study(tmp_path)), own_postgres.url(own_postgres.database())

    def start(pace: str = "lockstep") -> LabServer:
        arguments = ("--robot", "kinematic", "--pace", pace, "--no-scene", "--study", study)
        return start_lab(*arguments, data_dir=tmp_path / "own", url=url)

    return start


async def test_a_whole_study_is_exported_as_a_data_folder_with_the_same_record_is(
    launch: Callable[..., LabServer], tmp_path: Path
) -> None:
    lab = launch()
    made = invite(lab, label="somebody")
    await run_bot(made["link"])
    assert seen_by_experimenter(lab, made["participant"])["state"] == "done"
    assert main(["export", "--data", typed(lab.data), "--out", str(tmp_path / "beside")]) == 0  # while it runs
    lab.close()
    assert verify_data(lab.data).findings == ()
    assert not (Path.cwd() / "data" / "lab.sqlite").exists() and not (lab.data_dir / "lab.sqlite").exists()

    folder = DataPlace(tmp_path / "folder")
    copy(lab.data, folder)
    for name, place in (("server", lab.data), ("file", folder)):
        assert main(["export", "--data", typed(place), "--out", str(tmp_path / name)]) == 0
        assert not verify_export(tmp_path / name).findings
    files = sorted(path.name for path in (tmp_path / "server").iterdir())
    assert files == sorted(path.name for path in (tmp_path / "file").iterdir()) and "ticks.csv" in files
    for name in files:
        assert (tmp_path / "server" / name).read_bytes() == (tmp_path / "file" / name).read_bytes(), name


async def test_a_killed_lab_loses_no_tick_that_was_acknowledged_and_goes_on(launch: Callable[..., LabServer]) -> None:
    lab = launch()
    made = invite(lab)
    async with visit(made["link"]) as player:
        await player.reach_trial()
        last = await drive(player, 9)
        lab.kill()
    assert len(ticks(lab, made["participant"])) == last.tick + 1
    again = launch()
    async with visit(at(again, made["link"])) as player:
        await player.page("paused")
        await player.done("resume")
        await player.status("running")
        assert (await player.tick(RIGHT)).tick == last.tick + 1
    rows = ticks(again, made["participant"])
    assert contiguous(rows) and len(rows) == last.tick + 2
    assert not events(again, made["participant"], "replay_mismatch")
    again.close()
    assert verify_data(again.data).findings == ()


async def test_a_server_that_is_away_holds_the_robot_and_lets_it_go_on(
    launch: Callable[..., LabServer], own_postgres: PostgresServer
) -> None:
    lab = launch("real_time")
    made = invite(lab)
    access = await enter(made["link"])
    async with visit(made["link"]) as player:
        await player.reach("trial_ready")
        await player.status("ready")
        await player.done("start")
        async with player.beating():
            await player.until(Tick)
            await asyncio.to_thread(own_postgres.stop)
            told = await player.until(Saves, lambda saves: not saves.works)
            assert told.text and "Nothing is lost" in told.text
            acknowledged = player.heard(Tick)[-1].tick
            with pytest.raises(BotError):  # a page that comes now is not let in, and asks again
                async with open_wire(access, "second"):
                    pass
            page = await asyncio.to_thread(httpx.get, made["link"], headers={"Accept": "text/html"}, trust_env=False)
            assert page.status_code == 503 and int(page.headers["Refresh"]) > 0
            await asyncio.sleep(AWAY_S)
            assert player.heard(Tick)[-1].tick <= acknowledged + 1  # it stood still
            await asyncio.to_thread(own_postgres.start)
            await player.until(Saves, lambda saves: saves.works)
            goes_on = await player.until(Tick, lambda tick: tick.tick > acknowledged + 1)
    rows = ticks(lab, made["participant"])
    assert contiguous(rows) and len(rows) >= goes_on.tick + 1
    lab.close()
    assert "Traceback" not in lab.log() and "Exception" not in lab.log()
    assert verify_data(lab.data).findings == ()
