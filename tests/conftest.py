"""Fixtures for every test: loopback only, a Chromium, a running lab."""

from __future__ import annotations

import ipaddress
import itertools
import os
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from app.trial.robots import ROBOTS
from tests.support import chromium, postgres_server
from tests.support import lab_server as labs
from tests.support.lab_server import LabServer
from tests.support.long_cases import is_long
from tests.support.postgres_server import PostgresServer
from tests.support.quick_tests import is_quick

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext, Page

CHROMIUM_ARGUMENTS = [
    "--no-sandbox",  # tests run as root in containers
    "--disable-gpu",
    "--use-angle=swiftshader",  # WebGL without a graphics card
    "--enable-unsafe-swiftshader",
    "--mute-audio",
    # It must ask nobody but the lab:
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--no-first-run",
]

FEW_PICTURES = Path(__file__).with_name("support") / "few_pictures.js"
WHOLE_STUDY = "test_study_browser.py"

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # Begun in a shell's background, where Ctrl+C is not heard; tests send it, to themselves and to labs.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Whatever asks for a browser is marked `browser`, and a whole study in one begins first: nothing takes as long.

    What is marked with a robot is skipped where its physics is not installed, and what `make test-long` and
    `make test-fast` run is marked.
    """
    skips = {name: pytest.mark.skip(reason=why) for name in ROBOTS.libraries if (why := ROBOTS.lacking(name))}
    for item in items:
        if "chromium_path" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.browser)
        if {"postgres", "own_postgres"} & set(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.postgres)
        if is_long(item.nodeid):
            item.add_marker(pytest.mark.long)
        if is_quick(item) and not any(mark.name == "postgres" for mark in item.iter_markers()):
            item.add_marker(pytest.mark.quick)
        for name in skips.keys() & {mark.name for mark in item.iter_markers()}:
            item.add_marker(skips[name])
    items.sort(key=lambda item: item.path.name != WHOLE_STUDY)


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, empty."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


class NetworkForbidden(RuntimeError):
    """A test tried to leave the machine."""


def is_loopback(family: int, address: Any) -> bool:
    """Whether a socket of `family` may connect to `address` in a test: unix sockets and loopback only."""
    if family not in (socket.AF_INET, socket.AF_INET6):
        return True
    host = address[0]
    if host in ("", "localhost"):
        return True
    try:
        return ipaddress.ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return False  # a name: resolving it asks somebody else


@pytest.fixture(scope="session", autouse=True)
def loopback_only() -> Iterator[None]:
    """No test reaches beyond this machine (in this process; the lab's own pages are checked in the browser)."""
    connect, connect_ex = socket.socket.connect, socket.socket.connect_ex

    def check(sock: socket.socket, address: Any) -> None:
        if not is_loopback(sock.family, address):
            raise NetworkForbidden(f"a test tried to connect to {address}: tests stay on loopback")

    def guarded_connect(sock: socket.socket, address: Any) -> None:
        check(sock, address)
        connect(sock, address)

    def guarded_connect_ex(sock: socket.socket, address: Any) -> int:
        check(sock, address)
        return connect_ex(sock, address)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(socket.socket, "connect", guarded_connect)
        patch.setattr(socket.socket, "connect_ex", guarded_connect_ex)
        yield


# --- a browser ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def chromium_path() -> Path:
    """The Chromium to drive: $CHROMIUM, else one on PATH, else playwright's own."""
    try:
        return chromium.find()
    except chromium.NoChromium as error:
        pytest.fail(str(error), pytrace=False)


@pytest.fixture(scope="module")
def browser(chromium_path: Path) -> Iterator[Browser]:
    """A headless Chromium through playwright's sync API, one for each test module.

    Not one for the session: while playwright's sync API is running, no other event loop can start in this thread,
    so a module that uses it has no async tests, and modules with async tests find it ended.
    """
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=chromium_path, args=CHROMIUM_ARGUMENTS)
        yield started
        started.close()


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A fresh profile: no cookies, no storage, 1280x720. More pages in it are tabs of the same person."""
    fresh = browser.new_context(viewport={"width": 1280, "height": 720}, reduced_motion="reduce")
    fresh.add_init_script(path=FEW_PICTURES)
    yield fresh
    fresh.close()


@pytest.fixture
def page(context: BrowserContext) -> Page:
    return context.new_page()


@pytest.fixture
def no_script_errors(page: Page) -> Iterator[None]:
    """A page that throws is broken, whatever else the test finds."""
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    yield
    assert errors == []


@pytest.fixture(scope="session")
def screenshot_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where pictures for people go: $SALAB_SCREENSHOTS, else a temporary folder."""
    chosen = os.environ.get("SALAB_SCREENSHOTS")
    folder = Path(chosen) if chosen else tmp_path_factory.mktemp("screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


# --- a database server -------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    """One PostgreSQL server for the whole session, whose databases tests make for themselves."""
    try:
        server = postgres_server.start()
    except postgres_server.NoPostgres as error:
        if postgres_server.is_required(os.environ):
            pytest.fail(str(error), pytrace=False)
        pytest.skip(str(error))
    yield server
    postgres_server.remove(server)


@pytest.fixture
def own_postgres(postgres: PostgresServer) -> Iterator[PostgresServer]:
    """One of the test's own, which it may stop. Where there is one for the session there is one more."""
    server = postgres_server.start()
    yield server
    postgres_server.remove(server)


# --- a running lab -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def lab_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabServer]:
    """One lab for the whole session, for tests that only add participants of their own to it."""
    with labs.start(tmp_path_factory.mktemp("lab") / "data") as running:
        yield running


@pytest.fixture
def start_lab(tmp_path: Path) -> Iterator[Callable[..., LabServer]]:
    """Starts labs of this test's own: `start_lab("--study", path, data_dir=..., environment={...})`."""
    running: list[LabServer] = []
    numbers = itertools.count()

    def start(*arguments: str, data_dir: Path | None = None, **options: Any) -> LabServer:
        folder = data_dir or tmp_path / f"data{next(numbers)}"
        running.append(labs.start(folder, *arguments, **options))
        return running[-1]

    yield start
    for server in reversed(running):
        server.close()


@pytest.fixture(scope="session")
def open_lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabServer]:
    """One lab for the whole session that recruits over an open link and checks devices, behind a proxy that takes the
    path of its public address away. Its base_url and links lead through that proxy."""
    from tests.support.reverse_proxy import PrefixProxy
    from tests.support.wire_client import OPEN, SHORT, write_study

    folder = tmp_path_factory.mktemp("open")
    study = write_study(folder, {**SHORT, **OPEN})
    with PrefixProxy("/study") as proxy:
        arguments = ("--robot", "kinematic", "--study", str(study), "--public-url", proxy.url)
        with labs.start(folder / "data", *arguments) as running:
            proxy.port = running.port
            yield running


@pytest.fixture(scope="session")
def quick_lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabServer]:
    """One lab for the whole session that needs no physics engine: the short study, in lockstep, without a scene.

    A participant made with `pace="real_time"` runs against the clock.
    """
    from tests.support.wire_client import write_study

    folder = tmp_path_factory.mktemp("quick")
    arguments = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", str(write_study(folder)))
    with labs.start(folder / "data", *arguments) as running:
        yield running
