"""How many people at once a lab is to take: a small file in its data folder, written by `salab bench sessions`.

A number is used where it was measured: on this machine, with this robot. Any other is left alone, and the log says so.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from study.json_text import parse_json

NAME = "capacity.json"
MOST = 100_000
"""No lab takes more."""


@dataclass(frozen=True)
class Capacity:
    """What was measured. `sessions` is how many to take, a margin below `held`, the most that held."""

    sessions: int
    held: int
    robot: str
    scene: bool
    """Whether everybody had the 3-D view open."""
    measured_utc: str
    version: str
    """Of the lab that was measured."""
    machine: Mapping[str, str]


def write(folder: Path, capacity: Capacity) -> Path:
    """Put it into a data folder, in one piece or not at all. Raises `OSError`."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    path, draft = folder / NAME, folder / f"{NAME}.new"
    draft.write_text(json.dumps(asdict(capacity), indent=2) + "\n", encoding="utf-8")
    os.replace(draft, path)
    return path


def is_kept(folder: Path) -> bool:
    """Whether there is one, whoever may use it."""
    return os.path.lexists(folder / NAME)


def read(folder: Path, machine: Mapping[str, str], robot: str, has_scene: bool) -> tuple[Capacity | None, str]:
    """What holds for a lab, or None; and what to say of the file, "" where nothing is to be said.

    `robot` is which one moves there, `has_scene` whether its sessions have a 3-D view.
    """
    try:
        text = (folder / NAME).read_text(encoding="utf-8")
    except FileNotFoundError:
        return None, ""
    except (OSError, ValueError) as error:
        return None, f"{NAME} cannot be read ({type(error).__name__}); measure again with `salab bench sessions`"
    found = _parsed(text)
    if found is None:
        return None, f"{NAME} is not as `salab bench sessions` writes it; measure again"
    if other := [name for name, value in machine.items() if found.machine.get(name) != value]:
        return None, f"{NAME} was measured on another machine ({', '.join(other)}); measure on this one"
    if found.robot != robot:
        return None, f"{NAME} was measured with the robot {found.robot}, here {robot} moves; measure with that"
    if has_scene and not found.scene:
        return None, f"{NAME} was measured without 3-D views; measure with them"
    return found, ""


def _parsed(text: str) -> Capacity | None:
    try:
        given: Any = parse_json(text)
        found = Capacity(**given)
    except (ValueError, TypeError):
        return None
    numbers = (found.sessions, found.held)
    if not all(type(number) is int and 1 <= number <= MOST for number in numbers) or found.sessions > found.held:
        return None
    texts = (found.robot, found.measured_utc, found.version)
    is_sound = all(isinstance(one, str) for one in texts) and isinstance(found.scene, bool)
    return found if is_sound and isinstance(found.machine, dict) else None
