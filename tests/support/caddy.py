"""The proxy that ships in `docs/server`, run on loopback before a lab, with a certificate of its own making."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.support.lab_server import ROOT

CADDY = Path(sys.executable).with_name("caddy")
CADDYFILE = ROOT / "docs" / "server" / "Caddyfile"
READY = ("serving initial configuration", "certificate obtained successfully")
ENDS_WITHIN_S = 15.0


@dataclass(frozen=True)
class Proxy:
    """`url` is the lab's public address, `http_url` what leads there; `log` is the file of what Caddy says."""

    url: str
    http_url: str
    certificate: Path
    log: Path


def free_ports(count: int) -> list[int]:
    """Ports that nobody listens on now."""
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(count)]
        return [sock.getsockname()[1] for sock in sockets]


@contextlib.contextmanager
def caddy_before(lab_port: int, https_port: int, http_port: int, folder: Path) -> Iterator[Proxy]:
    """The Caddyfile as it ships, but that it listens on loopback alone."""
    text = CADDYFILE.read_text(encoding="utf-8")
    config = folder / "Caddyfile"
    config.write_text(
        text.replace("{\n\tadmin off\n", "{\n\tadmin off\n\tdefault_bind 127.0.0.1\n", 1), encoding="utf-8"
    )
    environment = {
        **{name: value for name, value in os.environ.items() if name in ("PATH", "LANG")},
        "HOME": str(folder),
        "XDG_DATA_HOME": str(folder),
        "XDG_CONFIG_HOME": str(folder),
        "LAB_HOST": "localhost",
        "LAB_HTTP_PORT": str(http_port),
        "LAB_HTTPS_PORT": str(https_port),
        "LAB_PORT": str(lab_port),
    }
    command = [str(CADDY), "run", "--config", str(config), "--adapter", "caddyfile"]
    log = folder / "caddy.log"
    with log.open("w") as said:
        process = subprocess.Popen(
            command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        assert process.stderr is not None
        try:
            awaited = set(READY)
            for line in process.stderr:
                said.write(line)
                awaited -= {text for text in READY if text in line}
                if not awaited:
                    break
            else:
                raise AssertionError(f"caddy ended with {process.wait()}: {log.read_text()}")
            certificate = folder / "caddy" / "pki" / "authorities" / "local" / "root.crt"
            yield Proxy(f"https://localhost:{https_port}", f"http://localhost:{http_port}", certificate, log)
        finally:
            process.terminate()
            said.write(process.communicate(timeout=ENDS_WITHIN_S)[1])


def lines_of(log: Path) -> list[dict[str, object]]:
    """What Caddy said, line by line."""
    return [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines() if line.startswith("{")]
