"""Studies that differ from a study file in a few numbers, written out as study files of their own.

A changed study is its own text with its own hash, so that what an export says it ran under is what it ran under.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.errors import LabError
from app.simulated.presets import PRESET_NAMES
from app.simulated.traits import OFF, Population
from app.trial.world import parse_text
from study.definition.study import Study

FITTED_FILE = Path(__file__).with_name("fitted.json")
Changes = Mapping[str, Mapping[str, Any]]
"""Section of the study file ("" = before the first section) to its keys and their new values."""

_LAB: Changes = {
    "": {"layout": "arc"},
    "arbiter": {
        "rationality_per_m": 5.0,
        "step_m": 0.05,
        "planning_delay": 0.2,
        "transition": "mix",
        "stickiness": 0.003,
        "information": "next",
        "look_ahead_m": 0.20,
        "calibrated_on": "sampled",
        "keep_way_on": False,
    },
    "robot": {"speed_m_s": 0.04},
    "distractor": {"placement": "same_page_away"},
}
"""The study as it shipped first. Later presets differ from it; each says everything that it stands for, so that another
shipped study changes none of them."""


def _like(other: Changes, changes: Changes) -> Changes:
    return {section: {**values, **changes.get(section, {})} for section, values in other.items()}


FIRST_PEOPLE: Mapping[str, float] = {"pause": 3.057, "fine_pause": 1.05, "look": 0.03659, "checks": 3.926}
"""Means of version 0.1's participants, who neither learn nor tire, and misjudge no depth."""

_PRESETS: Mapping[str, Changes] = {
    "shipped": {},
    "lab": _LAB,
    # The paper's eq. 2 as printed, in metres, and no stickiness.
    "paper": _like(_LAB, {"arbiter": {"rationality_per_m": 1.0, "stickiness": 0.0}}),
    # The first fit to the paper's pure teleoperation: `salab fit --participants 24 --seed 1` of version 0.1.
    "fitted": _like(
        _LAB,
        {
            "arbiter": {
                "rationality_per_m": 6.31,
                "step_m": 0.03,
                "planning_delay": 0.8,
                "transition": "replan",
            },
            "robot": {"speed_m_s": 0.02687},
            "distractor": {"placement": "second_device"},
        },
    ),
}

_OF_SHIPPED: Mapping[str, Mapping[str, Any]] = {
    "ahead": {"information": "ahead", "look_ahead_m": 0.20},
    "at_rest": {"information": "at_rest", "look_ahead_m": 0.20},
    "averaged": {"information": "averaged", "look_ahead_m": 0.20},
    # A step back undoes one that was made, and it has to be made again: two steps of 0.03 m.
    "steady": {"stickiness": 0.06},
}
"""What of the arbiter differs from the study that ships: where information is looked at, or how dear a turn is."""


def changed_study(study: Study, changes: Changes, trust: bool = False) -> Study:
    """The study with those numbers or words in its file replaced. No change returns the study itself.

    Raises `StudyFileError` for a value the study file does not take.
    """
    text = study.source_text
    for section, values in changes.items():
        for key, value in values.items():
            text = _replaced(text, section, key, value)
    if text == study.source_text:
        return study
    return parse_text(text, "changed study", trust)


def preset_changes(name: str | None, *, layout: bool = True) -> Changes:
    """What a preset changes in a study file: nothing without one, or with `shipped`. `layout` = whether its layout is
    taken too: a file of one's own may have another number of objects. `LabError` names the presets."""
    if name is None:
        return {}
    if name in _OF_SHIPPED:
        changes = _like(_like(_LAB, fitted()["study"]), {"arbiter": _OF_SHIPPED[name]})
    elif name in _PRESETS:
        changes = _PRESETS[name]
    else:
        raise LabError(f"no preset {name!r}; presets are {', '.join(PRESET_NAMES)}")
    return {section: values for section, values in changes.items() if layout or section}


def fitted() -> dict[str, Any]:
    """What ships of the calibration: `participants` (means of traits), `study` (changes), and how they were found."""
    try:
        found: dict[str, Any] = json.loads(FITTED_FILE.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LabError(
            f"{FITTED_FILE.name}: cannot be read: {error}; run `salab fit`, or get it from the project"
        ) from None
    return found


def fitted_population() -> Population:
    """The population calibrated on pure teleoperation. What can be off is, unless the file states it."""
    return Population(means={**OFF, **fitted()["participants"]})


def population_of(preset: str | None) -> Population:
    """Who a preset's participants are: those of its time for the first ones, else those that ship."""
    if preset in ("lab", "paper", "fitted"):
        return Population(means={**OFF, **FIRST_PEOPLE})
    return fitted_population()


def _replaced(text: str, section: str, key: str, value: Any) -> str:
    """The text with `key = value` in that section: replaced, or put in as the section's first line."""
    written = json.dumps(value)
    lines = text.split("\n")
    here, header, end = "", None, len(lines)
    for number, line in enumerate(lines):
        if line == "[[code]]":
            end = number
            break  # the lab wrote what follows, and it may hold anything
        found = re.match(r"\s*\[+([^\]]+)\]+\s*(#.*)?$", line)
        if found:
            here = found.group(1).strip()
            header = number if here == section else header
        elif here == section and (match := re.match(rf"(\s*{re.escape(key)}\s*=\s*)([^#]*?)(\s*(?:#.*)?)$", line)):
            if _same(match.group(2), written):
                return text
            lines[number] = f"{match.group(1)}{written}{match.group(3)}"
            return "\n".join(lines)
    if header is None and section:
        return "\n".join([*lines[:end], "", f"[{section}]", f"{key} = {written}", "", *lines[end:]])
    position = 0 if header is None else header + 1
    return "\n".join([*lines[:position], f"{key} = {written}", *lines[position:]])


def _same(left: str, right: str) -> bool:
    try:
        return bool(json.loads(left) == json.loads(right))
    except ValueError:
        return left == right
