"""The comparison as files: report, figure, tables for a spreadsheet, everything as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from app.errors import LabError
from app.physics_comparison.comparing import Compared
from app.physics_comparison.equivalence import Difference, Equivalence
from app.physics_comparison.figure import draw
from app.physics_comparison.open_loop import Followed
from app.physics_comparison.rule import rule
from app.physics_comparison.text import made_of, report
from app.physics_comparison.words import blocked_rates, reasons, verdicts
from app.replication.formats import write_csv
from study.store import machine_fingerprint

REPORT = "comparison.md"
_INTERVAL: Mapping[str, str] = {
    "people": "people with values on both robots",
    "difference": "mean over people: the other robot less the first",
    "low_95": "95 % interval of it",
    "high_95": "95 % interval of it",
    "low_90": "90 % interval of it, as two one-sided tests at .05 ask",
    "high_90": "90 % interval of it",
}
_OF: Mapping[str, str] = {
    "first": "the robot that the other is held against",
    "robot": "the other robot",
    "measure": "what is compared",
    "kind": "of which tasks",
}
TABLES: Mapping[str, Mapping[str, str]] = {
    "paths.csv": {
        "first": "the robot that the other is held against",
        "robot": "the other robot",
        "participant": "whose inputs they were",
        "condition": "condition",
        "trial": "number of the trial",
        "cycle": "number of the pick-and-place",
        "attempt": "number of the attempt at it",
        "ticks": "ticks with the same commands on both",
        "ended": "contact, gripper (a button), choice (of the arbiter), refusal (of a motion), recording (its end)",
        "choices": "ticks in which the arbiter chose by itself",
        "same_choices": "of these, those in which it chose the same",
        "why": "why it chose otherwise at the end: not allowed, tipped, unknown; blank = it did not",
        "median_mm": "median distance between the grippers",
        "p99_mm": "at 99 %",
        "most_mm": "at most",
        "most_deg": "largest angle between the grippers",
    },
    "levels.csv": {
        **_OF,
        "condition": "condition; every condition = all of a person's values",
        "first_mean": "mean over people's means on the first robot",
        "first_sd": "standard deviation between people's means",
        "robot_mean": "on the other robot",
        "robot_sd": "on the other robot",
        **_INTERVAL,
    },
    "effects.csv": {
        **_OF,
        "condition": "condition",
        "less": "condition that is taken off it",
        "first_effect": "that difference on the first robot",
        "robot_effect": "on the other robot",
        **_INTERVAL,
    },
    "verdicts.csv": {
        **_OF,
        "bound": "a difference smaller than this changes nothing, by the rule; blank = none",
        "verdict": "interchangeable, effects carry over, differs, not shown, no bound",
        "people_needed": "people with whom it would be shown to be within; blank = more would not help, or not known",
    },
    "blocked.csv": {
        "reason": "why the arm did not move, as in the record",
        "robot": "robot",
        "per_thousand": "of a thousand control ticks",
    },
}
"""Every table and its columns, which `columns.csv` lists."""


def write(compared: Compared, folder: Path) -> Path:
    """Everything into the folder; the report's place. Raises `LabError` when it cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, columns in TABLES.items():
            write_csv(folder / name, list(columns), [list(map(_cell, row)) for row in _ROWS[name](compared)])
        told = [(name, column, about) for name, columns in TABLES.items() for column, about in columns.items()]
        write_csv(folder / "columns.csv", ("file", "column", "meaning"), told)
        (folder / "comparison.json").write_text(json.dumps(_everything(compared), indent=1), encoding="utf-8")
        (folder / REPORT).write_text(report(compared), encoding="utf-8")
        draw(compared).write(folder)
    except OSError as error:
        raise LabError(f"{folder}: cannot be written: {error.strerror or error}") from None
    return folder / REPORT


def _paths(compared: Compared) -> Iterator[tuple[Any, ...]]:
    for one in compared.followed:
        yield (compared.first, one.robot, *_attempt(one))


def _attempt(one: Followed) -> tuple[Any, ...]:
    apart = np.quantile(one.apart_mm, (0.5, 0.99, 1.0)).tolist() if one.apart_mm else [math.nan] * 3
    return (
        *(one.participant, one.condition, one.trial, one.cycle, one.attempt, one.ticks, one.ended),
        *(one.choices, one.same_choices, one.why or "", *apart, max(one.turned_deg, default=math.nan)),
    )


def _of(compared: Compared, one: Equivalence) -> tuple[str, ...]:
    return compared.first, one.robot, one.measure, one.kind


def _interval(of: Difference) -> tuple[Any, ...]:
    ends = (of.mean + side * of.reach(confidence) for confidence in (0.95, 0.9) for side in (-1.0, 1.0))
    return (of.people, of.mean, *ends)


def _levels(compared: Compared) -> Iterator[tuple[Any, ...]]:
    for one in compared.equivalences:
        for level in one.levels:
            yield (*_of(compared, one), level.condition, *level.first, *level.other, *_interval(level.difference))


def _effects(compared: Compared) -> Iterator[tuple[Any, ...]]:
    for one in compared.equivalences:
        for effect in one.effects:
            values = (effect.first, effect.other, *_interval(effect.difference))
            yield (*_of(compared, one), *effect.conditions, *values)


def _verdicts(compared: Compared) -> Iterator[tuple[Any, ...]]:
    for one in compared.equivalences:
        yield (*_of(compared, one), one.bound, one.verdict, one.people_needed)


def _blocked(compared: Compared) -> Iterator[tuple[Any, ...]]:
    for why, of in blocked_rates(compared).items():
        for robot, rate in of.items():
            yield (why, robot, rate)


_ROWS = {
    "paths.csv": _paths,
    "levels.csv": _levels,
    "effects.csv": _effects,
    "verdicts.csv": _verdicts,
    "blocked.csv": _blocked,
}


def _cell(value: Any) -> Any:
    """Numbers that are none are blank."""
    return "" if isinstance(value, float) and not math.isfinite(value) else value


def _everything(compared: Compared) -> Any:
    people = compared.asked.people
    return _plain(
        {
            "made_of": made_of(compared),
            "robots": compared.asked.robots,
            "machine": machine_fingerprint(),
            "studies": people.studies,
            "participants": people.participants,
            "plan": people.plan.settings(),
            "rule": asdict(rule()),
            "paths": [asdict(one) for one in compared.paths],
            "equivalences": [asdict(one) for one in compared.equivalences],
            "blocked_per_thousand": blocked_rates(compared),
            "counts": {robot: values.counts for robot, values in compared.values.items()},
            "reasons": reasons(compared),
            "verdicts": verdicts(compared),
        }
    )


def _plain(value: Any) -> Any:
    """As JSON has it: what is no number is null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(of) for key, of in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(of) for of in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
