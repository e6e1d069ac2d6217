"""What the participant's page is told of how things look: nothing of what ships, all of a layout of one's own."""

from __future__ import annotations

from pathlib import Path

from app.trial.looks import looks_of
from app.trial.world import open_study

KITCHEN = Path(__file__).resolve().parents[2] / "docs" / "examples" / "05_layout" / "study.toml"


def test_the_page_knows_what_ships() -> None:
    assert looks_of(open_study(None)) == {}


def test_the_page_is_told_of_a_layout_of_ones_own() -> None:
    looks = looks_of(open_study(KITCHEN))
    assert looks["cereal"] == {
        "shape": "box",
        "size_m": [0.05, 0.064, 0.21],
        "color": "#e0a020",
        "drawing": "",
        "outline": "",
    }
    assert looks["recycling"] == {"shape": "bin", "color": "#1f7a4d", "letter": "R"}
    assert looks["detergent"]["drawing"] == "spray_bottle"
    strips = looks["mug"]["outline"].split("M")[1:]
    assert len(strips) > 60, "the handle's hole parts some rows in two"
