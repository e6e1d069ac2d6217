"""Files that one process at a time holds.

The lock is the system's own (`flock`, on Windows a locked byte): whoever ends, killed or not, lets go of it, and the
file that stays behind means nothing. So there is no stale lock, and nobody looks whether a process still lives.
"""

from __future__ import annotations

import os
from pathlib import Path

from study.disk.private_files import make_private


class Lock:
    """A file that is held until `close`, or until the process ends. Made by `hold`."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor: int | None = descriptor

    def close(self) -> None:
        """Let go of it; twice is once."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)


def hold(path: Path) -> Lock | None:
    """Hold a file, which is made if there is none, as its owner's alone; None while another process, or another lock of
    this one, holds it, or has removed it meanwhile. Never waits. Raises `OSError`, also where the disk has no locks."""
    import portalocker  # which takes longer than all else here

    make_private(path)
    descriptor = os.open(path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    try:
        portalocker.lock(descriptor, portalocker.LockFlags.EXCLUSIVE | portalocker.LockFlags.NON_BLOCKING)
    except portalocker.AlreadyLocked:
        os.close(descriptor)
        return None
    except portalocker.LockException as error:
        os.close(descriptor)
        raise OSError(f"cannot be locked: {error}") from error
    lock = Lock(descriptor)
    if _is_there(descriptor, path):
        return lock
    lock.close()
    return None


def _is_there(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False
