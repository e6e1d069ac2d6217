"""Checks the pages' JavaScript: its format, its lint, its types. `make check` and `make test` run it.

Biome and the TypeScript compiler come through npm, in the versions of `package-lock.json`, into `node_modules` here.
Where there is no Node.js it says so aloud and lets the rest go on. With SALAB_REQUIRE_NODE=1, as `.ci/run` sets it, it
installs one from the system's packages, and fails when that cannot be done.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
LEAST_MAJOR = 18
HOW_TO = f"no Node.js {LEAST_MAJOR} or later with npm on PATH (Debian, Ubuntu: apt-get install nodejs npm)"


class NoNode(RuntimeError):
    """There is no Node.js that will do; the text says how to get one."""


def find_npm(environment: Mapping[str, str]) -> str:
    """The npm on PATH, if a Node.js that will do stands beside it.

    Raises:
        NoNode: one of the two is missing, or does not run, or is too old.
    """
    path = environment.get("PATH")
    node, npm = shutil.which("node", path=path), shutil.which("npm", path=path)
    if node is None or npm is None:
        raise NoNode(HOW_TO)
    asked = subprocess.run([node, "--version"], capture_output=True, text=True, timeout=60)
    major = asked.stdout.strip().removeprefix("v").partition(".")[0]
    if not major.isdecimal() or int(major) < LEAST_MAJOR:
        raise NoNode(f"{HOW_TO}; {node} says {asked.stdout.strip() or asked.stderr.strip()!r}")
    return npm


def install_node(environment: Mapping[str, str]) -> None:
    """Install Node.js and npm from the system's packages, as root or through sudo.

    Raises:
        NoNode: there is no apt-get here, or it failed.
    """
    apt = shutil.which("apt-get", path=environment.get("PATH"))
    if apt is None:
        raise NoNode(HOW_TO)
    become_root = [] if os.geteuid() == 0 else ["sudo", "-n", "env", "DEBIAN_FRONTEND=noninteractive"]
    ours = {**environment, "DEBIAN_FRONTEND": "noninteractive"}
    quiet = [*become_root, apt, "-qq"]
    for command in ([*quiet, "update"], [*quiet, "install", "-y", "--no-install-recommends", "nodejs", "npm"]):
        print("installing Node.js:", " ".join(command), flush=True)
        try:
            failed = subprocess.run(command, env=ours).returncode != 0
        except OSError:  # there is no sudo
            failed = True
        if failed:
            raise NoNode(f"{HOW_TO}; this failed: {' '.join(command)}")


def is_installed() -> bool:
    """Whether node_modules holds what the lock file names."""
    stamp = FOLDER / "node_modules" / ".installed"
    return stamp.is_file() and stamp.read_bytes() == (FOLDER / "package-lock.json").read_bytes()


def check(npm: str) -> int:
    """Install the tools if they are not there and run them; their exit code."""
    if not is_installed():
        installed = subprocess.run([npm, "ci", "--no-audit", "--no-fund", "--loglevel=error"], cwd=FOLDER)
        if installed.returncode != 0:
            return installed.returncode
        shutil.copyfile(FOLDER / "package-lock.json", FOLDER / "node_modules" / ".installed")
    return subprocess.run([npm, "run", "--silent", "check"], cwd=FOLDER).returncode


def main(environment: Mapping[str, str]) -> int:
    """Check, or say aloud that nothing was checked. The exit code."""
    is_required = environment.get("SALAB_REQUIRE_NODE", "") not in ("", "0")
    try:
        try:
            npm = find_npm(environment)
        except NoNode:
            if not is_required:
                raise
            install_node(environment)
            npm = find_npm(environment)
    except NoNode as error:
        print(f"== JavaScript NOT checked: {error}", flush=True)
        return 1 if is_required else 0
    return check(npm)


if __name__ == "__main__":
    sys.exit(main(os.environ))
