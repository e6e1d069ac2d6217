"""`python -m tests.fuzz [--inputs N] [--seed S] [--only SURFACE]`: generated inputs, and what came of them."""

from __future__ import annotations

import argparse
import contextlib
import logging
import secrets
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from random import Random

from tests.fuzz.files import Files
from tests.fuzz.in_process import InProcessLab
from tests.fuzz.kept_cases import FOLDER, Kept, keep
from tests.fuzz.live import LiveSockets
from tests.fuzz.routes import Routes
from tests.fuzz.sockets import Sockets
from tests.fuzz.surface import Surface

INPUTS = 100_000
SHARES = {"sockets": 0.75, "live": 0.01, "routes": 0.09, "files": 0.15}
"""How the inputs are divided."""
SAID_EVERY_S = 30.0
MOST_KEPT = 20
"""Of one surface: more are more of the same."""


def main() -> int:
    """Run as a program; status 1 when an input went wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("--inputs", type=int, default=INPUTS)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**32))
    parser.add_argument("--only", choices=tuple(SHARES))
    chosen = parser.parse_args()
    logging.lastResort = None  # what is logged is collected and told once
    again = f"make fuzz SEED={chosen.seed} INPUTS={chosen.inputs}"
    print(f"fuzz: seed {chosen.seed}; the same once more: {again}", flush=True)
    counts: Counter[str] = Counter()
    failures: Counter[str] = Counter()
    took_s: dict[str, float] = {}
    where = "/dev/shm" if Path("/dev/shm").is_dir() else None  # every acknowledgement waits for the disk
    for name in SHARES:
        if chosen.only not in (None, name):
            continue
        wanted = chosen.inputs if chosen.only else round(SHARES[name] * chosen.inputs)
        start_s = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="salab-fuzz-", dir=where) as folder, contextlib.ExitStack() as stack:
            surface = _surface(name, Path(folder), stack)
            counts[name], failures[name] = _run(surface, wanted, Random(f"{chosen.seed} {name}"))
        if isinstance(surface, Sockets):
            print(f"sockets: {surface.answered} answers to {counts[name]} frames", flush=True)
        took_s[name] = time.monotonic() - start_s
    print(f"\n{'surface':<10} {'inputs':>8} {'wrong':>6} {'seconds':>8}")
    for name in took_s:
        print(f"{name:<10} {counts[name]:>8} {failures[name]:>6} {took_s[name]:>8.0f}")
    print(f"{'all':<10} {counts.total():>8} {failures.total():>6} {sum(took_s.values()):>8.0f}    seed {chosen.seed}")
    if failures.total():
        print(f"What went wrong is kept in {FOLDER}; `make test` tries it again.", file=sys.stderr)
    return 1 if failures.total() else 0


def _surface(name: str, folder: Path, stack: contextlib.ExitStack) -> Surface:
    if name == "files":
        return Files(folder)
    if name == "live":
        return stack.enter_context(LiveSockets(folder))
    lab = stack.enter_context(InProcessLab(folder / "data"))
    return Routes(lab) if name == "routes" else Sockets(lab)


def _run(surface: Surface, wanted: int, random: Random) -> tuple[int, int]:
    done, wrong, said_s = 0, 0, time.monotonic()
    for given, weight in surface.inputs(wanted, random):
        why = surface.problem(given)
        done += weight
        if why:
            wrong += 1
            if wrong <= MOST_KEPT:
                file = keep(Kept(surface.name, given, why))
                print(f"{surface.name}: {file.name}\n{why[-1_500:]}\n", flush=True)
        if time.monotonic() - said_s > SAID_EVERY_S:
            said_s = time.monotonic()
            print(f"{surface.name}: {done}/{wanted}, {wrong} wrong", flush=True)
    return done, wrong


if __name__ == "__main__":
    sys.exit(main())
