"""A lab as a user starts it: `python -m app serve` in a process of its own, asked on loopback, ended by its id."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO

from study.store import DataPlace

ROOT = Path(__file__).resolve().parents[2]
EXPERIMENTER_TOKEN = "experimenter-token-for-tests-0123456789abcdef"
START_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 15.0


class LabDidNotStart(RuntimeError):
    """The process ended, or said nothing in time; the text holds what it printed."""


@dataclass
class LabServer(AbstractContextManager["LabServer"]):
    """One running lab. `base_url` has no trailing slash; the links are what the command line prints."""

    base_url: str
    experimenter_link: str
    demo_link: str
    data_dir: Path
    process: subprocess.Popen[str]
    log_path: Path
    database_url: str | None = None
    experimenter_token: str = EXPERIMENTER_TOKEN
    _readers: Sequence[threading.Thread] = field(default=(), repr=False)

    @property
    def data(self) -> DataPlace:
        """Where its data are."""
        return DataPlace(self.data_dir, self.database_url)

    @property
    def headers(self) -> dict[str, str]:
        """The experimenter's, for an HTTP client."""
        return {"Authorization": f"Bearer {self.experimenter_token}"}

    @property
    def port(self) -> int:
        """The port the lab listens on, which is not in its links behind a proxy: from the kernel's table of sockets."""
        inodes = set()
        for descriptor in Path(f"/proc/{self.process.pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                target = descriptor.readlink().name
                if target.startswith("socket:["):
                    inodes.add(target[8:-1])
        for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
            columns = line.split()
            if columns[3] == "0A" and columns[9] in inodes:
                return int(columns[1].rpartition(":")[2], 16)
        raise AssertionError("the lab listens on no port")

    def log(self) -> str:
        """Everything the server printed so far."""
        return self.log_path.read_text(encoding="utf-8", errors="replace")

    def kill(self) -> None:
        """As a power cut would: no time to clean up. The data folder stays, to start another lab on."""
        self.process.kill()
        self.process.wait(STOP_TIMEOUT_S)

    def close(self) -> None:
        """Asks it to end, then makes it. Ends no process but the one that was started."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self.kill()
        for reader in self._readers:
            reader.join(STOP_TIMEOUT_S)
        if self.process.stdout is not None:
            self.process.stdout.close()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def start(
    data_dir: Path,
    *arguments: str,
    environment: dict[str, str] | None = None,
    program: Sequence[str] = ("-m", "app"),
    interpreter: Path | str = sys.executable,
    folder: Path | None = None,
    url: str | None = None,
) -> LabServer:
    """`salab serve --port 0 --data data_dir arguments...`, returned once it answers. With the `url` of a database, its
    data are there, and the folder is for its own files. `program` is what Python runs for `salab`, in the checkout, or
    in another `folder` with the lab that the `interpreter` there has installed.

    Raises:
        LabDidNotStart: with the process's exit code and output.
    """
    data_dir.mkdir(parents=True, exist_ok=True)
    log_path = data_dir.with_name(data_dir.name + ".log")
    command = [str(interpreter), *program, "serve", "--port", "0", *_place(data_dir, url), *arguments]
    process = subprocess.Popen(
        command,
        cwd=folder or ROOT,
        env={
            **os.environ,
            **({"PYTHONPATH": ""} if folder else {}),
            "PYTHONUNBUFFERED": "1",
            "SALAB_READY_LINE": "1",
            "SALAB_EXPERIMENTER_TOKEN": EXPERIMENTER_TOKEN,
            **(environment or {}),
        },
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,  # a Ctrl-C at the tests is not one at the lab: teardown ends it
    )
    assert process.stdout is not None
    ready: queue.Queue[dict[str, str] | None] = queue.Queue()
    reader = threading.Thread(target=_drain, args=(process.stdout, log_path, ready), name="lab-output", daemon=True)
    reader.start()
    try:
        links = ready.get(timeout=START_TIMEOUT_S)
    except queue.Empty:
        links = None
    if links is None:
        process.kill()
        code = process.wait(STOP_TIMEOUT_S)
        reader.join(STOP_TIMEOUT_S)
        process.stdout.close()
        raise LabDidNotStart(f"{' '.join(command[1:])} ended with {code}:\n{log_path.read_text(encoding='utf-8')}")
    return LabServer(
        base_url=links["base_url"].rstrip("/"),
        experimenter_link=links["experimenter_link"],
        demo_link=links["demo_link"],
        data_dir=data_dir,
        database_url=url,
        process=process,
        log_path=log_path,
        _readers=(reader,),
    )


def _place(folder: Path, url: str | None) -> Sequence[str]:
    return ("--data", str(folder)) if url is None else ("--data", url, "--folder", str(folder))


def _drain(stream: IO[str], log_path: Path, ready: queue.Queue[dict[str, str] | None]) -> None:
    """Copies the output to the log, so that a full pipe never stalls the lab; hands over the READY line."""
    with log_path.open("w", encoding="utf-8") as log:
        for line in stream:
            log.write(line)
            log.flush()
            if line.startswith("READY "):
                ready.put(json.loads(line.removeprefix("READY ")))
    ready.put(None)
