"""What a machine is, as far as it decides whether a trial can be re-run bit for bit: versions, code, CPU, BLAS."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import platform
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

_PACKAGES = {
    "app": ("shared-autonomy-lab",),
    "numpy": ("numpy",),
    "pybullet": ("pybullet", "pybullet-arm64"),  # either brings the module; the second one's name is told
    "mujoco": ("mujoco-core",),
    "viser": ("viser",),
    "sqlalchemy": ("sqlalchemy",),
}


_ROOT = Path(__file__).resolve().parents[2]
_DECIDING = ("app/autonomy", "app/trial", "sim", "study/definition", "study/parts", "study/records.py")
"""Where the code stands that decides what a tick does: two checkouts of one version may differ in it."""


def machine_fingerprint() -> dict[str, str]:
    """Name to value; `not installed` and `unknown` are values too, nothing is left out."""
    return {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "cpu": _cpu_model(),
        "blas": _blas(),
        "code": _code(),
        **{name: _version(*packages) for name, packages in _PACKAGES.items()},
    }


def fingerprint_text(fingerprint: Mapping[str, str]) -> str:
    """A fingerprint as one line of JSON, whatever the order of its names."""
    return json.dumps(dict(fingerprint), sort_keys=True)


def fingerprint_id(fingerprint: Mapping[str, str]) -> str:
    """What events call a machine by: twelve digits of the SHA-256 of its fingerprint."""
    return hashlib.sha256(fingerprint_text(fingerprint).encode()).hexdigest()[:12]


@lru_cache(maxsize=1)
def _code() -> str:
    """Twelve digits of a SHA-256 over every file of `_DECIDING`: arbiters, inference, engine, robots, layouts."""
    sha256 = hashlib.sha256()
    for place in _DECIDING:
        path = _ROOT / place
        files = [path] if path.is_file() else sorted(path.rglob("*"))
        for file in files:
            if file.is_file() and "__pycache__" not in file.parts and file.suffix != ".md":
                sha256.update(f"{file.relative_to(_ROOT).as_posix()}\0".encode())
                sha256.update(hashlib.sha256(file.read_bytes()).digest())
    return sha256.hexdigest()[:12]


def _version(first: str, *others: str) -> str:
    """Of the first of these packages that is installed, with its name if that is another than usual."""
    for package in (first, *others):
        try:
            version = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
        return version if package == first else f"{version} ({package})"
    return "not installed"


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, "") or platform.processor() or "unknown"


def _blas() -> str:
    try:
        config: Any = np.show_config(mode="dicts")
        blas = config["Build Dependencies"]["blas"]
        return f"{blas.get('name', 'unknown')} {blas.get('version', '')}".strip()
    except (KeyError, TypeError):
        return "unknown"
