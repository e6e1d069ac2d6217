"""`make test-pythons`: the other Pythons found here, and the wheels of other systems. Says aloud what is not tried."""

from __future__ import annotations

import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from tests.pythons.interpreters import interpreter, versions
from tests.pythons.one_python import ROOT, Failed, OnePython, simulated
from tests.pythons.platforms import without_wheels


def main(asked: Sequence[str]) -> int:
    """Try those that are asked for, or all. Ends with 1 when anything is not as it should be."""
    ours = ".".join(platform.python_version_tuple()[:2])
    tried = asked or sorted(set(versions()) - {ours}, key=lambda name: int(name.partition(".")[2]))
    failures: list[str] = []
    with tempfile.TemporaryDirectory(prefix="salab-pythons-") as place:
        folder = Path(place)
        subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder], cwd=ROOT, check=True)
        (wheel,) = folder.glob("*.whl")
        digests: dict[str, str] = {}
        for version in tried:
            found = interpreter(version)
            if found is None:
                print(f"Python {version}: NOT TESTED, there is none here", flush=True)
                continue
            own = folder / version
            own.mkdir()
            one = OnePython(version, own)
            print(f"Python {version}: {found}", flush=True)
            try:
                print(f"  {one.installed(found, wheel)}", flush=True)
            except Failed as failure:
                failures.append(f"Python {version}: {failure}")
                print(f"  NOT INSTALLED: {failure}", flush=True)
                continue
            for check in checks(one, digests, folder):
                try:
                    print(f"  {check()}", flush=True)
                except Failed as failure:
                    failures.append(f"Python {version}: {failure}")
                    print(f"  FAILED: {failure}", flush=True)
    failures += wheels()
    print(f"{len(failures)} failures")
    return 1 if failures else 0


def checks(one: OnePython, digests: dict[str, str], folder: Path) -> Iterator[Callable[[], str]]:
    """What is asked of a Python that the lab is installed on; `digests` are of what this Python simulates."""
    yield one.tested
    for robot in one.robots():
        yield partial(_same, one, robot, digests, folder)
        if robot != "kinematic":
            yield partial(one.studied, robot)


def _same(one: OnePython, robot: str, digests: dict[str, str], folder: Path) -> str:
    if robot not in digests:
        digests[robot] = simulated(sys.executable, robot, folder, ROOT)
    if simulated(one.python, robot, one.folder) != digests[robot]:
        raise Failed(f"{robot}: a simulated participant did something else than on this Python")
    return f"{robot}: a simulated participant does the same, bit for bit"


def wheels() -> list[str]:
    """What has no wheel somewhere, printed too."""
    try:
        lacking = list(without_wheels(versions()))
    except ConnectionError as error:
        print(f"Wheels of other systems: NOT TESTED, no package index can be asked ({error})", flush=True)
        return []
    for line in lacking:
        print(f"FAILED: {line}", flush=True)
    if not lacking:
        print("Wheels of other systems: everything that the lab needs has one, on every Python and system", flush=True)
    return lacking


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
