"""Figures, not tests: `python -m tests.bench [PART ...]`, which is what `make bench` runs.

Without arguments all parts run (about eight minutes), except those that take as long again: name them, or say `--all`.
"""

from __future__ import annotations

import argparse
import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping

from tests.bench.figure import Figure


def decision() -> Iterable[Figure]:
    """time of one decision, beside the literal equations"""
    from tests.bench.engine import decision_figures

    return decision_figures()


def robots() -> Iterable[Figure]:
    """headless ticks per second of each robot: whole pick-and-place cycles by the scripted pilot, and their parts"""
    from tests.bench.engine import robot_figures

    return robot_figures()


def bounds() -> Iterable[Figure]:
    """what a simulated study's ticks and rows take at least, however the arithmetic is done"""
    from tests.bench.bounds import bound_figures

    return bound_figures()


def physics() -> Iterable[Figure]:
    """how near its way the arm is on each physics, and how far objects slip in the fingers"""
    from tests.bench.physics import physics_figures

    return physics_figures()


def live() -> Iterable[Figure]:
    """a real-time session on pybullet: tick-start error, scene payload"""
    from tests.bench.live import live_figures

    return live_figures()


def pictures() -> Iterable[Figure]:
    """pictures a second of the driving page in a browser, with the inset and without"""
    from tests.bench.pictures import picture_figures

    return picture_figures()


def press() -> Iterable[Figure]:
    """from a press to the robot's first motion and to the first changed picture, in a browser"""
    from tests.bench.press import press_figures

    return press_figures()


def depth() -> Iterable[Figure]:
    """objects picked up by somebody who sees the pictures alone, with the inset and without"""
    from tests.bench.depth import depth_figures

    return depth_figures()


def lockstep() -> Iterable[Figure]:
    """ticks a second through the whole stack, and studies a minute, by scripted clients"""
    from tests.bench.lockstep import lockstep_figures

    return lockstep_figures()


def databases() -> Iterable[Figure]:
    """ticks that are committed, alone and by many sessions at once, in a data folder and on a PostgreSQL server"""
    from tests.bench.databases import database_figures

    return database_figures()


def start() -> Iterable[Figure]:
    """a lab until it is ready, a session until its robot is, and what a session takes of memory"""
    from tests.bench.start import start_figures

    return start_figures()


def study() -> Iterable[Figure]:
    """a simulated study of twelve on one core and on two"""
    from tests.bench.study import study_figures

    return study_figures()


def analysis() -> Iterable[Figure]:
    """the analysis of a thousand trials"""
    from tests.bench.study import analysis_figures

    return analysis_figures()


def replication() -> Iterable[Figure]:
    """many simulated studies on one core and on two, from a sample"""
    from tests.bench.study import replication_figures

    return replication_figures()


def memory() -> Iterable[Figure]:
    """what simulating and replicating take of memory, for a hundred trials and for a thousand"""
    from tests.bench.study import memory_figures

    return memory_figures()


def whole() -> Iterable[Figure]:
    """two hundred simulated studies on two cores, all of them"""
    from tests.bench.study import whole_figures

    return whole_figures()


USUAL = (decision, robots, bounds, physics, live, pictures, press, depth, lockstep, start, study, analysis, replication)
PARTS: Mapping[str, Callable[[], Iterable[Figure]]] = {
    part.__name__: part for part in (*USUAL, databases, memory, whole)
}
ON_REQUEST = ("databases", "memory", "whole")


def main() -> None:
    """Run the parts that were asked for, one table each."""
    about = "\n".join(
        f"  {name:12} {part.__doc__}{' (on request)' if name in ON_REQUEST else ''}" for name, part in PARTS.items()
    )
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench",
        description=f"Measure.\n\n{about}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "parts", nargs="*", choices=[*PARTS, []], metavar="PART", help="which; all but those on request if none"
    )
    parser.add_argument("--all", action="store_true", help="those on request too")
    options = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the lab's workers do
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    print(f"load before: {os.getloadavg()[0]:.1f}")
    usual = [name for name in PARTS if name not in ON_REQUEST]
    for name in list(PARTS) if options.all else options.parts or usual:
        print(f"\n{PARTS[name].__doc__}\n  $ python -m tests.bench {name}", flush=True)
        started_s = time.perf_counter()
        for figure in PARTS[name]():
            aim = f"   (aim: {figure.aim})" if figure.aim else ""
            print(f"  {figure.what:58} {figure.value:>18}{aim}", flush=True)
        print(f"  [{time.perf_counter() - started_s:.0f} s; load {os.getloadavg()[0]:.1f}]", flush=True)


if __name__ == "__main__":
    main()
