"""What a machine is, as far as it decides whether a trial can be re-run bit for bit: versions, CPU, BLAS."""

from __future__ import annotations

import importlib.metadata
import platform
from pathlib import Path
from typing import Any

import numpy as np

_PACKAGES = {
    "app": "shared-autonomy-lab",
    "numpy": "numpy",
    "pybullet": "pybullet",
    "viser": "viser",
    "sqlalchemy": "sqlalchemy",
}


def machine_fingerprint() -> dict[str, str]:
    """Name to value; `not installed` and `unknown` are values too, nothing is left out."""
    return {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "cpu": _cpu_model(),
        "blas": _blas(),
        **{name: _version(package) for name, package in _PACKAGES.items()},
    }


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
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
