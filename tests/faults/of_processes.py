"""Processes that are killed, and processes that hang."""

from __future__ import annotations

import asyncio
import os
import sys
import time
from collections.abc import Callable

from app.wire import Tick
from tests.faults import processes
from tests.faults.row import TOLD_S, Fault, event, line, one_sign, sign, unreachable
from tests.faults.stage import Stage
from tests.support.lab_server import ROOT
from tests.support.wire_client import Player, visit

WORKER_WITHIN_S = 20.0
HANGS_S = 5.0
HUNG_S = 3.0 + 1.0
"""From hang to next tick within three seconds; one more is for a machine that does other work."""
HUNG_TOLD_S = HUNG_S
GONE_S = 3.0


async def _appears(look: Callable[[], list[int]]) -> int:
    """The first process that is found; looked for often, to meet it in its first moments."""
    ends_s = time.monotonic() + WORKER_WITHIN_S
    while time.monotonic() < ends_s:
        if found := look():
            return found[0]
        await asyncio.sleep(0.002)
    raise AssertionError("the process that the fault is about was never started")


async def kill_worker(stage: Stage) -> None:
    """A crash in native code."""
    processes.kill(processes.workers(stage.pid)[-1])


async def kill_web(stage: Stage) -> None:
    """Whoever looks after the lab starts it again."""
    began_s = time.monotonic()
    stage.lab.kill()
    await stage.start()
    stage.spent_s = time.monotonic() - began_s


async def kill_fork_server(stage: Stage) -> None:
    """Nobody notices, until the next worker is needed."""
    processes.kill(processes.fork_server(stage.pid))
    await asyncio.sleep(1.0)


async def kill_fork_server_and_worker(stage: Stage) -> None:
    """Both at once: the next worker comes from a fork server that has to be made first."""
    found = processes.workers(stage.pid)
    processes.kill(processes.fork_server(stage.pid))
    processes.kill(found[-1])


async def kill_browser(stage: Stage) -> None:
    """Somebody opens the link again after three seconds."""
    person = stage.person
    person.leave()
    await asyncio.sleep(GONE_S)
    stage.spent_s = GONE_S
    person.begin()


async def hang_worker(stage: Stage) -> None:
    """It neither moves nor ends."""
    worker = processes.workers(stage.pid)[-1]
    processes.stop(worker)
    try:
        await stage.person.until(lambda: worker not in processes.workers(stage.pid), WORKER_WITHIN_S)
        assert worker not in processes.workers(stage.pid), f"the worker was not replaced within {WORKER_WITHIN_S:g} s"
    finally:
        processes.go_on(worker)


async def hang_web(stage: Stage) -> None:
    """It stands for five seconds and goes on, as a machine that swaps."""
    processes.stop(stage.pid)
    await asyncio.sleep(HANGS_S)
    processes.go_on(stage.pid)
    stage.spent_s = HANGS_S


async def hang_fork_server(stage: Stage) -> None:
    """It hangs, and a worker dies."""
    server, worker = processes.fork_server(stage.pid), processes.workers(stage.pid)[-1]
    processes.stop(server)
    processes.kill(worker)
    try:
        back = await stage.person.until(
            lambda: any(heard.at_s > stage.began_s + 1.0 for heard in stage.person.memory.ticks), WORKER_WITHIN_S
        )
        assert back, f"no worker within {WORKER_WITHIN_S:g} s"
    finally:
        processes.go_on(server)


async def hang_before_ready(stage: Stage) -> None:
    """The worker of somebody else hangs before it has said a word."""
    before = set(processes.workers(stage.pid))
    other = await stage.arrive()
    worker = await _appears(lambda: sorted(set(processes.workers(stage.pid)) - before))
    processes.stop(worker)
    began_s = time.monotonic()
    try:
        drives = await other.until(lambda: len(other.memory.ticks) > 0, WORKER_WITHIN_S)
        stage.notes.append(f"from hang to first tick: {time.monotonic() - began_s:.1f} s")
        assert drives, f"the other participant never drove; their page says {other.sign!r}"
        assert time.monotonic() - began_s <= HUNG_S, f"it took {time.monotonic() - began_s:.1f} s, not {HUNG_S:g}"
    finally:
        processes.go_on(worker)
        stage.people.remove(other)
        await other.end()


async def hang_in_lockstep(stage: Stage) -> None:
    """The worker of a scripted client hangs in the midst of its trial."""
    before = set(processes.workers(stage.pid))
    made = await stage.invite(pace="lockstep")
    async with visit(made["link"]) as player:
        await player.reach_trial()
        (worker,) = set(processes.workers(stage.pid)) - before
        last = await player.tick((0, 0, 1))
        processes.stop(worker)
        began_s = time.monotonic()
        try:
            again = await asyncio.wait_for(_next_tick(player), WORKER_WITHIN_S)
        except (AssertionError, asyncio.TimeoutError) as error:
            raise AssertionError(f"the scripted client never got its tick: {error!r}"[:300]) from None
        finally:
            processes.go_on(worker)
        stage.notes.append(f"from hang to next tick: {time.monotonic() - began_s:.1f} s")
        assert again.tick == last.tick + 1, f"tick {again.tick} followed tick {last.tick}"


async def _next_tick(player: Player) -> Tick:
    """What was asked of a worker that hangs is asked once more when there is another one."""
    await player.hands((0, 0, 1))
    await player.status("running")
    return await player.tick((0, 0, 1))


async def kill_report(stage: Stage) -> None:
    """The process that makes the report dies; another one can be made."""
    await stage.asked("POST", "report")
    processes.kill(await _appears(lambda: processes.running(stage.pid, "app.report.job")))
    ends_s = time.monotonic() + WORKER_WITHIN_S
    said = {"state": "making"}
    while said["state"] == "making" and time.monotonic() < ends_s:
        await asyncio.sleep(0.1)
        said = (await stage.asked("GET", "report")).json()
    assert said["state"] == "cannot", f"the report of a killed process is {said}"
    stage.notes.append(f"the dashboard says: {said['text']}")
    left = [path.name for path in stage.data_dir.iterdir() if "report" in path.name]
    stage.notes.append(f"left behind: {left}")
    again = await stage.asked("POST", "report")
    assert again.status_code < 300, f"another report was answered with {again.status_code}"


async def kill_exporter(stage: Stage) -> None:
    """`salab export` dies while it writes: no half an export is left to be taken for a whole one."""
    out, scratch = stage.folder / "export", stage.folder / "tmp"
    scratch.mkdir(exist_ok=True)
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "app", "export", "--data", str(stage.data_dir), "--out", str(out),
        cwd=ROOT, env={**os.environ, "TMPDIR": str(scratch)},
        stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    ends_s = time.monotonic() + WORKER_WITHIN_S
    before = set(stage.folder.iterdir())
    while process.returncode is None and time.monotonic() < ends_s:
        fresh = [*(set(stage.folder.iterdir()) - before), *scratch.iterdir()]
        if any(path.is_file() or any(path.iterdir()) for path in fresh):
            break
        await asyncio.sleep(0.002)
    if process.returncode is None:
        process.kill()
        await process.wait()
    fresh = [*(set(stage.folder.iterdir()) - before), *scratch.iterdir()]
    left = sorted(str(path.relative_to(stage.folder)) for path in fresh)
    stage.notes.append(f"left behind by the killed export: {left or 'nothing'}")
    assert not out.exists(), "half an export lies where a whole one belongs"


async def kill_dashboard_export(stage: Stage) -> None:
    """The process that exports for the dashboard dies: the experimenter is told, and asks again."""
    before = set(processes.children(stage.pid))

    def fresh() -> list[int]:
        found = set(processes.children(stage.pid)) - before
        return sorted(pid for pid in found if "multiprocessing" not in processes.command_of(pid))

    asking = asyncio.create_task(stage.asked("GET", "export"))
    try:
        processes.kill(await _appears(fresh))
        answer = await asking
    finally:
        asking.cancel()
        await asyncio.gather(asking, return_exceptions=True)
    stage.notes.append(f"the experimenter is told: {answer.status_code} {answer.text[:120]}")
    assert answer.status_code >= 400, f"the export of a killed process was answered with {answer.status_code}"
    again = await stage.asked("GET", "export")
    assert again.status_code == 200, f"the next export was answered with {again.status_code}"


ROWS = (
    Fault(
        "kill_worker",
        "a session's process is killed",
        kill_worker,
        downtime_s=3.0,
        part="states",
        participant=(sign("recovering", TOLD_S),),
        experimenter=(event("worker_lost", TOLD_S),),
    ),
    Fault(
        "kill_web",
        "the lab is killed and started again",
        kill_web,
        downtime_s=12.0,
        part="states",
        participant=(sign("lost", TOLD_S), sign("paused", 30.0, "connection")),
        experimenter=(unreachable(TOLD_S),),
    ),
    Fault(
        "kill_browser",
        "the browser is killed; the link is opened again after 3 s",
        kill_browser,
        downtime_s=4.0,
        part="states",
        participant=(sign("paused", 6.0, "connection"),),
        experimenter=(line(TOLD_S, connected=False), line(TOLD_S, state="paused")),
    ),
    Fault(
        "kill_fork_server",
        "the process that workers come from is killed",
        kill_fork_server,
        downtime_s=1.0,
        part="states",
    ),
    Fault(
        "kill_fork_server+worker",
        "the fork server is killed, and a worker",
        kill_fork_server_and_worker,
        downtime_s=6.0,
        part="states",
        participant=(sign("recovering", TOLD_S),),
        experimenter=(event("worker_lost", TOLD_S),),
    ),
    Fault(
        "kill_exporter",
        "`salab export` is killed while it writes",
        kill_exporter,
        downtime_s=1.0,
        part="replay",
    ),
    Fault(
        "kill_dashboard_export",
        "the process that exports for the dashboard is killed",
        kill_dashboard_export,
        downtime_s=1.0,
        part="replay",
    ),
    Fault(
        "kill_report",
        "the process of the report is killed",
        kill_report,
        downtime_s=1.0,
        part="replay",
    ),
    Fault(
        "hang_worker",
        "a session's process hangs",
        hang_worker,
        downtime_s=HUNG_S,
        part="states",
        participant=(one_sign(("recovering", "held"), HUNG_TOLD_S),),
        experimenter=(event("worker_lost", HUNG_TOLD_S),),
    ),
    Fault(
        "hang_before_ready",
        "another session's process hangs before it has said a word",
        hang_before_ready,
        downtime_s=1.0,
        part="states",
    ),
    Fault(
        "hang_in_lockstep",
        "the process of a scripted client hangs",
        hang_in_lockstep,
        downtime_s=1.0,
        part="states",
    ),
    Fault(
        "hang_web",
        "the lab hangs for 5 s",
        hang_web,
        downtime_s=2.0,
        part="states",
        experimenter=(unreachable(3.0),),
    ),
    Fault(
        "hang_fork_server",
        "the fork server hangs, and a worker is killed",
        hang_fork_server,
        downtime_s=8.0,
        part="states",
        participant=(sign("recovering", TOLD_S),),
        experimenter=(event("worker_lost", TOLD_S),),
    ),
)
