"""Half an hour of a lab's life, with a fault every twenty seconds: `python -m tests.soak`, which `make soak` runs.

The end is what was done, the memory curve, counts that must be equal, and an exit code of 1 if anything is not as it
should be. build/soak.json has all of it.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.faults.checker import breaches
from tests.faults.row import Fault, Setup
from tests.faults.stage import Stage, staged
from tests.faults.table import FAULTS
from tests.soak.crowd import Crowd
from tests.soak.memory import FLAT, Curve, drawn, flatness

BUILD = Path(__file__).resolve().parents[2] / "build"
USUAL = (
    "kill_worker", "hang_worker", "kill_browser", "kill_fork_server", "kill_fork_server+worker", "locked", "cut_2s",
    "disk_full", "hang_web",
)  # fmt: skip
STARTS_AGAIN = "kill_web"
WARM_S, COLD = 660.0, 0.9
"""From this time to this share of the whole the web process is one and the same, and its memory counts. Before, it is
not warm: a session whose participant has finished is kept for ten minutes."""
JUDGED_S = 120.0
"""A shorter stretch says nothing."""
LAB = Setup(is_network_bad=True, disk="small", disk_mb=512)
WAY_S = 0.5
"""How long what pages say may be on its way: two cores have a crowd to serve."""
SETTLES_S = 10.0


@dataclass
class Soaked:
    """What came of it."""

    seed: int
    minutes: float
    people: int
    faults: list[dict[str, Any]] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    breaches: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    memory: dict[str, Any] = field(default_factory=dict)


def drawn_faults(rng: np.random.Generator, total_s: float, every_s: float) -> Iterator[tuple[float, Fault]]:
    """When which fault is done: each of the usual ones in turn, in an order that is drawn anew for every round."""
    rows = {fault.name: fault for fault in FAULTS}
    yield every_s, rows[STARTS_AGAIN]
    at_s, waiting = 2 * every_s, list[str]()
    while at_s < total_s * COLD:
        waiting = waiting or [str(name) for name in rng.permutation(USUAL)]
        yield at_s, rows[waiting.pop()]
        at_s += every_s
    yield at_s, rows[STARTS_AGAIN]


async def soak(options: argparse.Namespace, folder: Path) -> Soaked:
    """The run."""
    total_s = 60.0 * options.minutes
    result = Soaked(options.seed, options.minutes, options.people)
    rng = np.random.default_rng(options.seed)
    async with staged(LAB, folder) as stage:
        await stage.begin_driving()
        crowd, curve = Crowd(stage, options.people), Curve(lambda: stage.pid)
        tasks = [asyncio.create_task(crowd.keep_up()), asyncio.create_task(curve.look())]
        began_s = time.monotonic()
        for at_s, fault in drawn_faults(rng, total_s, options.every):
            await asyncio.sleep(max(0.0, began_s + at_s - time.monotonic()))
            done = await _hit(stage, fault, rng, began_s)
            result.faults.append(done)
            print(f"  {done['at_s'] / 60:5.1f} min  {fault.name:24} {done['said']}", flush=True)
        await asyncio.sleep(max(SETTLES_S, began_s + total_s - time.monotonic()))
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await _hold_against_the_record(stage, crowd, result)
    _judge(curve, total_s, result)
    print("\n".join(drawn(curve.samples, max(30.0, total_s / 30))))
    return result


def _judge(curve: Curve, total_s: float, result: Soaked) -> None:
    """Whether the memory is flat, where the run was long enough to tell."""
    result.memory = {"samples": [asdict(sample) for sample in curve.samples]}
    if COLD * total_s - WARM_S < JUDGED_S:
        print(f"  memory is not judged: a run of {total_s / 60:g} min is too short for it")
        return
    try:
        flat = flatness(curve.samples, WARM_S, COLD * total_s)
        result.memory |= {**asdict(flat), "is_flat": flat.is_flat}
        if not flat.is_flat:
            far = f"{-flat.below:+.1%} to {flat.above:+.1%}"
            result.problems.append(f"memory is not flat: {far}, ±{FLAT:.0%} are allowed")
    except ValueError as error:
        result.problems.append(str(error))


async def _hit(stage: Stage, fault: Fault, rng: np.random.Generator, began_s: float) -> dict[str, Any]:
    """One fault to one of those who drive."""
    if stage.people:
        first = int(rng.integers(len(stage.people)))
        stage.people.insert(0, stage.people.pop(first))
    stage.began_s, stage.notes = time.monotonic(), []
    said = "done"
    try:
        await fault.does(stage)
    except Exception as error:  # a fault that finds nothing to be done to says so, and the run goes on
        said = f"{type(error).__name__}: {error}"[:200]
    return {"at_s": stage.began_s - began_s, "fault": fault.name, "said": said}


async def _hold_against_the_record(stage: Stage, crowd: Crowd, result: Soaked) -> None:
    """Everybody's memory against the record and one export."""
    for person in stage.people:
        await person.hold(None)
        await stage.asked("POST", f"sessions/{person.name}/pause", {"reason": None})
    await asyncio.sleep(SETTLES_S)
    exported = await stage.export()
    counts: Counter[str] = Counter(people=len(crowd.everybody), finished=len(crowd.gone))
    for person in crowd.everybody:
        record = await asyncio.to_thread(stage.evidence, person, exported)
        memory = person.remembered()
        counts["ticks acknowledged"] += len(memory.ticks)
        counts["ticks stored"] += len(record.ticks)
        counts["ticks exported"] += len(record.exported_ticks or ())
        counts["submissions acknowledged"] += len(memory.acknowledged)
        counts["submissions stored"] += len(record.submissions)
        for breach in breaches(memory, record, WAY_S):
            result.breaches.append(f"{person.name}: {breach.promise}: {breach.text}")
    result.counts = dict(counts)
    if counts["ticks stored"] != counts["ticks exported"]:
        result.problems.append("what is stored is not what is exported")
    if counts["submissions acknowledged"] != counts["submissions stored"]:
        result.problems.append("not every submission that was acknowledged is stored")
    stuck = [person.name for person in stage.people if person.sign not in ("paused", "ready", "running", "held", "")]
    if stuck:
        result.problems.append(f"stuck at the end: {', '.join(stuck)}")


def main() -> None:
    """Soak a lab."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--minutes", type=float, default=30.0, help="how long (30)")
    parser.add_argument("--people", type=int, default=8, help="how many drive at a time (8)")
    parser.add_argument("--every", type=float, default=20.0, help="seconds from fault to fault (20)")
    parser.add_argument("--seed", type=int, default=1, help="draws the order of the faults (1)")
    options = parser.parse_args()
    plan = f"{options.people} participants, {options.minutes:g} min, a fault every {options.every:g} s"
    print(f"{plan}, seed {options.seed}", flush=True)
    with tempfile.TemporaryDirectory(prefix="salab-soak-") as folder:
        result = asyncio.run(soak(options, Path(folder)))
    BUILD.mkdir(exist_ok=True)
    (BUILD / "soak.json").write_text(json.dumps(asdict(result), indent=1) + "\n", encoding="utf-8")
    for name, count in result.counts.items():
        print(f"  {name:26} {count}")
    memory = result.memory
    if "mean_bytes" in memory:
        window = f"from {memory['from_s'] / 60:.0f} to {memory['to_s'] / 60:.0f} min"
        far = f"{-memory['below']:+.1%} to {memory['above']:+.1%}"
        print(f"  memory of the web process  {memory['mean_bytes'] / 2**20:.1f} MB on average {window}, {far}")
    for line in (*result.breaches[:20], *result.problems):
        print(f"  WRONG: {line}")
    print(f"load {os.getloadavg()[0]:.1f}; {BUILD / 'soak.json'}")
    sys.exit(1 if result.breaches or result.problems else 0)


if __name__ == "__main__":
    main()
