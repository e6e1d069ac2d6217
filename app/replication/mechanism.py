"""`salab mechanism`: by what an arbiter that looks for information moves the arm, beside what comes of it.

Two measures, over the ticks in which such an arbiter moves the arm by itself (source `robot`) and more than one goal is
possible:

- *Share by place*: how much of what the arbiter sees differ between the 27 actions is about where they lead. Of a tick,
  with I(p, m) the expected information at place p with momentum m, and p_u, m_u the place and the momentum at which the
  arbiter looks for action u: the range over u of I(p_u, 0), the momentum held fixed at rest, by the range over u of
  I(p_u, m_u); at most 1. The mean over ticks. 1 means that the arm goes where information is; near 0, that it takes up
  a direction in which the person's next action would tell more, wherever that leads.
- *Reversals*: of the ticks at H > 0.3 in which the arm moved, and moved by itself in the tick before as well, the share
  in which it went against it: the two ways are more than a right angle apart.

Beside them the paper's measures: pickup ticks and belief gain, and how many of its thirteen differences have its sign.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from app.autonomy.arbiters.weighing import WeighingArbiter, WeightsOfInformation
from app.autonomy.looking import look
from app.errors import LabError
from app.replication.comparisons import compared, joint
from app.replication.paper import CONDITIONS_IN_ORDER, DIFFERENCES
from app.replication.studies import Values, measured, rotated, study_seed
from app.simulated.participant import Record, simulate_trials
from app.simulated.progress import progress
from app.simulated.study import Plan, check_count, run_jobs, setup_of
from app.trial.robots import make_robot
from app.trial.setup import StudySetup
from study.json_text import parse_json

UNSURE = 0.3
"""Reversals are counted above this entropy."""
EVERY = 5
"""Share by place is worked out for every so manyth tick: neighbours say the same."""
LEAST_WAY_M = 1e-6


@dataclass(frozen=True)
class Moves:
    """What an arm did by itself."""

    looked: int = 0
    share: float = 0.0
    """Sum over the ticks looked at."""
    moves: int = 0
    reversed: int = 0

    def __add__(self, other: Moves) -> Moves:
        return Moves(
            self.looked + other.looked,
            self.share + other.share,
            self.moves + other.moves,
            self.reversed + other.reversed,
        )


@dataclass(frozen=True)
class Mechanism:
    """One study file or preset."""

    name: str
    alpha: float
    information: str
    share_by_place: float
    reversals: float
    ticks: tuple[float, ...]
    """Mean pickup, in the order of `CONDITIONS_IN_ORDER`."""
    gains: tuple[float, ...]
    """Mean belief gain in pickups."""
    signs: float
    """How many of the paper's differences have its sign in a study, on average."""


def arbiter_of(setup: StudySetup) -> tuple[str, WeighingArbiter]:
    """The first condition that looks for information, and its arbiter. `LabError` when there is none."""
    for name in setup.arbiters:
        arbiter = setup.arbiter(name)
        if isinstance(arbiter, WeighingArbiter) and isinstance(arbiter.parameters, WeightsOfInformation):
            return name, arbiter
    raise LabError("this study has no condition with the balanced arbiter; what moves the arm cannot be told")


def share_by_place(
    position_m: np.ndarray[Any, Any],
    momentum: np.ndarray[Any, Any],
    goals_m: np.ndarray[Any, Any],
    belief: np.ndarray[Any, Any],
    arbiter: WeighingArbiter,
) -> float | None:
    """Of one state; None where all actions tell the same."""
    looking, models = arbiter.parameters.looking, arbiter.models
    state = position_m, momentum, goals_m, belief, models.transition, models.rationality_per_m
    whole = float(np.ptp(look(looking, *state)))
    if whole <= 0.0:
        return None
    if looking.place in ("at_rest", "averaged"):
        return 1.0
    return min(float(np.ptp(look(replace(looking, at_rest=True), *state))) / whole, 1.0)


def moves_of(record: Record, condition: str, arbiter: WeighingArbiter) -> Moves:
    """What the arm did by itself under that condition, in a participant's record."""
    ticks = [row for row in record["ticks"] if row.condition == condition]
    found = Moves()
    for number, row in enumerate(ticks):
        if row.source != "robot":
            continue
        if number % EVERY == 0:
            belief = np.array(list(parse_json(row.belief).values()))
            goals_m = np.array(list(parse_json(row.goals).values()))
            if len(belief) > 1:
                place, momentum = np.array((row.p_x, row.p_y, row.p_z)), np.array((row.m_x, row.m_y, row.m_z))
                share = share_by_place(place, momentum, goals_m, belief / belief.sum(), arbiter)
                found += Moves() if share is None else Moves(1, share)
        if number >= 1 and number + 1 < len(ticks) and row.entropy > UNSURE and ticks[number - 1].source == "robot":
            before, now = _way(ticks[number - 1], row), _way(row, ticks[number + 1])
            if math.hypot(*before) > LEAST_WAY_M and math.hypot(*now) > LEAST_WAY_M:
                against = sum(a * b for a, b in zip(before, now, strict=True)) < 0.0
                found += Moves(moves=1, reversed=int(against))
    return found


def _way(from_row: Any, to_row: Any) -> tuple[float, float, float]:
    """Where the arm went in a tick; nowhere across the end of a cycle."""
    if (from_row.cycle, from_row.attempt) != (to_row.cycle, to_row.attempt) or to_row.source in ("reset", "free"):
        return (0.0, 0.0, 0.0)
    return (to_row.p_x - from_row.p_x, to_row.p_y - from_row.p_y, to_row.p_z - from_row.p_z)


def mechanisms(
    plans: Sequence[tuple[str, Plan]], studies: int, participants: int, workers: int
) -> tuple[Mechanism, ...]:
    """One for each named plan, over so many studies of so many people."""
    check_count("studies", studies, 1000)
    check_count("participants", participants, 999)
    for name, plan in plans:
        setup = setup_of(plan.study_text, plan.trust)
        arbiter_of(setup)
        missing = sorted(set(CONDITIONS_IN_ORDER) - set(setup.arbiters))
        if missing:
            raise LabError(f"{name}: the paper's conditions are needed; {', '.join(missing)} is not there")
    jobs = [(number, study) for number in range(len(plans)) for study in range(studies)]
    done: dict[tuple[int, int], tuple[Values, Moves]] = {}
    with progress("studies", len(jobs), 0) as bar:
        for job, result in run_jobs(partial(_run, tuple(plan for _, plan in plans), participants), jobs, workers):
            done[job] = result
            bar.update()
    return tuple(
        _mechanism(name, plan, [done[number, study] for study in range(studies)])
        for number, (name, plan) in enumerate(plans)
    )


def _run(plans: tuple[Plan, ...], participants: int, job: tuple[int, int]) -> tuple[Values, Moves]:
    number, study = job
    plan = plans[number]
    own = replace(plan, seed=study_seed(plan.seed, study))
    condition, arbiter = arbiter_of(setup_of(plan.study_text, plan.trust))
    values, moves = [], Moves()
    for index in range(participants):
        case = rotated(own, study * participants, index)
        robot = partial(make_robot, own.robot)
        record = simulate_trials(case, robot)
        values.append(measured(case, record, robot))
        moves += moves_of(record, condition, arbiter)
    return values[0].joined(values[1:]), moves


def _mechanism(name: str, plan: Plan, found: Sequence[tuple[Values, Moves]]) -> Mechanism:
    _, arbiter = arbiter_of(setup_of(plan.study_text, plan.trust))
    moves = sum((of for _, of in found), Moves())
    values = [of for of, _ in found]
    parameters = arbiter.parameters
    return Mechanism(
        name=name,
        alpha=float(parameters.alpha),
        information=parameters.looking.place,
        share_by_place=moves.share / moves.looked if moves.looked else math.nan,
        reversals=moves.reversed / moves.moves if moves.moves else math.nan,
        ticks=_means(values, "efficiency_ticks"),
        gains=_means(values, "belief_gain"),
        signs=joint([compared(of, DIFFERENCES) for of in values]).mean_signs,
    )


def _means(values: Sequence[Values], measure: str) -> tuple[float, ...]:
    """Of pickups, by condition; NaN, which is written as nothing, where there are none."""
    observed = [one for of in values for one in of.observations[measure, "pickup"]]
    by_condition = [[one.value for one in observed if one.condition == name] for name in CONDITIONS_IN_ORDER]
    return tuple(float(np.mean(of)) if of else math.nan for of in by_condition)
