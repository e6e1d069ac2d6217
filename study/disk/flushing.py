"""What was written is on the disk, and not only on its way there."""

from __future__ import annotations

import os
from pathlib import Path

CAN_OPEN_FOLDERS = os.name != "nt"
"""Windows opens no folder as a file; NTFS keeps a journal of names by itself."""


def to_disk(path: Path) -> None:
    """Wait until a file's bytes, or a folder's names, are on the disk. Raises `OSError`."""
    if path.is_dir():
        if not CAN_OPEN_FOLDERS:
            return
        flags = os.O_RDONLY
    else:
        flags = os.O_RDONLY if CAN_OPEN_FOLDERS else os.O_RDWR  # Windows flushes what may be written to
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
