"""Whether everything that the lab needs has a wheel for systems that are not here: the package index is asked.

uv resolves as if it were there: pip takes the markers of requirements from the machine it runs on, whatever
`--platform` says.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLATFORMS: Mapping[str, str] = {
    "Linux x86-64": "x86_64-manylinux_2_28",
    "Linux ARM": "aarch64-manylinux_2_28",
    "macOS ARM": "aarch64-apple-darwin",
    "macOS Intel": "x86_64-apple-darwin",
    "Windows": "x86_64-pc-windows-msvc",
}
"""As in docs/how-to/install.md, to what uv calls it."""
EXTRAS = ("bullet", "analysis", "postgres", "meshes")
MACOS = {"MACOSX_DEPLOYMENT_TARGET": "14.0"}
UNREACHED = ("Failed to fetch", "error sending request", "Could not connect", "Network connectivity")


def without_wheels(versions: tuple[str, ...]) -> Iterator[str]:
    """A line for each Python and system that lacks a wheel. Raises `ConnectionError` where no index can be asked."""
    index = subprocess.run(
        [sys.executable, "-m", "pip", "config", "get", "global.index-url"], capture_output=True, text=True
    )
    given = ["--default-index", index.stdout.strip()] if index.returncode == 0 else []
    wanted = list(product(versions, PLATFORMS))
    with ThreadPoolExecutor(max_workers=4) as several:
        said = list(several.map(lambda one: _resolved(one[0], one[1], given), wanted))
    for (version, platform), error in zip(wanted, said, strict=True):
        if any(words in error for words in UNREACHED):
            raise ConnectionError(error.strip().splitlines()[-1])
        if error:
            yield f"Python {version} on {platform}: {' '.join(error.split())}"


def _resolved(version: str, platform: str, index: list[str]) -> str:
    """What keeps the lab with its extras from being installed there; nothing where nothing does."""
    extras = [argument for extra in EXTRAS for argument in ("--extra", extra)]
    there = ["--python-platform", PLATFORMS[platform], "--python-version", version]
    command = [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--no-header", "--only-binary", ":all:"]
    done = subprocess.run(
        [*command, *there, *extras, *index, "pyproject.toml"],
        cwd=ROOT,
        env={**os.environ, **MACOS},
        capture_output=True,
        text=True,
        timeout=300,
    )
    return done.stderr or f"uv ended with {done.returncode}" if done.returncode else ""
