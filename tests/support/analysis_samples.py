"""Data sets with known measures, for the tests of the analysis.

`script` writes one task tick by tick from a line of letters. `data_set` makes a whole study whose every task has the
number of ticks, user actions, windows and belief gains it was asked for.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from study.definition.builtin_questionnaires import INSTRUMENTS
from study.export.export import write_tables
from study.flow.roster import EnrolmentKind
from study.records import CONDITIONS, ParticipantRow, SurveyAnswerRow, TaskRow, TickRow, TrialRow
from study.store import Batch, Store
from tests.support.study_samples import BINS, OBJECTS, UTC, shipped_study, task_row, tick_row

SOURCES = {"u": "user", "b": "blend", "r": "robot", "i": "idle", "g": "gripper", "x": "reset", "P": "idle", "U": "user"}
"""One letter a tick; P and U are idle and user ticks that are the first after a pause."""


def belief_of(goal: str, probability: float, others: Sequence[str]) -> dict[str, float]:
    """`goal` at that probability, the rest shared equally."""
    return {goal: probability, **{other: (1.0 - probability) / len(others) for other in others}}


def script(
    letters: str,
    own: Sequence[float | None],
    *,
    goal: str = "spray_bottle",
    others: Sequence[str] = ("bleach_bottle", "paper_towels"),
    entropy: float = 0.9,
    first_tick: int = 0,
    **changes: Any,
) -> list[TickRow]:
    """A task's ticks: `own` is b(goal) after each tick; None = the goal is not a candidate."""
    rows = []
    for index, (letter, probability) in enumerate(zip(letters, own, strict=True)):
        belief = belief_of(goal, probability, others) if probability is not None else dict.fromkeys(BINS, 0.5)
        rows.append(
            tick_row(
                "P001",
                first_tick + index,
                goal=goal,
                source=SOURCES[letter],
                belief=json.dumps(belief),
                entropy=entropy,
                after_pause=int(letter in "PU"),
                **changes,
            )
        )
    return rows


def scripted_task(rows: Sequence[TickRow], **changes: Any) -> TaskRow:
    """The task those ticks belong to."""
    return task_row("P001", first_tick=rows[0].tick, last_tick=rows[-1].tick, **changes)


# ---- a whole study --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Wanted:
    """What one task shall measure."""

    ticks: int
    converges_at: int | None
    gains: tuple[float, ...] = ()


Script = Callable[[str, str, str, np.random.Generator], Wanted]
"""(participant, condition, kind, rng) -> what the task shall measure."""

MEANS = {
    "teleoperation": (60, 20, 0.005),
    "goal_oriented": (40, 10, 0.008),
    "balanced": (50, 8, 0.020),
}


def plausible(participant: str, condition: str, kind: str, rng: np.random.Generator) -> Wanted:
    """Differences between conditions as the paper found them, in fewer ticks, people and tasks varying."""
    ticks, converges_at, gain = MEANS[condition]
    person = 4.0 * (sum(map(ord, participant)) % 5 - 2)
    return Wanted(
        ticks=max(32, round(ticks + person + rng.normal(0, 5))),
        converges_at=max(1, round(converges_at + rng.normal(0, 3))) if rng.random() > 0.05 else None,
        gains=tuple(gain + rng.normal(0, 0.003) for _ in range(2)),
    )


@dataclass
class DataSet:
    """Rows of every table, to be changed by a test and written."""

    tables: dict[str, list[Any]] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """As `salab export` would."""
        study = shipped_study()
        write_tables(folder, self.tables, studies={study.hash: study.source_text}, meta={"machines": []})
        return folder


def data_set(
    participants: int = 6,
    *,
    seed: int = 1,
    wanted: Script = plausible,
    conditions: Sequence[str] = CONDITIONS,
    surveys: bool = True,
    kind: str = "study",
) -> DataSet:
    """A complete study. Every trial has three pickups and dropoffs; the orders go round all permutations."""
    rng = np.random.default_rng(seed)
    data = DataSet({name: [] for name in ("participants", "trials", "tasks", "ticks", "survey_answers")})
    orders = list(itertools.permutations(conditions))
    for number in range(participants):
        name, order = f"{kind[0].upper()}{number + 1:03d}", orders[number % len(orders)]
        data.tables["participants"].append(
            ParticipantRow(
                name, number, ">".join(order), "done", shipped_study().hash, UTC, UTC, "c" * 64, UTC, 1, kind
            )
        )
        for trial, condition in enumerate(order, 1):
            _add_trial(data, name, trial, condition, wanted, rng)
            if surveys:
                _add_surveys(data, name, trial, condition, rng)
    return data


def _add_trial(data: DataSet, name: str, trial: int, condition: str, wanted: Script, rng: np.random.Generator) -> None:
    tick = 0
    objects = list(rng.permutation(OBJECTS))
    for task in range(1, 7):
        kind = "pickup" if task % 2 else "dropoff"
        thing = str(objects[task // 2 if task % 2 else task // 2 - 1])
        goal = thing if kind == "pickup" else str(rng.choice(BINS))
        candidates = [str(item) for item in objects[(task - 1) // 2 :]] if kind == "pickup" else list(BINS)
        rows = _task_ticks(
            wanted(name, condition, kind, rng),
            "idle" if condition == "teleoperation" else "robot",
            {"participant": name, "condition": condition, "trial": trial, "task": task, "kind": kind, "goal": goal},
            [item for item in candidates if item != goal],
            tick,
        )
        data.tables["ticks"] += rows
        data.tables["tasks"].append(
            TaskRow(
                name, condition, trial, task, kind, goal, thing, len(candidates), "success", None,
                rows[0].tick, rows[-1].tick,
            )
        )  # fmt: skip
        tick = rows[-1].tick + 1
        if kind == "dropoff":
            data.tables["ticks"].append(
                tick_row(name, tick, condition=condition, trial=trial, task=None, kind=None, goal=None, source="reset")
            )
            tick += 1
    parameters = {"condition": condition, "alpha": 250.0 if condition == "balanced" else 0.0, "beta": 1.0}
    parameters |= {"rationality_per_m": 5.0, "transition": {"kind": "mix", "step_m": 0.05, "planning_delay": 0.2}}
    data.tables["trials"].append(
        TrialRow(name, condition, trial, "arc", "[]", json.dumps(parameters), "completed", tick, 0, UTC, UTC)
    )


def _task_ticks(
    wanted: Wanted, off: str, place: Mapping[str, Any], others: Sequence[str], first_tick: int
) -> list[TickRow]:
    """Gripper, then windows of 5 ticks each followed by a user action with its gain, then user actions to the end."""
    goal, even = str(place["goal"]), 1.0 / (len(others) + 1)
    sources, own, entropies = ["gripper"], [even], [1.0]
    current, observed = even, 0
    for gain in wanted.gains:
        sources += [off] * 5
        own += [current] * 5
        entropies += [0.9] * 5
        # The gain itself must not make the goal the most likely one before its time.
        current += gain
        observed += 1
        sources.append("user")
        own.append(current)
        entropies.append(0.9)
    remaining = wanted.ticks - (len(sources) - 1)
    for _ in range(remaining):
        observed += 1
        converged = wanted.converges_at is not None and observed >= wanted.converges_at
        sources.append("user")
        own.append(0.9 if converged else 0.0)
        entropies.append(0.5)
    return [
        tick_row(
            place["participant"],
            first_tick + index,
            **{key: value for key, value in place.items() if key != "participant"},
            source=source,
            belief=json.dumps(belief_of(goal, probability, others)),
            entropy=entropy,
        )
        for index, (source, probability, entropy) in enumerate(zip(sources, own, entropies, strict=True))
    ]


def _add_surveys(data: DataSet, name: str, trial: int, condition: str, rng: np.random.Generator) -> None:
    mean = {"sus_modified": {"balanced": 3.2}, "tlx_raw": {"balanced": 5.2}}
    for instrument_id, by_condition in mean.items():
        for item in INSTRUMENTS[instrument_id].items:
            point = int(np.clip(round(by_condition.get(condition, 4.2) + rng.normal(0, 0.8)), 1, 7))
            value = 8 - point if item.reversed else point
            data.tables["survey_answers"].append(
                SurveyAnswerRow(name, condition, trial, instrument_id, item.id, str(value), UTC)
            )


def store_study(store: Store, data: DataSet, kind: EnrolmentKind = "study") -> list[str]:
    """The same participants as if they had taken part in a lab; their ids there."""
    names: dict[str, str] = {}
    for row in data.tables["participants"]:
        order = row.condition_order.split(">")
        made = store.create_participant(
            shipped_study(), seed=row.seed, public_id=f"{kind}{row.participant}", utc=UTC, order=order, kind=kind
        )
        names[row.participant] = made.participant
    rows: dict[str, Any] = {
        {"survey_answers": "answers"}.get(name, name): [
            replace(row, participant=names[row.participant]) for row in table
        ]
        for name, table in data.tables.items()
        if name != "participants"
    }
    store.commit(Batch(**rows))
    return list(names.values())
