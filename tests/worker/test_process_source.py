"""Where processes come from on each system, and that `spawn` gives them as the fork server does."""

from __future__ import annotations

import multiprocessing
import sys
from pathlib import Path

import pytest

from app.errors import LabError
from app.worker.probes import why_no_process
from app.worker.process_source import IMPORTS_S, StartWatch, process_source


@pytest.mark.parametrize(
    ("platform", "known", "method"),
    [
        ("linux", ["fork", "spawn", "forkserver"], "forkserver"),
        ("darwin", ["spawn", "fork", "forkserver"], "spawn"),  # whose libraries start threads
        ("win32", ["spawn"], "spawn"),
    ],
)
def test_each_system_has_its_way_unless_another_is_named(
    monkeypatch: pytest.MonkeyPatch, platform: str, known: list[str], method: str
) -> None:
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(multiprocessing, "get_all_start_methods", lambda: known)
    source = process_source("kinematic")
    assert (source.method, source.allowance_s) == (method, 0.0 if method == "forkserver" else IMPORTS_S)
    assert process_source("kinematic", "spawn").method == "spawn"
    if "forkserver" in known:
        assert process_source("kinematic", "forkserver").method == "forkserver"
        return
    with pytest.raises(LabError, match=r"--start-method forkserver: this system has none; choose one of auto, spawn"):
        process_source("kinematic", "forkserver")


def test_a_spawned_process_tries_a_robot_and_answers() -> None:
    source = process_source("kinematic", "spawn")
    with pytest.raises(LabError, match="no robot 'sawyer'; robots are"):
        source.warm_up("sawyer")
    assert why_no_process(source) == ""
    source.tend()


def test_a_temporary_folder_too_long_for_sockets_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a cluster. Linux takes 108 bytes."""

    def no_socket() -> None:
        raise OSError("AF_UNIX path too long")

    source = process_source("kinematic")
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path / ("long" * 30)))
    monkeypatch.setattr("multiprocessing.forkserver._forkserver.ensure_running", no_socket)
    monkeypatch.setattr("multiprocessing.forkserver.ensure_running", no_socket)
    with pytest.raises(
        LabError, match=r"longlong: too long a name .*; set TMPDIR to a shorter one, .*spawn$"
    ) as caught:
        source.warm_up("kinematic")
    assert "\n" not in str(caught.value)


def test_where_there_is_no_fork_server_a_start_is_waited_for_and_nothing_is_ended(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_s = [100.0]
    monkeypatch.setattr("app.worker.process_source.time.monotonic", lambda: now_s[0])
    watch = StartWatch(process_source("kinematic", "spawn"))
    now_s[0] += IMPORTS_S
    assert not watch.hangs()
    now_s[0] += IMPORTS_S
    assert watch.hangs() and not watch.end()
