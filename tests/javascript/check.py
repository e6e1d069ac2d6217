"""Checks the pages' JavaScript: its format, its lint, its types. `make check` and `make test` run it.

Biome and the TypeScript compiler come through npm, in the versions of `package-lock.json`, into `node_modules` here.
Where there is no Node.js, or npm reaches no registry, it says so aloud and lets the rest go on. With
SALAB_REQUIRE_NODE=1, as `.ci/run` sets it, it installs Node.js from the system's packages, and fails when one of the
two cannot be had.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from tests.support import system_packages

FOLDER = Path(__file__).resolve().parent
LEAST_MAJOR = 18
HOW_TO = f"no Node.js {LEAST_MAJOR} or later with npm on PATH (Debian, Ubuntu: apt-get install nodejs npm)"
NO_REGISTRY = re.compile(
    r"\b(?:ECONNREFUSED|ECONNRESET|ENOTFOUND|EAI_AGAIN|EHOSTUNREACH|ENETUNREACH|ETIMEDOUT|ERR_SOCKET_TIMEOUT"
    r"|ENOTCACHED|E407|E50[234])\b"
)
"""What npm says when it cannot reach a registry; a wrong lock file or a wrong checksum it names otherwise."""


class NoTools(RuntimeError):
    """Node.js or the tools cannot be had; the text says why, and how to get them."""


def find_npm(environment: Mapping[str, str]) -> str:
    """The npm on PATH, if a Node.js that will do stands beside it.

    Raises:
        NoTools: one of the two is missing, or does not run, or is too old.
    """
    path = environment.get("PATH")
    node, npm = shutil.which("node", path=path), shutil.which("npm", path=path)
    if node is None or npm is None:
        raise NoTools(HOW_TO)
    asked = subprocess.run([node, "--version"], capture_output=True, text=True, timeout=60)
    major = asked.stdout.strip().removeprefix("v").partition(".")[0]
    if not major.isdecimal() or int(major) < LEAST_MAJOR:
        raise NoTools(f"{HOW_TO}; {node} says {asked.stdout.strip() or asked.stderr.strip()!r}")
    return npm


def install_node(environment: Mapping[str, str]) -> None:
    """Install Node.js and npm from the system's packages.

    Raises:
        NoTools: that cannot be done here, or it failed.
    """
    try:
        system_packages.install("Node.js", "nodejs", "npm", environment=environment)
    except system_packages.NotInstalled as error:
        raise NoTools(f"{HOW_TO}; {error}") from error


def is_installed() -> bool:
    """Whether node_modules holds what the lock file names."""
    stamp = FOLDER / "node_modules" / ".installed"
    return stamp.is_file() and stamp.read_bytes() == (FOLDER / "package-lock.json").read_bytes()


def check(npm: str, environment: Mapping[str, str]) -> int:
    """Install the tools if they are not there and run them; their exit code.

    Raises:
        NoTools: they are not there, and npm reaches no registry.
    """
    if not is_installed():
        install = [npm, "ci", "--no-audit", "--no-fund", "--loglevel=error", "--fetch-retries=1"]
        installed = subprocess.run(install, cwd=FOLDER, env=environment, stderr=subprocess.PIPE, text=True)
        print(installed.stderr, end="", file=sys.stderr, flush=True)
        if installed.returncode != 0:
            unreachable = NO_REGISTRY.search(installed.stderr)
            if unreachable is None:
                return installed.returncode
            raise NoTools(f"npm reaches no registry ({unreachable.group()}), and the tools are not in node_modules")
        shutil.copyfile(FOLDER / "package-lock.json", FOLDER / "node_modules" / ".installed")
    return subprocess.run([npm, "run", "--silent", "check"], cwd=FOLDER, env=environment).returncode


def main(environment: Mapping[str, str]) -> int:
    """Check, or say aloud that nothing was checked. The exit code."""
    is_required = environment.get("SALAB_REQUIRE_NODE", "") not in ("", "0")
    try:
        try:
            npm = find_npm(environment)
        except NoTools:
            if not is_required:
                raise
            install_node(environment)
            npm = find_npm(environment)
        return check(npm, environment)
    except NoTools as error:
        print(f"== JavaScript NOT checked: {error}", flush=True)
        return 1 if is_required else 0


if __name__ == "__main__":
    sys.exit(main(os.environ))
