"""The Pythons of this machine, found as the Makefile finds them."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WORKS = "import ensurepip, sys, venv; print('%d.%d' % sys.version_info[:2])"


def versions() -> tuple[str, ...]:
    """Those that the lab runs on, the best first: what make looks for."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (line,) = re.findall(r"^PYTHONS := (.+)$", makefile, re.MULTILINE)
    return tuple(line.split())


def interpreter(version: str) -> Path | None:
    """One that really runs, is of that version and can make environments; None = there is none."""
    home = Path.home()
    folders = [Path(folder) for folder in os.environ.get("PATH", "").split(os.pathsep) if folder]
    folders += sorted((home / ".pyenv" / "versions").glob(f"{version}*/bin"))
    folders += [home / ".local" / "bin", Path("/usr/local/bin")]
    for folder in folders:
        for name in (f"python{version}", "python3", "python"):
            if os.access(folder / name, os.X_OK) and _version(folder / name) == version:
                return folder / name
    return None


def _version(program: Path) -> str:
    """What it says it is; nothing when it does not run, as a version manager's shim may not."""
    try:
        done = subprocess.run([program, "-c", WORKS], capture_output=True, text=True, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
