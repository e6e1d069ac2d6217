"""Inputs that once went wrong, one file each in `kept/`: what `make fuzz` finds it writes there, and `make test` tries
all of them again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).with_name("kept")


@dataclass(frozen=True)
class Kept:
    """An input of a surface, as JSON holds it; `why` is what went wrong with it first."""

    surface: str
    input: Any
    why: str = ""


def keep(case: Kept, folder: Path = FOLDER) -> Path:
    """Write a case; the same one again has the same name."""
    text = json.dumps(case.input, sort_keys=True)
    file = folder / f"{case.surface}-{hashlib.sha256(text.encode()).hexdigest()[:12]}.json"
    folder.mkdir(exist_ok=True)
    if not file.exists():
        whole = {"surface": case.surface, "why": case.why[:2_000], "input": case.input}
        file.write_text(json.dumps(whole, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return file


def kept(surface: str = "", folder: Path = FOLDER) -> Iterator[tuple[str, Kept]]:
    """Every case and the name of its file."""
    for file in sorted(folder.glob("*.json")):
        case = Kept(**json.loads(file.read_text(encoding="utf-8")))
        if surface in ("", case.surface):
            yield file.stem, case
