"""What a run leaves behind: `sessions.csv`, `sessions.json`, and the figure where it can be drawn."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from app.sizing.rule import Room, Step, Verdict, why_it_breaks
from study.extras import ANALYSIS, EXTRAS, has_extra, how_to_install

NAME = "sessions"


def write_steps(folder: Path, steps: Sequence[Step]) -> Path:
    """All steps so far as CSV. Raises `OSError`."""
    folder.mkdir(parents=True, exist_ok=True)
    path, out = folder / f"{NAME}.csv", io.StringIO()
    names = [field.name for field in fields(Step)]
    lines = csv.writer(out, lineterminator="\n")
    lines.writerow([*names, "late_share", "mb_per_session", "does_not_hold"])
    for step in steps:
        values = [_short(getattr(step, name)) for name in names]
        lines.writerow([*values, _short(step.late_share), _short(step.mb_per_session), why_it_breaks(step)])
    path.write_text(out.getvalue(), encoding="utf-8")
    return path


def _short(value: float) -> float:
    return round(value, 4) if isinstance(value, float) else value


def write_all(
    folder: Path, steps: Sequence[Step], verdict: Verdict, room: Room, about: Mapping[str, Any]
) -> tuple[Path, ...]:
    """Everything; `about` is what was measured, and where. Raises `OSError`."""
    written = [write_steps(folder, steps)]
    told = {**about, "room": asdict(room), "verdict": asdict(verdict), "steps": [asdict(step) for step in steps]}
    path = folder / f"{NAME}.json"
    path.write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    written.append(path)
    if steps and can_draw():
        from app.sizing.picture import draw

        draw(steps, verdict, room).write(folder, NAME)
        written.append(folder / f"{NAME}.png")
    return tuple(written)


def can_draw() -> bool:
    """Whether a figure can be drawn here."""
    return "matplotlib" in EXTRAS[ANALYSIS] and has_extra(ANALYSIS)


def no_figure() -> str:
    """What to say where none can; "" where one is."""
    return "" if can_draw() else f"no figure was drawn; for one: {how_to_install(ANALYSIS)}"
