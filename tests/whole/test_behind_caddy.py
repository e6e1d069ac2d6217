"""A lab behind the proxy that ships for it, over TLS on loopback: `docs/server/Caddyfile` as compose.yaml runs it."""

from __future__ import annotations

import ssl
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from app.limits import Limits
from app.simulated.bot import run_bot
from tests.support.caddy import caddy_before, free_ports
from tests.support.lab_server import LabServer
from tests.support.wire_client import write_study


@pytest.mark.slow
async def test_a_bot_completes_a_study_over_tls_and_no_link_gets_into_the_proxys_log(
    start_lab: Callable[..., LabServer], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    https_port, http_port = free_ports(2)
    public = f"https://localhost:{https_port}"
    study = str(write_study(tmp_path))
    arguments = ("--robot", "kinematic", "--no-scene", "--study", study, "--public-url", public)
    lab = start_lab(*arguments, "--limit", "wrong_links_per_min=3")
    with caddy_before(lab.port, https_port, http_port, tmp_path) as proxy:
        assert proxy.url == lab.base_url == public
        monkeypatch.setenv("SSL_CERT_FILE", str(proxy.certificate))
        async with httpx.AsyncClient(
            base_url=public, verify=ssl.create_default_context(), trust_env=False, timeout=30.0
        ) as person:
            made = await person.post("/api/participants", headers=lab.headers, json={"pace": "lockstep"})
            link = made.json()["link"]
            assert link.startswith(f"{public}/p/")
            report = await run_bot(link)
            assert (report.surveys, report.findings, report.pages[-1]) == (3, [], "done")

            page = await person.get("/")
            assert page.status_code == 200 and "max-age=" in page.headers["strict-transport-security"]
            sent = await person.get(link)
            assert "; Secure" in sent.headers["set-cookie"], "the lab knows that the page came over TLS"
            redirected = await person.get(proxy.http_url + "/p/TOKEN")
            leads_to = (308, "https://localhost/p/TOKEN")  # without a port: outside it is the usual one
            assert (redirected.status_code, redirected.headers["location"]) == leads_to

            large = await person.post("/api/participants", content=b" " * (Limits().body_bytes + 1))
            assert large.status_code == 413

            # People are counted by the address that the proxy names, and nobody can name another.
            statuses = []
            for number in range(4):
                forged = {"X-Forwarded-For": f"192.0.2.{number}"}
                statuses.append((await person.get(f"/p/wrong{number}", headers=forged)).status_code)
            assert statuses == [403, 403, 403, 429]
            elsewhere = httpx.AsyncHTTPTransport(verify=ssl.create_default_context(), local_address="127.0.0.2")
            async with httpx.AsyncClient(base_url=public, transport=elsewhere) as other:
                assert (await other.get("/p/wrong5")).status_code == 403, "another person is not counted with the first"

            lab.kill()
            gone = await person.get(link)
            assert gone.status_code == 502
    said = proxy.log.read_text(encoding="utf-8")
    assert "connection refused" in said
    assert link.rpartition("/")[2] not in said and "/p/" not in said and "Cookie" not in said
