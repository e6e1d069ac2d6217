"""The lab's faults, one after the other: `python -m tests.faults [FAULT ...]`, which is what `make faults` runs.

Without arguments every fault runs but those that take minutes; `--long` adds them. Each has a lab of its own. The end
is a table, the same as JSON in build/faults.json, and an exit code of 1 if any promise was not kept.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
import tempfile
import time
from pathlib import Path

from tests.faults import report
from tests.faults.play import Outcome, hit, judge
from tests.faults.row import CannotRun, Fault
from tests.faults.stage import staged
from tests.faults.table import FAULTS

ROW_WITHIN_S = 600.0


async def run(fault: Fault) -> Outcome:
    """One fault on a lab of its own."""
    with tempfile.TemporaryDirectory(prefix="salab-fault-") as folder:
        try:
            async with staged(fault.setup, Path(folder)) as stage:
                await stage.begin()
                done = await asyncio.wait_for(hit(stage, fault), ROW_WITHIN_S)
                return await judge(stage, done)
        except CannotRun as lacks:
            return Outcome(fault.name, fault.about, fault.part, not_run=str(lacks))
        except (AssertionError, asyncio.TimeoutError) as error:
            return Outcome(fault.name, fault.about, fault.part, problems=(f"{type(error).__name__}: {error}",))


def main() -> None:
    """Run the faults that were asked for."""
    about = "\n".join(f"  {fault.name:24} {fault.about}{' (--long)' if fault.is_long else ''}" for fault in FAULTS)
    parser = argparse.ArgumentParser(
        prog="python -m tests.faults",
        description=f"Do to a lab what happens to labs.\n\n{about}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    names = [fault.name for fault in FAULTS]
    parser.add_argument(
        "faults", nargs="*", choices=[*names, []], metavar="FAULT", help="which; all short ones if none"
    )
    parser.add_argument("--long", action="store_true", help="those that take minutes too")
    options = parser.parse_args()
    wanted = [
        fault
        for fault in FAULTS
        if fault.name in options.faults or (not options.faults and (options.long or not fault.is_long))
    ]
    print(
        f"{len(wanted)} faults, {os.cpu_count()} cores, load before {os.getloadavg()[0]:.1f}\n{report.HEAD}", flush=True
    )
    outcomes: list[Outcome] = []
    started_s = time.monotonic()
    for fault in wanted:
        outcomes.append(asyncio.run(run(fault)))
        print("\n".join([report.line(outcomes[-1]), *report.details(outcomes[-1])]), flush=True)
    red = [one.name for one in outcomes if not one.is_kept]
    print(
        f"\n{len(outcomes)} faults in {time.monotonic() - started_s:.0f} s, load {os.getloadavg()[0]:.1f}; "
        f"red: {', '.join(red) or 'none'}; {report.write(outcomes, 'faults')}"
    )
    sys.exit(1 if red else 0)


if __name__ == "__main__":
    main()
