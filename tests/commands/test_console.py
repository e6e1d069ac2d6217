"""Consoles that cannot print, that nobody reads, or that are not there: no traceback, and a lab goes on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.commands import console
from app.commands.options import place
from app.errors import LabError
from study.definition.study import DEFAULT_STUDY
from tests.support import lab_server
from tests.support.lab_server import ROOT
from tests.support.typed_command import run

TITLE = "Étude “プ” \u2028\x1b[2J"
ASCII = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def titled(folder: Path) -> Path:
    """The shipped study under a title that many consoles have no letters for."""
    text = DEFAULT_STUDY.read_text(encoding="utf-8")
    line = next(line for line in text.split("\n") if line.startswith("title = "))
    file = folder / "étude.toml"
    file.write_text(text.replace(line, 'title = "Étude “プ” \\u2028\\u001b[2J"'), encoding="utf-8")
    return file


def salab(*arguments: str, shell: str = "{}", **environment: str) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, inside a shell's line."""
    typed = " ".join([f"'{sys.executable}'", "-m", "app", *(f"'{each}'" for each in arguments)])
    return subprocess.run(
        ["bash", "-c", "set -o pipefail; " + shell.format(typed)],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        errors="surrogateescape",
        timeout=120,
    )


def test_a_console_without_the_letters_still_tells(tmp_path: Path) -> None:
    done = salab("check", str(titled(tmp_path)), **ASCII)
    assert (done.returncode, done.stderr) == (0, "")
    assert "tude.toml: fine" in done.stdout and done.stdout.isascii()


@pytest.mark.parametrize(
    ("shell", "status", "said"),
    [
        ("{} | true", console.GONE, ""),
        ("{} >&-", 0, ""),
        ("{} >&- 2>&- <&-", 0, ""),
        ("{} > /dev/full", 1, "salab: No space left on device\n"),
    ],
)
def test_a_command_that_nobody_reads_ends_without_a_traceback(shell: str, status: int, said: str) -> None:
    done = salab("check", "--help", shell=shell)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", said)


def test_a_lab_goes_on_when_the_console_cannot_print_its_title(tmp_path: Path) -> None:
    arguments = ("--study", str(titled(tmp_path)), "--no-scene", "--robot", "kinematic")
    with lab_server.start(tmp_path / "dåta", *arguments, environment=ASCII) as lab:
        said = lab.log()
        assert "READY" in said  # it came that far, and answers
    title = next(line for line in said.splitlines() if line.startswith("Shared Autonomy Lab"))
    assert title == r"Shared Autonomy Lab: \xc9tude \u201c\u30d7\u201d \u2028\x1b[2J"


def test_a_lab_goes_on_when_nobody_reads_what_it_says(capfd: pytest.CaptureFixture[str]) -> None:
    read, write = os.pipe()
    os.close(read)
    code = "from app.commands import console; console.announce('x' * 9); console.announce('y'); console.flush()"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, stdout=write, stderr=subprocess.PIPE, timeout=60)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, b"")


def test_what_is_shown_stays_in_its_line() -> None:
    assert console.shown("a\nb\u2028\x85\x1b[2J\ud800 ü\u00a0プ") == r"a\nb\u2028\x85\x1b[2J\ud800 ü" + "\u00a0プ"


def test_an_error_is_short_whatever_stands_in_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    console.complain(LabError("a\n" + "x" * 100_000))
    said = capsys.readouterr().err
    assert said.startswith(r"salab: a\nxxx") and said.endswith("x…\n") and len(said) < 2_100


@pytest.mark.parametrize("name", ["no\nsuch", "no\u2028such", "x" * 300, "no/" * 3000])
def test_an_error_is_one_line_whatever_the_file_is_called(
    capsys: pytest.CaptureFixture[str], own_folder: Path, name: str
) -> None:
    for arguments in (
        ["check", f"{name}.toml"],
        ["serve", "--study", f"{name}.toml", "--port", "0"],
        ["export", "--data", name, "--out", "out"],
        ["analyze", name, "--out", "out"],
        ["simulate", "--study", name, "--out", "out"],
    ):
        status, out, err = run(capsys, *arguments)
        assert (status, out) == (1, ""), arguments
        problem, *end = err.splitlines()
        assert problem.startswith(("salab: ", "no", "x")) and len(end) == (arguments[0] == "check"), err[:500]


def test_the_home_folder_is_meant_where_the_shell_leaves_its_sign(
    own_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("HOME", str(own_folder))
    assert place("~/lab") == own_folder / "lab" and place("./~") == Path("~")
    status, _, err = run(capsys, "export", "--data", "", "--out", "out")
    assert status == 2 and "is empty" in err
