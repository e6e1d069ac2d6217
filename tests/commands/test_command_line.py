"""`salab`: what cannot be done is one clear line on stderr and exit status 1, before anything is served."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from app.__main__ import main
from app.commands.serve import listen
from app.config import LabConfig, public_url
from sim.view import published
from study.export.export import read_table
from study.flow.roster import EnrolmentKind
from study.store import open_store
from tests.support.lab_server import ROOT, LabDidNotStart, LabServer
from tests.support.study_samples import UTC, shipped_study
from tests.support.wire_client import invite, write_study

QUICK = ("--robot", "kinematic", "--no-scene")


def fails(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What is printed by a command that must end with status 1."""
    assert main(arguments) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("salab: ")
    assert "Traceback" not in printed.err
    return printed.err.removeprefix("salab: ")


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_a_busy_port(tmp_path: Path, taken_port: int, capsys: pytest.CaptureFixture[str]) -> None:
    said = fails(capsys, "serve", "--port", str(taken_port), "--data", str(tmp_path / "data"), *QUICK)
    assert said.count("\n") == 1
    assert f"127.0.0.1:{taken_port}" in said and "--port" in said
    assert not (tmp_path / "data").exists()


def test_an_address_that_is_not_ours(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = fails(capsys, "serve", "--host", "192.0.2.1", "--port", "0", "--data", str(tmp_path / "data"), *QUICK)
    assert said.count("\n") == 1 and "192.0.2.1" in said


@pytest.mark.parametrize(
    ("host", "url", "says"),
    [
        ("0.0.0.0", None, "--host 0.0.0.0 listens on every address"),
        ("::", None, "add --public-url"),
        ("127.0.0.1", "lab.example", "must be an address such as https://lab.example"),
        ("127.0.0.1", "ftp://lab.example", "must be an address"),
        ("127.0.0.1", "https://me:secret@lab.example", "must be an address"),
        ("127.0.0.1", "https://lab.example/?a=b", "without ? and #"),
        ("127.0.0.1", "https://lab.example/my study", "in its path"),
        ("127.0.0.1", "https://lab.example/../x", "in its path"),
        ("127.0.0.1", "https://lab.example/api/v2", "one of the lab's own: api, "),
    ],
)
def test_what_no_link_can_begin_with(
    host: str, url: str | None, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["--public-url", url] if url else []
    said = fails(capsys, "serve", "--host", host, *given, "--port", "0", "--data", str(tmp_path / "data"), *QUICK)
    assert said.count("\n") == 1 and says in said
    assert not (tmp_path / "data").exists()


def test_links_begin_with_the_public_address_and_its_path() -> None:
    assert public_url("https://lab.example/a/b//", "0.0.0.0") == "https://lab.example/a/b"
    assert public_url("http://[::1]:8000", "::1") == "http://[::1]:8000"
    assert public_url(None, "127.0.0.1") is None


@pytest.mark.parametrize("port", ["-1", "65536", "eighty", ""])
def test_no_port_at_all(port: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", f"--port={port}"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert repr(port) in said and "--port" in said and "ports are 0 to 65535" in said


@pytest.mark.parametrize("number", ["-1", "100001"])
def test_no_number_of_people_at_all(number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = fails(capsys, "serve", f"--capacity={number}", "--port", "0", "--data", str(tmp_path / "data"), *QUICK)
    assert said == f"--capacity {number}: must be from 0 (no bound) to 100000\n"
    assert main(["serve", "--capacity=many"]) == 2
    assert "'many' is not a whole number" in capsys.readouterr().err
    assert not (tmp_path / "data").exists()


def test_a_data_folder_that_cannot_be_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("in the way")
    for folder in (tmp_path / "file", tmp_path / "file" / "data", Path("/proc/salab")):
        said = fails(capsys, "serve", "--port", "0", "--data", str(folder), *QUICK)
        assert said.count("\n") == 1
        assert str(folder) in said and "cannot be used as data folder" in said


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_data_folder_without_permission(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "data").mkdir(mode=0o500)
    assert "Permission denied" in fails(capsys, "serve", "--port", "0", "--data", str(tmp_path / "data"), *QUICK)


def test_a_foreign_file_in_the_data_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "lab.sqlite").write_bytes(b"this is no database, however long it may be" * 100)
    said = fails(capsys, "serve", "--port", "0", "--data", str(tmp_path), *QUICK)
    assert said.count("\n") == 1 and "lab.sqlite" in said
    assert (tmp_path / "lab.sqlite").read_bytes().startswith(b"this is no database")


def test_an_invalid_study_file_tells_every_mistake_with_its_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changes = {
        'layout = "arc"': 'layout = "circle"',
        "rationality_per_m = 5.0 ": "rationality_per_m = -5.0 ",
        'placement = "same_page_away" ': 'placement = "next_door" ',
        "digits = 4": "digitz = 4",
    }
    study = write_study(tmp_path, changes)
    said = fails(capsys, "serve", "--port", "0", "--data", str(tmp_path / "data"), "--study", str(study), *QUICK)
    lines = study.read_text().splitlines()
    for field, wrong in (
        ("layout", "circle"),
        ("rationality_per_m", "-5.0"),
        ("placement", "next_door"),
        ("digitz", ""),
    ):
        number = next(index for index, line in enumerate(lines, 1) if line.startswith(field))
        told = next(line for line in said.splitlines() if field in line)
        assert wrong in told
        assert str(number) in told
    assert "study.toml" in said
    assert "arc" in said and "rows" in said  # the layouts there are
    assert "second_device" in said and "same_page_away" in said
    assert not (tmp_path / "data" / "lab.sqlite").exists()


def test_a_look_that_is_not_installed_is_refused_before_anything_is_served(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(published, "published_meshes_dir", lambda: None)
    study = write_study(tmp_path, {'look = "own"': 'look = "published"'})
    given = ("--port", "0", "--data", str(tmp_path / "data"), "--study", str(study), "--robot", "kinematic")
    said = fails(capsys, "serve", *given)
    assert said.count("\n") == 1 and 'look = "published"' in said and "extra `meshes`" in said
    assert not (tmp_path / "data" / "lab.sqlite").exists()


@pytest.mark.parametrize("text", ["not = [valid", "", "\x00", "title = 1\n"])
def test_a_study_file_that_is_none(tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "study.toml").write_text(text)
    said = fails(
        capsys, "serve", "--port", "0", "--data", str(tmp_path), "--study", str(tmp_path / "study.toml"), *QUICK
    )
    assert "study.toml" in said


def test_a_study_file_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = fails(
        capsys, "serve", "--port", "0", "--data", str(tmp_path), "--study", str(tmp_path / "mine.toml"), *QUICK
    )
    assert said.count("\n") == 1 and "mine.toml" in said


@pytest.mark.slow
def test_a_second_lab_on_the_same_data_is_refused(quick_lab: LabServer, capsys: pytest.CaptureFixture[str]) -> None:
    said = fails(capsys, "serve", "--port", "0", "--data", str(quick_lab.data_dir), *QUICK)
    assert said.count("\n") == 1 and "another lab is running" in said


def test_a_lab_that_cannot_start_ends_with_one_line_as_a_process(
    start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    with pytest.raises(LabDidNotStart) as failed:
        start_lab(*QUICK, "--study", str(tmp_path / "mine.toml"))
    assert "ended with 1" in str(failed.value)
    assert "Traceback" not in str(failed.value)


def test_stopping_the_lab_leaves_no_traceback(start_lab: Callable[..., LabServer]) -> None:
    lab = start_lab(*QUICK)
    lab.process.send_signal(signal.SIGINT)
    code = lab.process.wait(15)
    assert code in (0, 130, -signal.SIGINT)
    lab.close()
    assert "Traceback" not in lab.log()


def test_the_experimenters_token_is_made_and_printed_when_none_is_given(start_lab: Callable[..., LabServer]) -> None:
    lab = start_lab(*QUICK, environment={"SALAB_EXPERIMENTER_TOKEN": ""})
    token = lab.experimenter_link.partition("#token=")[2]
    assert len(token) >= 22
    for given, status in ((token, 200), ("", 403)):
        headers = {"Authorization": f"Bearer{' ' * bool(given)}{given}"}
        assert (
            httpx.get(f"{lab.base_url}/api/sessions", headers=headers, trust_env=False, timeout=30.0).status_code
            == status
        )


# --- export ------------------------------------------------------------------------------------------------------


def test_an_export_of_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = fails(capsys, "export", "--data", str(tmp_path / "none"), "--out", str(tmp_path / "out"))
    assert said.count("\n") == 1
    assert str(tmp_path / "none") in said and "no lab data here" in said
    assert not (tmp_path / "none").exists() and not (tmp_path / "out").exists()


def test_an_export_beside_a_running_lab_and_never_over_other_files(
    quick_lab: LabServer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made, out = invite(quick_lab), tmp_path / "out"
    assert main(["export", "--data", str(quick_lab.data_dir), "--out", str(out)]) == 0
    assert str(out) in capsys.readouterr().out
    assert made["participant"] in (out / "participants.csv").read_text()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    said = fails(capsys, "export", "--data", str(quick_lab.data_dir), "--out", str(tmp_path / "mine"))
    assert said.count("\n") == 1 and str(tmp_path / "mine") in said
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.txt"]
    (tmp_path / "file").write_text("in the way")
    assert fails(capsys, "export", "--data", str(quick_lab.data_dir), "--out", str(tmp_path / "file")).count("\n") == 1


# --- the rest ----------------------------------------------------------------------------------------------------


def test_every_command_has_help() -> None:
    said = subprocess.run(
        [sys.executable, "-m", "app", "--help"], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    ).stdout
    for command in ("serve", "export", "bot"):
        assert command in said


def test_the_defaults_stand_in_one_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    defaults = LabConfig()
    for value in (defaults.host, defaults.port, defaults.data_dir, defaults.pace):
        assert f"[default: {value}]" in said


async def test_what_the_lab_sends_leaves_at_once() -> None:
    """Nagle's delay is off on the connections of the lab's socket: a tick must not wait for an acknowledgement."""
    options: asyncio.Queue[int] = asyncio.Queue()

    class Taker(asyncio.Protocol):
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            accepted = transport.get_extra_info("socket")
            options.put_nowait(accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            transport.close()

    with listen("127.0.0.1", 0) as listener:
        async with await asyncio.get_running_loop().create_server(Taker, sock=listener):
            _, writer = await asyncio.open_connection(*listener.getsockname())
            assert await asyncio.wait_for(options.get(), 5.0) != 0
            writer.close()


# --- erasing -----------------------------------------------------------------------------------------------------


def test_erase_says_what_it_would_do_and_does_it_with_yes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = tmp_path / "data"
    erase = ("erase", "--data", str(data), "--participant")
    assert "no lab data here" in fails(capsys, *erase, "P001", "--yes")
    assert not (data / "lab.sqlite").exists()
    with open_store(data, exclusive=True) as store:
        kinds: tuple[EnrolmentKind, ...] = ("study", "pilot")
        for number, kind in enumerate(kinds):
            store.create_participant(
                shipped_study(),
                seed=number,
                public_id=f"{number}",
                utc=UTC,
                kind=kind,
                identities={"label": "Ada of the Dentist"} if kind == "study" else None,
            )
        assert "another lab is running" in fails(capsys, *erase, "P001", "--yes")
    assert "no participant 'P009'" in fails(capsys, *erase, "P009", "--yes")
    assert "--yes" in fails(capsys, *erase, "P001")
    left = [data / "report", data / ".report-1"]  # a lab or a report's process that was killed could not take them away
    for folder in left:
        folder.mkdir()
    assert main([*erase, "P001", "--yes"]) == 0
    assert not any(folder.exists() for folder in left)
    assert "erased P001" in capsys.readouterr().out
    with open_store(data, must_exist=True) as store:
        assert [each.participant for each in store.sessions()] == ["T002"]
        assert [name for name, _ in store.erasures()] == ["P001"]
    assert all(b"Ada of the Dentist" not in file.read_bytes() for file in data.iterdir())


def test_pilots_are_exported_when_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with open_store(tmp_path / "data") as store:
        store.create_participant(shipped_study(), seed=1, public_id="p", utc=UTC, kind="pilot")
    for flags, people in (((), 0), (("--pilot",), 1)):
        out = tmp_path / f"out{people}"
        assert main(["export", "--data", str(tmp_path / "data"), "--out", str(out), *flags]) == 0
        assert len(read_table(out, "participants")) == people
    assert "exported" in capsys.readouterr().out
