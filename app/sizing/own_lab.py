"""A lab to be measured: `salab serve` as users run it, in a process of its own, on loopback and a folder that goes."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import secrets
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any
from urllib.error import URLError
from urllib.request import ProxyHandler, Request, build_opener

from app.errors import LabError
from app.processes import keep_to_cores

STARTS_WITHIN_S = 120.0
ENDS_WITHIN_S = 15.0
ANSWERS_WITHIN_S = 60.0
TOKEN_BYTES = 24
ROOT = Path(__file__).resolve().parents[2]
"""Where Python finds `app`, in a checkout and in an installation."""


@dataclass(frozen=True)
class OwnLab:
    """A lab that runs. Made by `own_lab`."""

    base_url: str
    token: str
    data: Path
    pid: int

    def get(self, path: str) -> bytes:
        """The answer of `/api/PATH`. Raises `LabError`."""
        return self._asked(Request(f"{self.base_url}/api/{path}", headers=self._headers))

    def post(self, path: str, body: Mapping[str, Any]) -> Any:
        """The JSON that answers a JSON body. Raises `LabError`."""
        headers = {**self._headers, "Content-Type": "application/json"}
        data = json.dumps(body).encode()
        return json.loads(self._asked(Request(f"{self.base_url}/api/{path}", data, headers, method="POST")))

    @property
    def _headers(self) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.token}"}

    def _asked(self, request: Request) -> bytes:
        try:
            with build_opener(ProxyHandler({})).open(request, timeout=ANSWERS_WITHIN_S) as answer:
                body: bytes = answer.read()
                return body
        except (URLError, OSError) as error:
            raise LabError(f"the lab that is measured does not answer: {error}") from None


@contextlib.contextmanager
def beside(data: Path) -> Iterator[Path]:
    """A folder for a while, on the disk of a data folder: what a commit costs depends on it. Raises `OSError`."""
    place = data if data.is_dir() else next(parent for parent in data.absolute().parents if parent.is_dir())
    above = place.absolute().parent
    if place == data and above.stat().st_dev == place.stat().st_dev and os.access(above, os.W_OK):
        place = above  # a data folder has nothing of others in it, as long as that can be had
    made = Path(tempfile.mkdtemp(prefix="salab-bench-", dir=place))
    try:
        yield made
    finally:
        shutil.rmtree(made, ignore_errors=True)


@contextlib.contextmanager
def own_lab(folder: Path, arguments: Sequence[str], cores: Sequence[int] = ()) -> Iterator[OwnLab]:
    """`salab serve` with these arguments, on a new `folder`'s `data`, once it answers. `cores`: the ones it keeps to,
    all if none are named. Raises `LabError` with what it said when it does not start."""
    token = secrets.token_urlsafe(TOKEN_BYTES)
    command = [sys.executable, "-m", "app", "serve", "--port", "0", "--data", str(folder / "data"), *arguments]
    said = folder / "lab.log"
    with said.open("w", encoding="utf-8") as log:
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env={**os.environ, "SALAB_READY_LINE": "1", "SALAB_EXPERIMENTER_TOKEN": token, "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            start_new_session=True,  # a Ctrl+C is for whoever measures, who then ends it
        )
    try:
        if cores:
            keep_to_cores(process.pid, cores)
        assert process.stdout is not None
        ready: queue.Queue[str] = queue.Queue()
        threading.Thread(target=_drain, args=(process.stdout, ready), name="lab's output", daemon=True).start()
        try:
            line = ready.get(timeout=STARTS_WITHIN_S)
        except queue.Empty:
            line = ""
        if not line:
            raise LabError(_why(said))
        base_url = str(json.loads(line)["base_url"]).rstrip("/")
        yield OwnLab(base_url, token, folder / "data", process.pid)
    finally:
        process.terminate()
        try:
            process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _drain(stream: IO[str], ready: queue.Queue[str]) -> None:
    """Hands over what follows READY, or "" at the end of all that is printed."""
    with stream:
        for line in stream:
            if line.startswith("READY "):
                ready.put(line.removeprefix("READY "))
    ready.put("")


def _why(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    told = [line.removeprefix("salab: ") for line in lines if line.startswith("salab: ")]
    return told[-1] if told else f"the lab to be measured did not start: {lines[-1] if lines else 'it said nothing'}"
