"""Studies that differ from a study file in a few numbers, written out as study files of their own.

A changed study is its own text with its own hash, so that what an export says it ran under is what it ran under.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.autonomy.arbiter import PRESETS
from app.config import LabError
from app.simulated.presets import PRESET_NAMES
from app.simulated.traits import Population
from sim.layouts import LAYOUTS
from sim.objects import STUDY_OBJECTS
from study.definition.study import Study, load_study, parse_study

FITTED_FILE = Path(__file__).with_name("fitted.json")

Changes = Mapping[str, Mapping[str, Any]]
"""Section of the study file ("" = before the first section) to its keys and their new values."""


def known_layouts() -> dict[str, int]:
    """The layouts there are and their numbers of slots."""
    return {name: len(layout.slots) for name, layout in LAYOUTS.items()}


def open_study(path: Path | None) -> Study:
    """The study file, or the paper's study, checked against this lab's world."""
    return load_study(path, layouts=known_layouts(), objects=tuple(STUDY_OBJECTS), bins=_bins())


def changed_study(study: Study, changes: Changes) -> Study:
    """The study with those numbers or words in its file replaced. No change returns the study itself.

    Raises `StudyFileError` for a value the study file does not take.
    """
    text = study.source_text
    for section, values in changes.items():
        for key, value in values.items():
            text = _replaced(text, section, key, value)
    if text == study.source_text:
        return study
    return parse_text(text, "changed study")


def parse_text(text: str, name: str) -> Study:
    """The study of a file's text; `name` is what errors call it. Raises `StudyFileError`."""
    return parse_study(text, name=name, layouts=known_layouts(), objects=tuple(STUDY_OBJECTS), bins=_bins())


def preset_changes(name: str | None) -> Changes:
    """What a preset changes in a study file: nothing without one, `paper` and `lab` the coefficients the paper leaves
    open, `fitted` what was calibrated on the paper's pure teleoperation. `LabError` names the presets."""
    if name is None:
        return {}
    if name == "fitted":
        return dict(fitted()["study"])
    if name not in PRESET_NAMES:
        raise LabError(f"no preset {name!r}; presets are {', '.join(PRESET_NAMES)}")
    preset = PRESETS["paper" if name == "paper" else "lab"]
    return {"arbiter": {"rationality_per_m": preset.rationality_per_m, "stickiness": preset.stickiness}}


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
    """The population calibrated on pure teleoperation; all presets use it."""
    return Population(means=dict(fitted()["participants"]))


def _bins() -> tuple[str, ...]:
    return tuple(item.id for item in next(iter(LAYOUTS.values())).bins)


def _replaced(text: str, section: str, key: str, value: Any) -> str:
    """The text with `key = value` in that section: replaced, or put in as the section's first line."""
    written = json.dumps(value)
    lines = text.split("\n")
    here, header = "", None
    for number, line in enumerate(lines):
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
        return "\n".join([*lines, "", f"[{section}]", f"{key} = {written}", ""])
    position = 0 if header is None else header + 1
    return "\n".join([*lines[:position], f"{key} = {written}", *lines[position:]])


def _same(left: str, right: str) -> bool:
    try:
        return bool(json.loads(left) == json.loads(right))
    except ValueError:
        return left == right
