"""What the other tests stand on: the loopback guard, the search for a Chromium, the interpreter `make` picks."""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from tests.conftest import NetworkForbidden, is_loopback
from tests.javascript import check as javascript
from tests.support import chromium, lab_server, postgres_server, real_keys

ROOT = Path(__file__).resolve().parents[2]


def script(path: Path, body: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    path.chmod(0o755)
    return path


# --- loopback ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("address", [("192.0.2.1", 80), ("2001:db8::1", 80, 0, 0), ("lab.example", 443)])
def test_a_test_cannot_leave_the_machine(address: tuple[object, ...]) -> None:
    family = socket.AF_INET6 if len(address) == 4 else socket.AF_INET
    with socket.socket(family) as sock:
        with pytest.raises(NetworkForbidden, match="stay on loopback"):
            sock.connect(address)
        with pytest.raises(NetworkForbidden, match="stay on loopback"):
            sock.connect_ex(address)


def test_loopback_still_works() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection(server.getsockname()) as client:
        accepted, _ = server.accept()
        with accepted:
            client.sendall(b"hello")
            assert accepted.recv(5) == b"hello"
    assert is_loopback(socket.AF_INET6, ("::1", 80, 0, 0))
    assert is_loopback(socket.AF_UNIX, "/run/some.sock")


# --- Chromium ----------------------------------------------------------------------------------------------------


def test_a_stub_on_the_path_is_passed_over(tmp_path: Path) -> None:
    script(tmp_path / "chromium", "echo 'install the snap package instead' >&2; exit 1")
    script(tmp_path / "chromium-browser", "echo 'Command not known'")
    good = script(tmp_path / "google-chrome", "echo 'Google Chrome 140.0'")
    assert chromium.find({"PATH": str(tmp_path)}) == good


def test_a_named_chromium_comes_first_and_a_wrong_one_is_an_error(tmp_path: Path) -> None:
    script(tmp_path / "chromium", "echo 'Chromium 140.0'")
    named = script(tmp_path / "mine" / "headless", "echo 'Chromium 150.0'")
    assert chromium.find({"PATH": str(tmp_path), "CHROMIUM": str(named)}) == named
    with pytest.raises(chromium.NoChromium, match=r"Set CHROMIUM=.*Tried: .*/absent"):
        chromium.find({"PATH": str(tmp_path), "CHROMIUM": str(tmp_path / "absent")})


# --- Node.js -----------------------------------------------------------------------------------------------------


def test_without_node_the_javascript_is_passed_over_aloud(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert javascript.main({"PATH": str(tmp_path)}) == 0
    assert "JavaScript NOT checked: no Node.js" in capsys.readouterr().out


def test_a_node_that_is_too_old_will_not_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script(tmp_path / "npm", "exit 9")
    script(tmp_path / "node", "echo v12.22.0")
    assert javascript.main({"PATH": str(tmp_path)}) == 0
    assert "says 'v12.22.0'" in capsys.readouterr().out
    script(tmp_path / "node", "echo v18.19.0")
    assert javascript.find_npm({"PATH": str(tmp_path)}) == str(tmp_path / "npm")


def test_a_missing_node_that_is_required_is_a_failure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert javascript.main({"PATH": str(tmp_path), "SALAB_REQUIRE_NODE": "1"}) == 1
    assert "JavaScript NOT checked: no Node.js" in capsys.readouterr().out


def test_a_missing_node_that_is_required_is_installed_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "package-lock.json").write_text("{}", encoding="utf-8")
    (tmp_path / "node_modules").mkdir()
    monkeypatch.setattr(javascript, "FOLDER", tmp_path)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    node = script(tmp_path / "stock" / "node", "echo v20.1.0")
    npm = script(tmp_path / "stock" / "npm", 'echo "npm $*"; [ "$1" = ci ] || exit 3')
    bin_folder = tmp_path / "bin"
    install = f'case "$*" in *install*) /bin/ln -s {node} {npm} {bin_folder};; esac; echo "apt-get $*"'
    script(bin_folder / "apt-get", install)
    required = {"PATH": str(bin_folder), "SALAB_REQUIRE_NODE": "1"}
    assert javascript.main(required) == 3, "what the checks ended with"
    said = capfd.readouterr().out
    order = ["apt-get -qq update", "apt-get -qq install", "npm ci ", "npm run --silent check"]
    places = [said.rindex(text) for text in order]
    assert places == sorted(places)
    assert javascript.main(required) == 3
    assert "npm ci" not in capfd.readouterr().out, "what is installed is not installed again"


NPM_WITHOUT_REGISTRY = "echo 'npm error code ECONNREFUSED' >&2; exit 1"
NPM_WITH_A_WRONG_LOCK_FILE = "echo 'npm error code EUSAGE' >&2; exit 7"


@pytest.mark.parametrize(
    ("npm", "required", "code", "said"),
    [
        (NPM_WITHOUT_REGISTRY, "", 0, "JavaScript NOT checked: npm reaches no registry (ECONNREFUSED)"),
        (NPM_WITHOUT_REGISTRY, "1", 1, "JavaScript NOT checked: npm reaches no registry (ECONNREFUSED)"),
        (NPM_WITH_A_WRONG_LOCK_FILE, "", 7, "npm error code EUSAGE"),
    ],
)
def test_without_a_registry_the_javascript_is_passed_over_aloud(
    npm: str,
    required: str,
    code: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "package-lock.json").write_text("{}", encoding="utf-8")
    monkeypatch.setattr(javascript, "FOLDER", tmp_path)
    script(tmp_path / "node", "echo v20.1.0")
    script(tmp_path / "npm", npm)
    assert javascript.main({"PATH": str(tmp_path), "SALAB_REQUIRE_NODE": required}) == code
    assert said in "".join(capfd.readouterr())


# --- real keys ---------------------------------------------------------------------------------------------------


def test_missing_real_keys_are_passed_over_aloud_and_installed_where_they_are_required(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda name: name)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    here = {"PATH": str(tmp_path)}
    assert real_keys.main(here) == 0
    assert "real keys NOT tested: no Xvfb" in capfd.readouterr().out
    assert real_keys.main({**here, "SALAB_REQUIRE_KEYS": "1"}) == 1
    assert (
        "real keys NOT tested: no Xvfb on PATH (Debian, Ubuntu: apt-get install xvfb libxtst6); there is no apt-get"
        in (capfd.readouterr().out)
    )
    stock = script(tmp_path / "stock" / "Xvfb", "exit 9")
    script(tmp_path / "apt-get", f'case "$*" in *install*xvfb*) /bin/ln -s {stock} {tmp_path};; esac')
    assert real_keys.main({**here, "SALAB_REQUIRE_KEYS": "1"}) == 0
    assert "NOT tested" not in capfd.readouterr().out


def test_a_missing_postgresql_is_passed_over_aloud_and_installed_where_it_is_required(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(postgres_server, "DEBIAN", tmp_path / "postgresql")
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    here = {"PATH": str(tmp_path)}
    assert postgres_server.main(here) == 0
    assert "PostgreSQL NOT tested: " in capfd.readouterr().out
    assert postgres_server.main({**here, "SALAB_REQUIRE_POSTGRES": "1"}) == 1
    assert "there is no apt-get" in capfd.readouterr().out


# --- starting a lab ----------------------------------------------------------------------------------------------


def stand_in(root: Path, body: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Something else that is started by `python -m app serve`."""
    (root / "app").mkdir()
    (root / "app" / "__init__.py").touch()  # without it the lab's own package, wherever it is installed, comes first
    (root / "app" / "__main__.py").write_text(body, encoding="utf-8")
    monkeypatch.setattr(lab_server, "ROOT", root)


def test_a_lab_is_ready_when_it_says_so_and_ended_by_its_id(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    links = '{"base_url": "http://127.0.0.1:5/", "experimenter_link": "e", "demo_link": "d"}'
    stand_in(tmp_path, f"import signal\nprint('starting')\nprint('READY {links}')\nsignal.pause()", monkeypatch)
    with lab_server.start(tmp_path / "data") as lab:
        assert (lab.base_url, lab.experimenter_link, lab.demo_link) == ("http://127.0.0.1:5", "e", "d")
        assert lab.process.poll() is None
    assert lab.process.returncode == -signal.SIGTERM
    assert lab.log().startswith("starting\nREADY")


def test_a_lab_that_does_not_start_shows_what_it_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(tmp_path, "import sys\nsys.exit('port 80 is taken')", monkeypatch)
    with pytest.raises(lab_server.LabDidNotStart, match=r"ended with 1:\nport 80 is taken"):
        lab_server.start(tmp_path / "data")


# --- make --------------------------------------------------------------------------------------------------------


def make(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """`make` as a user types it, free of what an outer `make test` hands down."""
    ours = ("MAKE", "MFLAGS", "PYTHON", "VENV", "PORT", "DATA")
    clean = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    found = shutil.which("make")
    assert found, "make is not on PATH"
    return subprocess.run(
        [found, *arguments], cwd=ROOT, env={**clean, **environment}, capture_output=True, text=True, timeout=120
    )


def test_make_alone_prints_every_target() -> None:
    printed = make().stdout
    for target in ("run", "test", "test-fast", "check", "check-js", "bench", "docs", "clean"):
        assert f"  make {target} " in printed


def test_make_passes_over_interpreters_that_do_not_run(tmp_path: Path) -> None:
    script(tmp_path / "shims" / "python3.11", "echo 'command not found' >&2; exit 127")
    # Says it is fine, and shows what it was asked to do instead of making an environment.
    good = script(tmp_path / "bin" / "python3.11", 'case "$1" in -c) exit 0;; *) echo "asked: $*" >&2; exit 9;; esac')
    done = make(
        "run",
        f"VENV={tmp_path / 'venv'}",
        PATH=f"{tmp_path / 'shims'}:{tmp_path / 'bin'}:/usr/bin:/bin",
        HOME=str(tmp_path),
    )
    assert done.returncode != 0
    assert f"with {good}" in done.stdout
    assert f"asked: -m venv --clear {tmp_path / 'venv'}" in done.stderr


def test_make_says_when_the_named_interpreter_will_not_do(tmp_path: Path) -> None:
    old = script(tmp_path / "python3.9", "exit 1")
    done = make("run", f"PYTHON={old}", f"VENV={tmp_path / 'venv'}")
    assert done.returncode != 0
    assert f"PYTHON={old} is no Python 3.10 to 3.14 with its venv module: install one (" in done.stderr
    assert len([line for line in done.stderr.splitlines() if "Python" in line]) == 1
    assert not (tmp_path / "venv").exists()


def test_make_says_what_to_install_when_there_is_no_interpreter(tmp_path: Path) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    for name in ("sh", "tr"):
        (tools / name).symlink_to(shutil.which(name) or f"/bin/{name}")
    script(tools / "python3", "exit 1")  # a 3.9
    done = make("run", f"VENV={tmp_path / 'venv'}", PATH=str(tools), HOME=str(tmp_path))
    if "making" in done.stdout:
        pytest.skip("a Python stands in /usr/local/bin, where make looks whatever PATH says")
    assert done.returncode != 0
    assert "make: no Python 3.10 to 3.14 with its venv module found: install one (" in done.stderr
    assert "python3-venv" in done.stderr
