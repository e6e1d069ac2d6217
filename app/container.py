"""What a container or a service is given of its machine, where it is less than all: Linux' control groups, 2 and 1.

    0::/system.slice/salab.service  ─►  /sys/fs/cgroup/system.slice/salab.service/cpu.max, and those of all above it

A container sees its own group as the uppermost. Where there are no such files, or none that can be read, nothing is
limited.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath

OWN_GROUPS = Path("/proc/self/cgroup")
GROUPS = Path("/sys/fs/cgroup")
UNLIMITED_BYTES = 1 << 60
"""Version 1 writes the largest number of pages for no limit."""


def given_cores(own: Path = OWN_GROUPS, groups: Path = GROUPS) -> float | None:
    """How much processor time a second of this process' groups, in cores; None for as much as there is."""
    found: list[float] = []
    for folder in _folders("cpu", own, groups):
        version_1 = (*_words(folder / "cpu.cfs_quota_us"), *_words(folder / "cpu.cfs_period_us"))
        told = _words(folder / "cpu.max") or version_1
        if len(told) == 2 and all(number.isdecimal() for number in told) and int(told[1]) > 0:
            found.append(int(told[0]) / int(told[1]))
    return min(found, default=None)


def given_memory_bytes(own: Path = OWN_GROUPS, groups: Path = GROUPS) -> int | None:
    """The least memory that a group of this process may have; None for as much as there is."""
    return min((limit for limit, _ in _memory(own, groups)), default=None)


def free_memory_bytes(own: Path = OWN_GROUPS, groups: Path = GROUPS) -> int | None:
    """What is left of it, with files that the system would forget first; None where nothing is limited."""
    return min((max(0, limit - used) for limit, used in _memory(own, groups)), default=None)


def _memory(own: Path, groups: Path) -> Iterator[tuple[int, int]]:
    """Limit and use of each group that is limited, in bytes. Use holds no file that was read and lies about since."""
    for folder in _folders("memory", own, groups):
        limit = _words(folder / "memory.max") or _words(folder / "memory.limit_in_bytes")
        used = _words(folder / "memory.current") or _words(folder / "memory.usage_in_bytes")
        if limit and used and limit[0].isdecimal() and int(limit[0]) < UNLIMITED_BYTES:
            yield int(limit[0]), int(used[0]) - _forgotten_first(folder)


def _forgotten_first(folder: Path) -> int:
    """What of a group's memory is files that nobody has used of late, in bytes."""
    words = _words(folder / "memory.stat")
    told = dict(zip(words[::2], words[1::2], strict=False))
    return int(told.get("total_inactive_file") or told.get("inactive_file") or 0)


def _folders(controller: str, own: Path, groups: Path) -> Iterator[Path]:
    """The folders of this process' groups that may say something of a controller, from its own upward."""
    for line in _text(own).splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers and controller not in controllers.split(","):
            continue
        root = groups / controllers if controllers else groups
        inside = PurePosixPath(path).relative_to("/")
        yield from dict.fromkeys(root / place for place in (inside, *inside.parents))


def _words(path: Path) -> tuple[str, ...]:
    return tuple(_text(path).split())


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError):
        return ""
