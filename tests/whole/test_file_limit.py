"""A lab with more connections than it may have open files: its log stays small, and it goes on by itself."""

from __future__ import annotations

import http.client
import json
import resource
import socket
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import httpx

from tests.support.lab_server import LabServer

LIMIT = 64
MAX_LOG_BYTES = 5_000
"""Without folding it is some 200 bytes for each connection that waits, again and again."""

REQUEST = b"GET /api/protocol HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"


def _answer(connection: socket.socket) -> int:
    """The status of the next answer; its body is read."""
    answer = http.client.HTTPResponse(connection)
    answer.begin()
    answer.read()
    return answer.status


def test_at_the_limit_of_open_files_the_log_stays_small_and_the_lab_goes_on(
    start_lab: Callable[..., LabServer],
) -> None:
    lab = start_lab("--robot", "kinematic", "--no-scene", "--log-format", "json")
    address = ("127.0.0.1", lab.port)
    with ExitStack() as connections:
        first = connections.enter_context(socket.create_connection(address, timeout=20))
        first.sendall(REQUEST)
        assert _answer(first) == 200
        resource.prlimit(lab.process.pid, resource.RLIMIT_NOFILE, (LIMIT, LIMIT))
        for _ in range(2 * LIMIT):
            connections.enter_context(socket.create_connection(address, timeout=20))
        first.sendall(REQUEST)
        assert _answer(first) == 200  # who is in goes on
        assert len(list(Path(f"/proc/{lab.process.pid}/fd").iterdir())) == LIMIT
    assert httpx.get(f"{lab.base_url}/api/protocol", trust_env=False, timeout=20).status_code == 200
    lab.close()
    lines = [json.loads(line) for line in lab.log().splitlines() if line.startswith("{")]
    refused = [line for line in lines if line["message"] == "socket.accept() out of system resource"]
    assert refused[0]["reason"] == "[Errno 24] Too many open files"
    assert refused[1]["repeated"] > LIMIT
    assert len(refused) <= 5 and sum(len(json.dumps(line)) for line in lines) < MAX_LOG_BYTES
