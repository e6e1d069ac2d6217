"""Figures, not tests: `python -m tests.bench [PART ...] [--all]`, which is what `make bench` runs.

Without arguments the short parts run (about two minutes); the long ones run when they are named, or all with `--all`.
"""

from __future__ import annotations

import argparse
import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One line of the table. `aim` is what the figure is held against, if anything."""

    what: str
    value: str
    aim: str = ""


def decision() -> Iterable[Figure]:
    """time of one decision, beside the literal equations"""
    from tests.bench_engine import decision_figures

    return decision_figures()


def robots() -> Iterable[Figure]:
    """headless ticks per second of both robots: whole pick-and-place cycles by the scripted pilot, and their parts"""
    from tests.bench_engine import robot_figures

    return robot_figures()


def live() -> Iterable[Figure]:
    """a real-time session on pybullet: tick-start error, scene payload"""
    from tests.bench_live import live_figures

    return live_figures()


def lockstep() -> Iterable[Figure]:
    """ticks per second through the whole stack, by the scripted client"""
    from tests.bench_live import lockstep_figures

    return lockstep_figures()


def study() -> Iterable[Figure]:
    """a simulated study of twelve on one core and on two"""
    from tests.bench_study import study_figures

    return study_figures()


def analysis() -> Iterable[Figure]:
    """the analysis of a thousand trials"""
    from tests.bench_study import analysis_figures

    return analysis_figures()


def replication() -> Iterable[Figure]:
    """two hundred simulated studies on two cores"""
    from tests.bench_study import replication_figures

    return replication_figures()


SHORT: Mapping[str, Callable[[], Iterable[Figure]]] = {
    part.__name__: part for part in (decision, robots, live, lockstep)
}
LONG: Mapping[str, Callable[[], Iterable[Figure]]] = {part.__name__: part for part in (study, analysis, replication)}
PARTS = {**SHORT, **LONG}


def main() -> None:
    """Run the parts that were asked for, one table each."""
    about = "\n".join(f"  {name:12} {part.__doc__}{' (long)' if name in LONG else ''}" for name, part in PARTS.items())
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench",
        description=f"Measure.\n\n{about}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], metavar="PART", help="which; the short ones if none")
    parser.add_argument("--all", action="store_true", help="the long ones too")
    options = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the lab's workers do
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    print(f"load before: {os.getloadavg()[0]:.1f}")
    for name in list(PARTS) if options.all else options.parts or list(SHORT):
        print(f"\n{PARTS[name].__doc__}\n  $ python -m tests.bench {name}", flush=True)
        started_s = time.perf_counter()
        for figure in PARTS[name]():
            aim = f"   (aim: {figure.aim})" if figure.aim else ""
            print(f"  {figure.what:58} {figure.value:>18}{aim}", flush=True)
        print(f"  [{time.perf_counter() - started_s:.0f} s; load {os.getloadavg()[0]:.1f}]", flush=True)


if __name__ == "__main__":
    main()
