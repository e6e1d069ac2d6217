"""Finds the Chromium the browser tests drive; `python -m tests.support.chromium` installs one when there is none.

The order: $CHROMIUM, then what is on PATH, then playwright's own. Each candidate is asked for its version, since
a distribution's `chromium-browser` may be a stub that only says to install something else.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

from tests.support import system_packages

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
HOW_TO = (
    "No working Chromium found. Set CHROMIUM=/path/to/chromium, or install one "
    "(Debian: apt-get install chromium; elsewhere: .venv/bin/python -m playwright install chromium)."
)


class NoChromium(RuntimeError):
    """There is no Chromium that starts; the text says how to get one."""


def candidates(environment: Mapping[str, str]) -> Iterator[str]:
    """Paths worth trying, best first; playwright's own is only looked up when nothing before it worked."""
    if named := environment.get("CHROMIUM"):
        yield named
        return  # a path that was named and is wrong is an error to report, not one to work around
    for name in NAMES:
        if found := shutil.which(name, path=environment.get("PATH")):
            yield found
    if own := _playwright_executable():
        yield own


def _playwright_executable() -> str | None:
    # In a process of its own: the caller may be inside an event loop, where playwright's sync API refuses to start.
    code = "from playwright.sync_api import sync_playwright as s\nwith s() as p: print(p.chromium.executable_path)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    path = done.stdout.strip()
    return path if done.returncode == 0 and Path(path).is_file() else None


def version_of(executable: str) -> str | None:
    """What `executable --version` prints, or None when it does not start or is no Chromium."""
    try:
        done = subprocess.run([executable, "--version"], capture_output=True, text=True, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return None
    text = done.stdout.strip()
    return text if done.returncode == 0 and "Chrom" in text else None


def find(environment: Mapping[str, str] | None = None) -> Path:
    """The first Chromium that starts.

    Raises:
        NoChromium: none does; the text names what was tried and how to get one.
    """
    tried = []
    for candidate in candidates(os.environ if environment is None else environment):
        if version_of(candidate):
            return Path(candidate)
        tried.append(candidate)
    raise NoChromium(f"{HOW_TO} Tried: {', '.join(tried) or 'nothing on PATH'}.")


def _install_from_system() -> None:
    system_packages.install("a Chromium", "chromium", environment=os.environ)


def _download() -> None:
    command = [sys.executable, "-m", "playwright", "install", "chromium"]
    print("installing a Chromium:", " ".join(command), flush=True)
    subprocess.run(command)


def ensure() -> Path:
    """`find`, after installing one if need be: from the system's packages, else by playwright's download.

    Raises:
        NoChromium: none is there and none could be installed.
    """
    try:
        return find()
    except NoChromium:
        if os.environ.get("CHROMIUM"):
            raise
    for install in (_install_from_system, _download):
        try:
            install()
            return find()
        except (system_packages.NotInstalled, NoChromium):
            continue
    raise NoChromium(HOW_TO)


if __name__ == "__main__":
    try:
        chromium = ensure()
    except NoChromium as error:
        sys.exit(f"error: {error}")
    print(f"{chromium}: {version_of(str(chromium))}")
