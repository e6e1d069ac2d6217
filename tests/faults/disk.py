"""Small disks of a test's own: one that can be filled, one that can be made to fail. The machine's own is not touched.

Where file systems may be mounted (as root), both are real: a tmpfs, and an ext4 in a file of 32 MB, of
which the kernel is told that it found an error. Elsewhere a full disk is a limit on the size of the lab's files
(RLIMIT_FSIZE).
"""

from __future__ import annotations

import contextlib
import os
import resource
import sqlite3
import subprocess
from collections.abc import Iterator
from pathlib import Path

from tests.faults.row import CannotRun, Disk

IMAGE_BYTES = 32 * 2**20
FILLER = "filler"


def _run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        why = done.stderr.strip().splitlines() or [f"ended with {done.returncode}"]
        raise CannotRun(f"{' '.join(command)}: {why[0]}")
    return done.stdout.strip()


class SmallDisk:
    """What lies at `folder`. `how` says what it really is, for the report."""

    def __init__(self, folder: Path, kind: Disk, size_mb: int) -> None:
        self._size_mb = size_mb
        self.folder = folder
        self.kind = kind
        self.how = ""
        self._image = folder.with_name(folder.name + ".img")
        self._is_mounted = False
        self._limited: int | None = None

    def open(self) -> None:
        """Put it there. Raises `CannotRun` where a failing disk cannot be made."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if self.kind == "small":
            try:
                _run("mount", "-t", "tmpfs", "-o", f"size={self._size_mb}m", "tmpfs", str(self.folder))
                self._is_mounted, self.how = True, f"tmpfs of {self._size_mb} MB"
            except (CannotRun, FileNotFoundError):
                self.how = "RLIMIT_FSIZE"
        elif self.kind == "failing":
            with self._image.open("wb") as image:
                image.truncate(IMAGE_BYTES)
            _run("mkfs.ext4", "-q", str(self._image))
            self._mount_image()
            self.how = "ext4 in a file, made to fail"

    def _mount_image(self) -> None:
        _run("mount", "-o", "loop,errors=remount-ro", str(self._image), str(self.folder))
        self._is_mounted = True

    def close(self) -> None:
        """Take it away."""
        if self._is_mounted:
            _run("umount", str(self.folder))
            self._is_mounted = False
        self._image.unlink(missing_ok=True)

    # ---- full -------------------------------------------------------------------------------------------------------

    def fill(self, lab_pid: int) -> None:
        """Not a byte fits any more. The database's log is cut off first, or it would go on in what it has."""
        with contextlib.closing(sqlite3.connect(self.folder / "lab.sqlite")) as database:
            database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        if not self._is_mounted:
            self._limited = lab_pid
            largest = max(path.stat().st_size for path in self.folder.glob("lab.sqlite-*"))
            resource.prlimit(lab_pid, resource.RLIMIT_FSIZE, (largest, resource.RLIM_INFINITY))
            return
        with contextlib.suppress(OSError), (self.folder / FILLER).open("wb", buffering=0) as filler:
            for size in (2**16, 1):
                with contextlib.suppress(OSError):
                    while True:
                        if not filler.write(b"\0" * size):
                            break

    def empty(self) -> None:
        """There is room again."""
        if self._limited is not None:
            resource.prlimit(self._limited, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
            self._limited = None
        (self.folder / FILLER).unlink(missing_ok=True)

    # ---- failing ----------------------------------------------------------------------------------------------------

    def fail(self) -> None:
        """The kernel finds an error: from now on nothing can be written, whoever has a file open."""
        device = next(
            row.split()[0]
            for row in Path("/proc/mounts").read_text().splitlines()
            if row.split()[1] == os.fspath(self.folder.resolve())
        )
        trigger = Path("/sys/fs/ext4") / Path(device).name / "trigger_fs_error"
        try:
            trigger.write_text("a test of what follows")
        except OSError as error:
            raise CannotRun(f"{trigger}: {error.strerror}") from None

    def repair(self) -> None:
        """As an operator would, once nobody has a file of it open."""
        self._is_mounted = False
        _run("umount", str(self.folder))
        checked = subprocess.run(["e2fsck", "-fy", str(self._image)], capture_output=True, text=True, check=False)
        if checked.returncode not in (0, 1):
            raise CannotRun(f"e2fsck: {checked.stdout}")
        self._mount_image()


@contextlib.contextmanager
def locked(database: Path) -> Iterator[None]:
    """Somebody else writes to the database, for as long as the block runs."""
    with contextlib.closing(sqlite3.connect(database, timeout=5.0, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        try:
            yield
        finally:
            other.execute("ROLLBACK")
