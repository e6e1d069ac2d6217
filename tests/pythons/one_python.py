"""What is asked of one Python: an empty environment, the fast tests, the same data, a study on each physics."""

from __future__ import annotations

import asyncio
import hashlib
import os
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import httpx

from app.simulated.bot import run_bot
from tests.support import lab_server
from tests.support.study_samples import small_study

ROOT = Path(__file__).resolve().parents[2]
FAST = ("-m", "not slow and not long and not browser and not bullet and not mujoco")
"""Whatever needs no browser and no physics and is not marked as slow."""
CONTRACT = ("-m", "not slow and not long and (bullet or mujoco)", "tests/sim/test_robot_contract.py")
"""What a robot with physics is held to."""
ROBOTS = ("kinematic", "bullet", "mujoco")


class Failed(Exception):
    """Something that is not as it should be, with what was said of it."""


@dataclass(frozen=True)
class OnePython:
    """An environment of its own at `folder`, of one Python, with the wheel in it."""

    version: str
    folder: Path

    @property
    def python(self) -> Path:
        """Its interpreter."""
        return self.folder / "environment" / "bin" / "python"

    def installed(self, interpreter: Path, wheel: Path) -> str:
        """Make it, from nothing. Says how long that took and what it takes."""
        begun = time.monotonic()
        run([interpreter, "-m", "venv", "--clear", self.folder / "environment"], self.folder)
        pip: list[str | Path] = [
            self.python,
            "-m",
            "pip",
            "--disable-pip-version-check",
            "install",
            "--quiet",
            "--no-compile",
        ]
        run([*pip, "--only-binary=:all:", f"{wheel}[bullet,analysis]"], self.folder)
        took_s, size_mb = time.monotonic() - begun, _size_mb(self.folder / "environment")
        run([*pip, "--only-binary=:all:", f"{wheel}[bullet,analysis,postgres,test,docs]"], self.folder)
        return f"installed in {took_s:.0f} s, {size_mb:.0f} MB"

    def robots(self) -> tuple[str, ...]:
        """Those whose physics is installed there."""
        asked = "from app.trial.robots import ROBOTS; print(*(n for n in ROBOTS.shipped if not ROBOTS.lacking(n)))"
        found = run([self.python, "-c", asked], self.folder).split()
        return tuple(name for name in ROBOTS if name in found)

    def tested(self) -> str:
        """The suite's fast part, with the checkout's files. Says how many passed."""
        return self._pytest(*FAST)

    def keeps_contracts(self) -> str:
        """Whether the robots with physics keep theirs. Says how many tests passed."""
        return self._pytest(*CONTRACT)

    def _pytest(self, *which: str) -> str:
        printed = run([self.python, "-m", "pytest", "-q", "-p", "no:cacheprovider", *which], ROOT)
        return printed.strip().splitlines()[-1]

    def studied(self, robot: str) -> str:
        """A bot completes a study on a lab that runs there."""
        study = _study(self.folder)
        with lab_server.start(
            self.folder / f"data-{robot}",
            *("--robot", robot, "--pace", "lockstep", "--no-scene", "--study", str(study)),
            interpreter=self.python,
            folder=self.folder,
        ) as lab:
            with httpx.Client(base_url=lab.base_url, headers=lab.headers, trust_env=False, timeout=60.0) as client:
                if "Shared Autonomy Lab" not in client.get("/").text:
                    raise Failed("the front page is not answered")
                made = client.post("/api/participants", json={"pace": "lockstep"}).raise_for_status().json()
            report = asyncio.run(run_bot(made["link"]))
        if report.pages[-1] != "done" or report.findings:
            raise Failed(f"the bot came to {report.pages[-1]}: {report.findings}")
        return f"{robot}: a bot completed the study in {report.ticks} ticks"


def simulated(python: Path | str, robot: str, folder: Path, checkout: Path | None = None) -> str:
    """The SHA-256 of what a simulated participant did, with the lab that is installed or that of a checkout."""
    out = folder / f"simulated-{robot}"
    command = [python, "-m", "app", "simulate", "--study", _study(folder), "--participants", "1", "--robot", robot]
    run([*command, "--out", out], folder, {"PYTHONPATH": str(checkout or "")})
    return hashlib.sha256((out / "ticks.csv").read_bytes()).hexdigest()


def _study(folder: Path) -> Path:
    path = folder / "small.toml"
    path.write_text(small_study().source_text, encoding="utf-8")
    return path


def run(command: Sequence[str | Path], folder: Path, environment: Mapping[str, str] | None = None) -> str:
    """What a program prints, which ends well. Raises `Failed`."""
    here = {**os.environ, "PYTHONPATH": "", **(environment or {})}
    done = subprocess.run([*map(str, command)], cwd=folder, env=here, capture_output=True, text=True, timeout=3600)
    if done.returncode:
        said = "\n".join([*done.stdout.strip().splitlines()[-40:], *done.stderr.strip().splitlines()[-40:]])
        raise Failed(f"{' '.join(map(str, command))} ended with {done.returncode}:\n{said}")
    return done.stdout


def _size_mb(folder: Path) -> float:
    return sum(path.lstat().st_size for path in folder.rglob("*")) / 1e6
