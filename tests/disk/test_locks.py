"""A lock is free the moment its holder ends, however it ends, and no file that stays behind means anything."""

from __future__ import annotations

import signal
import stat
import subprocess
import sys
from pathlib import Path

import portalocker
import pytest

from study.disk.locks import hold
from study.store import StoreError, open_store
from tests.support.lab_server import ROOT

HOLDER = "import sys, time; from pathlib import Path; from study.disk.locks import hold; held = hold(Path(sys.argv[1])); print(bool(held), flush=True); time.sleep(600)"  # fmt: skip  # noqa: E501


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM])
def test_what_a_killed_process_held_is_free_at_once(tmp_path: Path, end: signal.Signals) -> None:
    path = tmp_path / "lock"
    command = [sys.executable, "-c", HOLDER, str(path)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == "True\n"
        assert hold(path) is None
        holder.send_signal(end)
        holder.wait()
    assert path.exists(), "the file stays, and means nothing"
    lock = hold(path)
    assert lock is not None
    assert hold(path) is None, "nor does one process hold it twice"
    lock.close()
    lock.close()
    again = hold(path)
    assert again is not None
    again.close()


def test_the_file_is_its_owners_alone_and_a_link_is_not_followed(tmp_path: Path) -> None:
    lock = hold(tmp_path / "lock")
    assert lock is not None
    assert stat.S_IMODE((tmp_path / "lock").stat().st_mode) == 0o600
    lock.close()
    (tmp_path / "link").symlink_to(tmp_path / "lock")
    with pytest.raises(OSError, match="link"):
        hold(tmp_path / "link")


def test_a_file_that_was_removed_meanwhile_is_held_by_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "lock"

    def lock_and_lose(descriptor: int, flags: portalocker.LockFlags) -> None:
        path.unlink()

    with monkeypatch.context() as patch:
        patch.setattr(portalocker, "lock", lock_and_lose)
        assert hold(path) is None
    lock = hold(path)
    assert lock is not None
    lock.close()


def test_a_disk_without_locks_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(descriptor: int, flags: portalocker.LockFlags) -> None:
        raise portalocker.LockException("No locks available")

    monkeypatch.setattr(portalocker, "lock", refuse)
    with pytest.raises(OSError, match="cannot be locked: No locks available"):
        hold(tmp_path / "lock")
    with pytest.raises(StoreError, match=r"cannot be used as data folder: cannot be locked: No locks available"):
        open_store(tmp_path / "data", exclusive=True)
