"""The styles of the participant's pages run both ways: from left to right and from right to left."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

STATIC = Path(__file__).resolve().parents[2] / "static"
PHYSICAL = re.compile(
    r"(?:margin|padding|border)-(?:left|right)(?:-\w+)?\s*:|text-align:\s*(?:left|right)|float:\s*(?:left|right)"
    r"|(?<![-\w])(?:left|right):(?!\s*50%)"
)


def sided(css: str) -> list[str]:
    """What names a side of the screen instead of the beginning or the end of a line."""
    sides = [match.group() for match in PHYSICAL.finditer(css)]
    for match in re.finditer(r"(?:margin|padding|inset):\s*([^;{}()]+);", css):
        parts = match.group(1).split()
        if len(parts) == 4 and parts[1] != parts[3]:
            sides.append(match.group())
    return sides


@pytest.mark.parametrize("name", ["style.css", "driving.css", "narrow.css"])
def test_styles_name_no_side_of_the_screen(name: str) -> None:
    assert sided((STATIC / name).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("css", "count"),
    [
        ("a { margin-left: 2px; }", 1),
        ("a { border-right-color: red; left: 0; }", 2),
        ("a { text-align: right; float: left; }", 2),
        ("a { padding: 1px 2px 3px 4px; }", 1),
        ("a { padding: 1px 2px 3px 2px; margin-inline-start: 1px; inset-inline-end: 0; text-align: start; }", 0),
        ("a { left: 50%; transform: translateX(-50%); border-top-left-radius: 2px; }", 0),
    ],
)
def test_what_names_a_side_is_found(css: str, count: int) -> None:
    assert len(sided(css)) == count
