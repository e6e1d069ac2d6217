"""What this machine is and has, as far as it decides how many people it holds."""

from __future__ import annotations

import os
from collections.abc import Mapping

from app.container import given_cores
from app.processes import memory_bytes
from study.store import machine_fingerprint

GB = 1_000_000_000
NO_LIMIT = 1_000_000
"""Where nothing limits open files."""


def core_numbers() -> tuple[int, ...]:
    """The cores that this process may use, as the system numbers them."""
    given = getattr(os, "sched_getaffinity", None)
    return tuple(sorted(given(0))) if given else tuple(range(os.cpu_count() or 1))


def cores() -> int:
    """How many there are for it: as many whole ones as its container is given, if it is given fewer."""
    given = given_cores()
    return len(core_numbers()) if given is None else max(1, min(len(core_numbers()), int(given)))


def open_files() -> int:
    """How many files a process may have open at most, after asking for as many as it is given."""
    try:
        import resource
    except ImportError:  # Windows: sockets are none, and nothing limits them
        return NO_LIMIT
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    return NO_LIMIT if hard == resource.RLIM_INFINITY else min(hard, NO_LIMIT)


def machine() -> Mapping[str, str]:
    """What a number of people was measured on; another version of the lab leaves it as it is."""
    known = machine_fingerprint()
    return {
        "system": known["system"],
        "cpu": known["cpu"],
        "cores": str(cores()),
        "memory_gb": f"{memory_bytes() / GB:.0f}",
    }


def version() -> str:
    """Of the lab, as it is installed."""
    return machine_fingerprint()["app"]
