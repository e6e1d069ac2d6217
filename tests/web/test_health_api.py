"""Health, liveness, readiness and metrics as probes and Prometheus ask for them."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from app.wire import Error, Tick
from study.store import WHAT_TO_DO
from tests.support import lab_server as labs
from tests.support.dashboard_client import dashboard
from tests.support.lab_server import LabServer
from tests.support.wire_client import invite, visit

TOLD_WITHIN_S = 20.0
"""Far longer than it takes: half a second for what is gone, five for what cannot be written on an idle lab."""


def get(lab: LabServer, path: str, **options: Any) -> httpx.Response:
    return httpx.get(f"{lab.base_url}/api/{path}", trust_env=False, **options)


def samples(lab: LabServer, **options: Any) -> dict[tuple[str, tuple[tuple[str, str], ...]], float]:
    answer = get(lab, "metrics", **{"headers": lab.headers, **options})
    assert answer.status_code == 200
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


def once_it_is(lab: LabServer, status: int) -> dict[str, Any]:
    """What health says once it has that status."""
    until_s = time.monotonic() + TOLD_WITHIN_S
    while (answer := get(lab, "health")).status_code != status:
        assert time.monotonic() < until_s, answer.text
        time.sleep(0.05)
    told: dict[str, Any] = answer.json()
    return told


METRICS_TOKEN = "a-token-for-prometheus-0123456789abcdef"


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabServer]:
    """Whose disk is troubled: it is well again after each test."""
    folder = tmp_path_factory.mktemp("troubled") / "data"
    environment = {"SALAB_METRICS_TOKEN": METRICS_TOKEN}
    with labs.start(folder, "--robot", "kinematic", "--no-scene", environment=environment) as running:
        yield running


def test_a_lab_that_is_well_says_so_to_everybody(quick_lab: LabServer) -> None:
    told = get(quick_lab, "health").json()
    assert {name: told[name] for name in ("status", "study", "robot", "look")} == {
        "status": "ok",
        "study": "Moving objects with a robot arm",
        "robot": "kinematic",
        "look": "none",
    }
    assert get(quick_lab, "health/live").json() == {"status": "ok"}
    ready = get(quick_lab, "health/ready")
    assert (ready.status_code, ready.json()["status"]) == (200, "ok")
    assert [check["name"] for check in ready.json()["checks"]] == ["store", "data_folder", "workers", "room", "scene"]
    assert all(get(quick_lab, path).headers["cache-control"] == "no-store" for path in ("health", "health/live"))


def test_a_lab_whose_disk_takes_nothing_is_alive_and_not_well(lab: LabServer) -> None:
    before = resource.prlimit(lab.process.pid, resource.RLIMIT_FSIZE, (1, resource.RLIM_INFINITY))
    told = once_it_is(lab, 503)
    assert told["status"] == "failing" and told["detail"]
    assert [check["name"] for check in told["checks"] if check["reason"]] == ["store"]
    assert get(lab, "health/live").status_code == 200
    ready = get(lab, "health/ready")
    assert (ready.status_code, ready.json()["status"], ready.json()["detail"]) == (503, "not_ready", told["detail"])
    assert sum(value for (name, _), value in samples(lab).items() if name == "salab_store_trouble") == 1
    assert samples(lab)["salab_healthy", (("check", "store"),)] == 0
    resource.prlimit(lab.process.pid, resource.RLIMIT_FSIZE, before)
    assert once_it_is(lab, 200)["detail"] == ""
    assert get(lab, "health/ready").status_code == 200


def test_a_lab_whose_data_folder_is_gone_says_so_and_names_no_path(lab: LabServer) -> None:
    elsewhere = lab.data_dir.rename(lab.data_dir.with_name("elsewhere"))
    told = once_it_is(lab, 503)
    assert [check["name"] for check in told["checks"] if check["reason"]] == ["store", "data_folder"]
    assert told["detail"] == WHAT_TO_DO["gone"]
    assert str(lab.data_dir.parent) not in get(lab, "health").text
    elsewhere.rename(lab.data_dir)
    once_it_is(lab, 200)


def test_the_metrics_open_to_the_experimenter_and_to_a_token_that_opens_nothing_else(lab: LabServer) -> None:
    reader = {"Authorization": f"Bearer {METRICS_TOKEN}"}
    assert get(lab, "metrics").status_code == 403
    assert get(lab, "metrics", headers=lab.headers).status_code == 200
    answer = get(lab, "metrics", headers=reader)
    assert answer.status_code == 200 and answer.headers["content-type"].startswith("text/plain; version=")
    assert get(lab, "sessions", headers=reader).status_code == 403
    guesses = [get(lab, "metrics", headers={"Authorization": f"Bearer guess-{n}"}).status_code for n in range(11)]
    assert guesses[-1] == 429


async def test_what_happens_is_counted_and_nobody_is_in_it(quick_lab: LabServer) -> None:
    before = samples(quick_lab)
    made = invite(quick_lab, label="Ada of Rose Street", pace="real_time")
    async with dashboard(quick_lab) as watching, visit(made["link"]) as player:
        await watching.line(made["participant"], lambda line: bool(line["connected"]))
        await player.reach_trial()
        async with player.beating((1, 0, 0)):
            await player.until(Tick)
            await player.until(Tick)
        await player.send("no JSON")
        assert (await player.until(Error)).code == "malformed"
        now = samples(quick_lab)
        text = get(quick_lab, "metrics", headers=quick_lab.headers).text
    grown = {key: value - before.get(key, 0.0) for key, value in now.items()}

    def by(name: str, **labels: str) -> float:
        return grown[name, tuple(sorted(labels.items()))]

    assert by("salab_ticks_total") == by("salab_tick_late_seconds_count") >= 2
    assert by("salab_tick_late_seconds_bucket", le="+Inf") == by("salab_ticks_total")
    assert by("salab_commit_seconds_count") > by("salab_ticks_total")  # pages and events besides
    assert by("salab_worker_starts_total") >= 1 and by("salab_worker_restarts_total") == 0
    assert by("salab_messages_refused_total", code="malformed") == 1
    assert by("salab_http_requests_total", method="GET", route="/p/{token}", status="303") >= 1
    assert by("salab_http_requests_total", method="POST", route="/api/participants", status="201") == 1
    assert by("salab_sessions", state="trial") == 1
    assert by("salab_connections", role="participant") == by("salab_connections", role="dashboard") == 1
    assert by("salab_workers") == 1
    queues = ("salab_store_queue_length", "salab_session_queue_length", "salab_outgoing_queue_longest")
    assert all((name, ()) in now for name in queues)
    assert by("salab_bounds_reached_total", bound="requests") == 0
    assert now["process_resident_memory_bytes", ()] > 0
    token = urlsplit(made["link"]).path.rpartition("/")[2]
    for personal in (made["participant"], token, "Ada", "Rose", "127.0.0.1", quick_lab.experimenter_token):
        assert personal not in text


def test_a_stranger_cannot_make_the_metrics_grow(quick_lab: LabServer) -> None:
    get(quick_lab, "metrics", headers=quick_lab.headers)
    with httpx.Client(base_url=quick_lab.base_url, trust_env=False, timeout=30.0) as stranger:
        stranger.get("/nowhere-0")
        stranger.request("BREW", "/p/token")
        before = set(samples(quick_lab))
        for number in range(20):
            for path in (
                f"/nowhere-{number}",
                f"/p/token-{number}",
                f"/static/{number}",
                f"/s/{number}/",
                f"/{number}/x",
            ):
                stranger.get(path)
            stranger.request(f"M{number}", "/p/token")
        grown = set(samples(quick_lab)) - before
    routes = {dict(labels)["route"] for name, labels in grown}
    assert routes <= {"(none)", "/p/{token}", "/static", "/s/{public_id}/"}
