"""The threat model claims nothing that no test holds."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "topics" / "threat-model.md"
MAX_LINES = 120
"""A page."""


def existing() -> set[str]:
    """The names of all tests."""
    return {
        node.name
        for path in (ROOT / "tests").rglob("test_*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and node.name.startswith("test_")
    }


def test_every_test_that_the_threat_model_names_exists() -> None:
    named = set(re.findall(r"`(test_\w+)`", PAGE.read_text(encoding="utf-8")))
    assert len(named) > 30
    assert named - existing() == set()


def test_everybody_in_it_is_held_by_a_test() -> None:
    text = PAGE.read_text(encoding="utf-8").partition("## Who, and what holds them")[2].partition("## ")[0]
    who = [part for part in re.split(r"\n(?=\*\*)", text) if part.startswith("**")]
    assert len(who) >= 9
    assert [part.partition("**")[2][:40] for part in who if "`test_" not in part] == []


def test_it_is_one_page() -> None:
    assert len(PAGE.read_text(encoding="utf-8").splitlines()) <= MAX_LINES
