"""The outcomes as a table for people, and as JSON."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path

from tests.faults.checker import counts
from tests.faults.play import Outcome

BUILD = Path(__file__).resolve().parents[2] / "build"


def line(outcome: Outcome) -> str:
    """One row of the table."""
    if outcome.not_run:
        return f"  {outcome.name:24} NOT RUN: {outcome.not_run}"
    found = counts(outcome.breaches)
    kept = "ok" if outcome.is_kept else "RED"
    still = "-" if outcome.standstill_s is None else f"{outcome.standstill_s:.1f}"
    return (
        f"  {outcome.name:24} {kept:4} {_soonest(outcome.told_participant):>8} {_soonest(outcome.told_experimenter):>8}"
        f" {outcome.fault_s:>7.1f} {still:>7} {outcome.allowed_s:>8.1f} {outcome.ticks:>6}"
        f" {found['lost']:>5} {found['doubled']:>8} {found['stale']:>6} {found['export']:>7}"
    )


HEAD = (
    f"  {'fault':24} {'':4} {'person':>8} {'exper.':>8} {'fault':>7} {'still':>7} {'allowed':>8} {'ticks':>6}"
    f" {'lost':>5} {'doubled':>8} {'stale':>6} {'export':>7}\n"
    f"  {'':24} {'':4} {'told s':>8} {'told s':>8} {'s':>7} {'s':>7} {'s':>8} {'held':>6}"
)


def _soonest(told: Sequence[tuple[str, float | None]]) -> str:
    """When the last of them was told; "-" where nothing had to be."""
    if not told:
        return "-"
    times_s = [after_s for _, after_s in told]
    known_s = [after_s for after_s in times_s if after_s is not None]
    return f"{max(known_s):.1f}" if len(known_s) == len(times_s) else "never"


def details(outcome: Outcome) -> list[str]:
    """What was wrong, and what else is worth knowing."""
    lines = [f"      {breach.promise}: {breach.text}" for breach in outcome.breaches[:5]]
    lines += [f"      … {len(outcome.breaches) - 5} more"] if len(outcome.breaches) > 5 else []
    lines += [f"      {problem}" for problem in outcome.problems]
    lines += [f"      ({note})" for note in outcome.notes]
    return lines


def write(outcomes: Sequence[Outcome], name: str) -> Path:
    """All of it into build/NAME.json."""
    BUILD.mkdir(exist_ok=True)
    path = BUILD / f"{name}.json"
    machine = {"cores": os.cpu_count(), "python": platform.python_version(), "load": os.getloadavg()[0]}
    path.write_text(json.dumps({"machine": machine, "faults": [one.as_json() for one in outcomes]}, indent=1) + "\n")
    return path
