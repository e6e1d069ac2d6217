"""`make test-pythons`: the other Pythons found here, and the wheels of other systems. Says aloud what is not tried."""

from __future__ import annotations

import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from app.trial.robots import ROBOTS
from tests.pythons.interpreters import interpreter, versions
from tests.pythons.one_python import ROOT, Failed, OnePython, simulated
from tests.pythons.platforms import without_wheels

AT_A_TIME = 2


@dataclass(frozen=True)
class Told:
    """What there is to say of one Python, line by line, and how much of it is not as it should be."""

    lines: tuple[str, ...]
    failures: int = 0


def main(asked: Sequence[str]) -> int:
    """Try those that are asked for, or all but this one. Ends with 1 when anything is not as it should be."""
    ours = ".".join(platform.python_version_tuple()[:2])
    tried = asked or sorted(set(versions()) - {ours}, key=lambda name: int(name.partition(".")[2]))
    failures = 0
    with tempfile.TemporaryDirectory(prefix="salab-pythons-") as place, ThreadPoolExecutor(AT_A_TIME) as several:
        folder = Path(place)
        build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
        subprocess.run(build, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        (wheel,) = folder.glob("*.whl")
        here = [name for name in ROBOTS.shipped if not ROBOTS.lacking(name)]
        did = {robot: simulated(sys.executable, robot, folder, ROOT) for robot in here}
        for told in several.map(lambda version: _one(version, folder / version, wheel, did), tried):
            print("\n".join(told.lines), flush=True)
            failures += told.failures
    failures += _wheels()
    print(f"{failures} failures")
    return 1 if failures else 0


def _one(version: str, own: Path, wheel: Path, did: Mapping[str, str]) -> Told:
    found = interpreter(version)
    if found is None:
        return Told((f"Python {version}: NOT TESTED, there is none here",))
    own.mkdir()
    one = OnePython(version, own)
    lines, failures = [f"Python {version}: {found}"], 0
    try:
        lines.append(f"  {one.installed(found, wheel)}")
        checks = list(_checks(one, did))
    except Failed as failure:
        return Told((*lines, f"  NOT INSTALLED: {failure}"), 1)
    for check in checks:
        try:
            lines.append(f"  {check()}")
        except Failed as failure:
            lines.append(f"  FAILED: {failure}")
            failures += 1
    return Told(tuple(lines), failures)


def _checks(one: OnePython, did: Mapping[str, str]) -> Iterator[Callable[[], str]]:
    """What is asked of a Python that the lab is installed on; `did` is what simulated people did on this one."""
    yield one.tested
    yield one.keeps_contracts
    for robot in one.robots():
        if robot in did:
            yield partial(_same, one, robot, did[robot])
        if robot != "kinematic":
            yield partial(one.studied, robot)


def _same(one: OnePython, robot: str, did: str) -> str:
    if simulated(one.python, robot, one.folder) != did:
        raise Failed(f"{robot}: a simulated participant did something else than on this Python")
    return f"{robot}: a simulated participant does the same, bit for bit"


def _wheels() -> int:
    """How many Pythons and systems lack a wheel; prints which."""
    try:
        lacking = list(without_wheels(versions()))
    except ConnectionError as error:
        print(f"Wheels of other systems: NOT TESTED, no package index can be asked ({error})", flush=True)
        return 0
    for line in lacking:
        print(f"FAILED: {line}", flush=True)
    if not lacking:
        print("Wheels of other systems: everything that the lab needs has one, on every Python and system", flush=True)
    return len(lacking)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
