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
from app.simulated.traits import Population
from app.trial.world import parse_text
from study.definition.sections import ArbiterSettings
from study.definition.study import Study

FITTED_FILE = Path(__file__).with_name("fitted.json")
_PRESETS: Mapping[str, Mapping[str, float]] = {
    # The paper's eq. 2 as printed, in metres, and no stickiness.
    "paper": {"rationality_per_m": 1.0, "stickiness": 0.0},
    # What the study file says where nothing else is said.
    "lab": {name: getattr(ArbiterSettings(), name) for name in ("rationality_per_m", "stickiness")},
}

Changes = Mapping[str, Mapping[str, Any]]
"""Section of the study file ("" = before the first section) to its keys and their new values."""


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


def preset_changes(name: str | None) -> Changes:
    """What a preset changes in a study file: nothing without one, `paper` and `lab` the coefficients the paper leaves
    open, `fitted` what was calibrated on the paper's pure teleoperation. `LabError` names the presets."""
    if name is None:
        return {}
    if name == "fitted":
        return dict(fitted()["study"])
    if name not in PRESET_NAMES:
        raise LabError(f"no preset {name!r}; presets are {', '.join(PRESET_NAMES)}")
    return {"arbiter": _PRESETS[name]}


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


def _replaced(text: str, section: str, key: str, value: Any) -> str:
    """The text with `key = value` in that section: replaced, or put in as the section's first line."""
    written = json.dumps(value)
    lines = text.split("\n")
    here, header = "", None
    for number, line in enumerate(lines):
        if line == "[[code]]":
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
        return "\n".join([*lines, "", f"[{section}]", f"{key} = {written}", ""])
    position = 0 if header is None else header + 1
    return "\n".join([*lines[:position], f"{key} = {written}", *lines[position:]])


def _same(left: str, right: str) -> bool:
    try:
        return bool(json.loads(left) == json.loads(right))
    except ValueError:
        return left == right
