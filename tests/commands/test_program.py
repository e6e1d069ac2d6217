"""The program itself: what its helps say, that their examples can be typed, and what is no command."""

from __future__ import annotations

import importlib.metadata
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from app.__main__ import main
from app.commands import CommandDoc, OptionDoc, described
from app.commands.groups import GROUPS
from app.commands.program import PROJECT_FILE, program
from app.commands.replication import TRANSITIONS
from app.replication.fit import VARIANTS
from app.simulated.presets import PRESET_NAMES
from app.simulated.variants import preset_changes
from app.trial.robots import ROBOTS

ROOT = Path(__file__).resolve().parents[2]
COMMANDS = described()
HEAVY = {"asyncio", "numpy", "pydantic", "rich", "fastapi", "sqlalchemy", "pandas", "scipy", "matplotlib"}
each_command = pytest.mark.parametrize("command", COMMANDS, ids=[command.name for command in COMMANDS])


def values_of(line: str) -> dict[str, object]:
    """What the command of that line would be given."""
    name, *arguments = shlex.split(line.removeprefix("salab "))
    return dict(program().commands[name].make_context(name, arguments).params)


def help_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main([*arguments, "--help"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    return printed.out


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line that is said about arguments that are no command."""
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("salab") and printed.err.count("\n") == 1
    return printed.err


# --- helps -------------------------------------------------------------------------------------------------------


def test_alone_it_lists_every_command_under_its_group(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    said = capsys.readouterr().out
    assert said == help_of(capsys)
    _, *parts = re.split(r"^([A-Z][^:\n]+):$", said, flags=re.MULTILINE)
    listed = {
        group: re.findall(r"^  (\w[\w-]*) ", text, re.MULTILINE)
        for group, text in zip(parts[::2], parts[1::2], strict=True)
    }
    assert listed.pop("Options") == []
    assert listed == {group: [each.name for each in COMMANDS if each.group == group] for group in GROUPS}
    assert "..." not in said.replace("COMMAND ...", "")  # no line is cut short


@each_command
def test_every_command_has_a_group_a_help_and_an_example_that_can_be_typed(
    command: CommandDoc, capsys: pytest.CaptureFixture[str]
) -> None:
    said = help_of(capsys, command.name)
    assert command.group in GROUPS
    assert command.help.split("\n")[0] in said
    assert f"Example: {command.example}\n" in said  # on one line, to be copied
    assert command.example.split()[:2] == ["salab", command.name]
    assert values_of(command.example)


@each_command
def test_every_option_says_what_it_is_and_no_default_is_none(
    command: CommandDoc, capsys: pytest.CaptureFixture[str]
) -> None:
    said = " ".join(help_of(capsys, command.name).split())
    assert "None" not in said and "False" not in said
    for option in command.options:
        assert option.help
        assert " ".join((*option.flags, option.metavar)).strip() in said
        assert not option.default or f"[default: {option.default}]" in said
        assert not (option.default and option.required)


def test_the_commands_are_described_as_values() -> None:
    assert [command.name for command in COMMANDS] == list(program().commands)
    analyze = next(command for command in COMMANDS if command.name == "analyze")
    assert analyze.options == (
        OptionDoc((), "DIR", "", "folder that `salab export` or `salab simulate` wrote", required=True),
        OptionDoc(("--out",), "REPORT", "", "folder to write the report into", required=True),
        OptionDoc(("--changed",), "", "", "take files as they are that were changed since the export", required=False),
    )
    (quiet,) = (option for each in COMMANDS for option in each.options if option.flags == ("--quiet",))
    assert quiet == OptionDoc(("--quiet",), "", "", "no progress", required=False)


def test_the_version_is_the_installed_one_or_the_checkouts(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"salab {importlib.metadata.version('shared-autonomy-lab')}\n"

    def nothing_installed(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", nothing_installed)
    assert main(["--version"]) == 0
    version = capsys.readouterr().out.removeprefix("salab ").strip()
    assert f'\nversion = "{version}"\n' in PROJECT_FILE.read_text(encoding="utf-8")


@pytest.mark.parametrize("arguments", ["--help", "simulate --help"])
def test_a_help_loads_nothing_heavy(arguments: str) -> None:
    code = f"import sys; from app.__main__ import main; main({arguments.split()!r}); print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    )
    loaded = done.stdout.splitlines()[-1].split()
    assert "app.commands.serve" in loaded
    assert not HEAVY & set(loaded)


# --- choices -----------------------------------------------------------------------------------------------------


def test_choices_are_those_of_their_rooms(capsys: pytest.CaptureFixture[str]) -> None:
    for command in COMMANDS:
        metavars = {flag: option.metavar for option in command.options for flag in option.flags}
        assert metavars.get("--robot", "|".join(ROBOTS.shipped)) == "|".join(ROBOTS.shipped)
        assert metavars.get("--preset", "|".join(PRESET_NAMES)) == "|".join(PRESET_NAMES)
    assert set(TRANSITIONS) == {"both", *VARIANTS}
    for preset in PRESET_NAMES:
        assert bool(preset_changes(preset)) == (preset != "shipped")
    said = refused(capsys, "simulate", "--robot", "wooden", "--out", "x")
    assert "--robot" in said and "'wooden'" in said and ", ".join(ROBOTS.names) in said
    assert "'fast' is not one of real_time, lockstep" in refused(capsys, "serve", "--pace", "fast")


# --- what is no command ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("serv", "Did you mean 'serve'?"),
        ("--port 8000", "--port"),
        ("serve --prot 8000", "--port"),
        ("serve --port", "salab serve: Option '--port' requires an argument; see `salab serve --help`"),
        ("simulate --seed seven --out x", "'--seed': 'seven' is not a whole number; see `salab simulate --help`"),
        ("simulate", "Missing option '--out'"),
        ("check", "Missing argument 'FILE'"),
        ("check one.toml two.toml", "two.toml"),
        ("power --sizes --out x", "--out"),
        ("power --sizes 6 twelve --out x", "'twelve' is not a whole number"),
    ],
)
def test_what_is_no_command_is_one_line_with_status_2(line: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert says in refused(capsys, *line.split())


def test_what_was_typed_wrong_ends_a_process_with_2() -> None:
    done = subprocess.run([sys.executable, "-m", "app", "nope"], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "salab: No such command 'nope'; see `salab --help`\n"


def test_an_interrupt_ends_with_130(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("app.simulated.study.make_plan", interrupted)
    assert main(["simulate", "--out", "x"]) == 130
    monkeypatch.setattr("app.commands.program.get_command", interrupted)
    assert main(["simulate", "--out", "x"]) == 130


# --- several numbers after one option ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "sizes",
    ["--sizes 6 12 18", "--sizes 6,12,18", "--sizes=6,12,18", "--sizes 6 --sizes 12 --sizes 18", "--sizes 6,12 18"],
)
def test_sizes_are_given_in_several_ways(sizes: str) -> None:
    for line in (f"salab power {sizes} --out x", f"salab power --draws 3 --out x {sizes}"):
        values = values_of(line)
        assert values["sizes"] == [6, 12, 18]
        assert str(values["out"]) == "x"
    assert values_of("salab power --out x")["sizes"] == [6, 12, 18, 24, 36, 48]
