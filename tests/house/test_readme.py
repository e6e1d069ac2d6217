"""The README, held to what exists: commands, options, targets, routes, settings, pictures, modules, the example."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import fields
from functools import cache
from pathlib import Path

import pytest

from app.commands import CommandDoc, OptionDoc, described
from app.config import LabConfig
from app.lab.lab import Lab
from app.web.server import create_app
from study.records import TABLES

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
SHELL = [line for kind, text in BLOCKS if kind == "sh" for line in text.replace("\\\n", " ").splitlines()]
SPANS = re.findall(r"(?<!`)`([^`\n]+)`(?!`)", re.sub(r"^```.*?^```", "", README, flags=re.MULTILINE | re.DOTALL))
CODE = [*SHELL, *SPANS]
PICTURES = ROOT / "tests" / "pictures"
MAX_PICTURE_BYTES = 150_000


@cache
def subcommands() -> dict[str, CommandDoc]:
    return {command.name: command for command in described()}


def options_of(command: str) -> dict[str, OptionDoc]:
    return {flag: option for option in subcommands()[command].options for flag in option.flags}


def used(command: str) -> list[str]:
    """What follows `salab command` wherever it is used."""
    return [match.group(1) for text in CODE for match in re.finditer(rf"\bsalab {command}\b([^#&|]*)", text)]


def test_every_subcommand_named_exists_and_every_one_is_named() -> None:
    named = {match for text in CODE for match in re.findall(r"\bsalab ([a-z]+)", text)}
    named |= {span for span in SPANS if span in subcommands()}
    assert named == set(subcommands())


@pytest.mark.parametrize("command", sorted(subcommands()))
def test_every_option_used_exists(command: str) -> None:
    wrong = (
        {o for rest in used(command) for o in re.findall(r"--[a-z-]+", rest)} - set(options_of(command)) - {"--help"}
    )
    assert not wrong, f"salab {command} has no {', '.join(sorted(wrong))}"


def test_every_option_mentioned_by_itself_exists_somewhere() -> None:
    known = {option for command in subcommands() for option in options_of(command)} | {"--all", "--help", "--version"}
    mentioned = {match for span in SPANS for match in re.findall(r"(?<![\w-])--[a-z][a-z-]*", span)}
    assert mentioned <= known


def test_every_setting_of_serve_is_documented_with_its_default() -> None:
    rows = dict(re.findall(r"^\| `(--[a-z-]+)` \| ([^|]*?) *\|", README, re.MULTILINE))
    documented = options_of("serve")
    assert set(rows) == set(documented)
    for option, cell in rows.items():
        default = documented[option].default
        assert cell.strip("`") == default or default == "", f"{option}: {cell} is not {default}"


def test_settings_without_an_option_are_named() -> None:
    for field in fields(LabConfig):
        option = {"data_dir": "data", "study_file": "study", "scene": "no-scene"}.get(field.name, field.name)
        assert f"`--{option.replace('_', '-')}`" in README or f"`{field.name}`" in README, field.name


def test_every_make_target_named_exists_and_every_one_is_named() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):.*## ", makefile, re.MULTILINE)) - {"help"}
    assert {match for text in CODE for match in re.findall(r"\bmake ([a-z-]+)", text)} == targets


def test_every_route_named_exists() -> None:
    paths = create_app(Lab(LabConfig(), None)).openapi()["paths"]
    rows = re.findall(r"^\| ((?:`[^`]+`,? ?)+) \|", README, re.MULTILINE)
    found = 0
    for spans in (re.findall(r"`([^`]+)`", row) for row in rows):
        first: list[str] = spans[0].split()
        if first[0] not in ("GET", "POST"):
            continue
        base = first[1].rpartition("/")[0]
        for span in spans:
            method, path = span.split() if " " in span else (first[0], f"{base}/{span}")
            assert method.lower() in paths.get(path, {}), f"there is no {method} {path}"
            found += 1
    assert found > 8


def test_every_exported_table_is_described() -> None:
    assert set(re.findall(r"^\| `([a-z_]+)` \|", README, re.MULTILINE)) == set(TABLES)


def test_every_picture_is_there_and_small_and_shown() -> None:
    shown = set(re.findall(r"\(tests/pictures/([\w-]+\.png)\)", README))
    assert shown
    for name in shown:
        assert (PICTURES / name).read_bytes().startswith(b"\x89PNG")
    for path in PICTURES.iterdir():
        assert path.stat().st_size <= MAX_PICTURE_BYTES, path.name


def test_every_file_named_exists() -> None:
    folders = ("app", "sim", "study", "tests", "static")
    files = {span for span in SPANS if re.fullmatch(r"[\w.-]+(/[\w.-]+)+\.\w+", span)}
    named = {name for name in files if name.split("/")[0] in folders}
    assert len(named) > 5
    assert not [name for name in named if not (ROOT / name).exists()]


def test_the_example_runs_as_it_stands(tmp_path: Path) -> None:
    (example,) = (text for kind, text in BLOCKS if kind == "python")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{example}"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [line.split()[:2] for line in lines] == [[str(n), "pickup" if n % 2 else "dropoff"] for n in range(1, 7)]
    assert all(line.endswith("success") for line in lines)
