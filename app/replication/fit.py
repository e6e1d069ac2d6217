"""`salab fit`: calibrate the simulated participants, and what the paper leaves open about its robot, on what the paper
reports for *pure teleoperation* alone. Goal-oriented and balanced are never run here.

Nine anchors (means of efficiency, convergence and belief gain for pickups and for all tasks, the window rate, and the
standard deviations of efficiency) and eight numbers to find (`PARAMETERS`), on the logarithms, by damped least squares.
Every evaluation runs the same simulated people (common random numbers); a weak pull towards the starting values decides
what the anchors leave open. Standard deviations are anchors under pure teleoperation only, as everything here.

What is *not* found here, because pure teleoperation says nothing about it, is fixed beforehand and stands in
`VARIANTS`: the transition model with its delay and step. Each that is asked for is fitted by itself; the file holds the
best fit's numbers and how each was found.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from app.errors import LabError
from app.replication.paper import TELEOPERATION, reported
from app.replication.rule import hash_line, rule
from app.simulated.participant import simulate_trial
from app.simulated.progress import progress
from app.simulated.study import MAX_WORKERS, Plan, check_count, run_jobs
from app.simulated.traits import OFF, TRAITS, Population
from app.simulated.variants import Changes, changed_study
from app.trial.robots import make_robot
from app.trial.world import open_study
from study.analysis.measures import Measures, measure
from study.analysis.summaries import summarise

VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "replan": {"transition": "replan", "planning_delay": 0.8, "step_m": 0.03},
    "mix": {"transition": "mix", "planning_delay": 0.2, "step_m": 0.05},
}
"""`replan`: the authors' arm stopped and planned anew at each change of direction, so that one costs most of a tick.
`mix`: the model of the paper's formula with the lab's defaults."""

ALWAYS: Changes = {
    "": {"layout": "crescent"},
    "distractor": {"placement": "same_page_away"},
    "arbiter": {
        "stickiness": 0.003,
        "information": "next",
        "look_ahead_m": 0.2,
        "calibrated_on": "visited",
        "keep_way_on": True,
    },
}
"""What `rule.toml` fixes before the fit. One screen, whose pad is ignored while a reading waits, gives the windows that
a laptop two metres away gives; in the layout nobody gets lost; the arbiter's does nothing under pure teleoperation."""


@dataclass(frozen=True)
class Parameter:
    """One number to be found, where the search starts, and its bounds."""

    name: str
    start: float
    low: float
    high: float
    about: str


PARAMETERS: tuple[Parameter, ...] = (
    Parameter("speed_m_s", 0.033, 0.01, 0.08, "robot speed"),
    Parameter("rationality_per_m", 6.6, 0.5, 40.0, "rationality the belief assumes, per metre"),
    Parameter("pause", 1.6, 1.05, 3.9, TRAITS["pause"].about),
    Parameter("fine_pause", 1.8, 1.05, 3.9, TRAITS["fine_pause"].about),
    Parameter("look", 0.056, 0.005, 0.5, TRAITS["look"].about),
    Parameter("checks", 1.3, 0.1, 9.0, TRAITS["checks"].about),
    Parameter("second_try", 0.10, 0.01, 0.6, TRAITS["second_try"].about),
    Parameter("lift_m", 0.095, 0.005, 0.11, TRAITS["lift_m"].about),
)
"""Each starts near what a first fit found, of half as many people from the traits' own means."""
_STUDY = ("speed_m_s", "rationality_per_m")


@dataclass(frozen=True)
class Anchor:
    """One reported number, and what counts as one unit of missing it (a share of it)."""

    measure: str
    kind: str
    share: float
    statistic: Literal["mean", "sd"] = "mean"

    @property
    def value(self) -> float:
        """The paper's for pure teleoperation."""
        paper = reported(self.measure, self.kind)
        return (paper.means if self.statistic == "mean" else paper.sds)[TELEOPERATION]

    @property
    def label(self) -> str:
        """As it is printed."""
        return f"{'SD of ' if self.statistic == 'sd' else ''}{self.measure} ({self.kind})"


ANCHORS: tuple[Anchor, ...] = (
    Anchor("efficiency_ticks", "pickup", 0.03),
    Anchor("efficiency_ticks", "all", 0.03),
    Anchor("convergence_user_actions", "pickup", 0.06),
    Anchor("convergence_user_actions", "all", 0.06),
    Anchor("belief_gain", "pickup", 0.10),
    Anchor("belief_gain", "all", 0.17),
    Anchor("window_rate", "all", 0.05),
    Anchor("efficiency_ticks", "pickup", 0.08, "sd"),
    Anchor("efficiency_ticks", "all", 0.08, "sd"),
)
"""Shares: about the rounding of the reported number, or a third of the standard error of the mean of 36 or 72 tasks;
of a standard deviation, two thirds of its standard error."""

PULL = 0.25
"""Weight of one unit of logarithm away from the start, in units of anchors."""
_STEP = 0.2
_DAMPING = (0.1, 1.0, 10.0)


@dataclass(frozen=True)
class Fit:
    """The best found for one variant: numbers by name, what they give, and the misfit (sum of squares; 0 = exact)."""

    variant: str
    values: Mapping[str, float]
    anchors: tuple[tuple[Anchor, float], ...]
    misfit: float
    evaluations: int
    windows: int
    uncertain_windows: int


def study_changes(variant: str, values: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """What of a fit goes into the study file."""
    changes = {section: dict(of) for section, of in ALWAYS.items()}
    changes["arbiter"] |= {**VARIANTS[variant], "rationality_per_m": values["rationality_per_m"]}
    changes["robot"] = {"speed_m_s": values["speed_m_s"]}
    return changes


def means_of(values: Mapping[str, float]) -> dict[str, float]:
    """What of a fit goes into the population."""
    return {name: value for name, value in values.items() if name not in _STUDY}


def teleoperate(plan: Plan, index: int) -> tuple[list[Any], list[Any]]:
    """Task and tick rows of one participant's trial under pure teleoperation; its place in the order varies."""
    case = plan.case(index)
    trial = case.order.index(TELEOPERATION) + 1
    record = simulate_trial(case, trial, partial(make_robot, plan.robot))
    return record["tasks"], record["ticks"]


def measure_teleoperation(plan: Plan, participants: int) -> Measures:
    """The paper's measures of so many participants under pure teleoperation."""
    found = [teleoperate(plan, index) for index in range(participants)]
    return measure([row for tasks, _ in found for row in tasks], [row for _, ticks in found for row in ticks])


def plan_of(variant: str, values: Mapping[str, float], seed: int) -> Plan:
    """The simulation that a set of numbers stands for. Nothing calibrates an alpha: under pure teleoperation no arbiter
    moves, and it would take longer than the driving."""
    study = changed_study(open_study(None), study_changes(variant, values))
    text = study.source_text.replace('alpha = "calibrated"', "alpha = 1.0")
    return Plan(text, seed, population=Population(means_of(values)))


def fit(
    variant: str,
    participants: int,
    seed: int,
    workers: int = 1,
    rounds: int = 5,
    say: Callable[[], object] = lambda: None,
) -> Fit:
    """Find the numbers of one variant. `say` is called after every evaluation. Raises `LabError` out of bounds."""
    if variant not in VARIANTS:
        raise LabError(f"no variant {variant!r}; variants are {', '.join(VARIANTS)}")
    check_count("participants", participants, 1000)
    check_count("workers", workers, MAX_WORKERS)
    check_count("rounds", rounds, 100)
    start = np.log([item.start for item in PARAMETERS])
    low, high = np.log([item.low for item in PARAMETERS]), np.log([item.high for item in PARAMETERS])
    found: list[Fit] = []
    try_out = partial(_evaluate, variant, participants, seed)

    def residuals(points: list[np.ndarray]) -> list[np.ndarray]:
        """How far off each point is, in order; the points are independent, so they run beside one another."""
        jobs = [tuple(float(value) for value in point) for point in points]
        results = {}
        for job, result in run_jobs(try_out, jobs, workers):
            results[job] = result
            say()
        found.extend(results[job] for job in jobs)
        return [_off(results[job], np.array(job) - start) for job in jobs]

    here = start
    (off,) = residuals([here])
    for _ in range(rounds):
        steps = np.where(here + _STEP <= high, _STEP, -_STEP)
        beside = residuals([here + step for step in np.diag(steps)])
        slopes = np.stack([(there - off) / step for there, step in zip(beside, steps, strict=True)], axis=1)
        before = float(off @ off)
        for damping in _DAMPING:
            pull = slopes.T @ slopes
            move = np.linalg.solve(pull + damping * np.diag(np.diag(pull) + 1e-6), -slopes.T @ off)
            there = np.clip(here + np.clip(move, -0.7, 0.7), low, high)
            (tried,) = residuals([there])
            if float(tried @ tried) < float(off @ off):
                here, off = there, tried
                break
        if float(off @ off) > 0.97 * before:
            break  # what is left is the luck of the draw
    best = min(found, key=lambda item: item.misfit)
    return replace(best, evaluations=len(found))


def _evaluate(variant: str, participants: int, seed: int, logs: tuple[float, ...]) -> Fit:
    """What one set of numbers gives."""
    values = {  # the logarithm of a bound does not lead back to the bound
        item.name: min(max(float(np.exp(log)), item.low), item.high) for item, log in zip(PARAMETERS, logs, strict=True)
    }
    measures = measure_teleoperation(plan_of(variant, values, seed), participants)
    result = Fit(
        variant=variant,
        values=values,
        anchors=anchor_values(measures),
        misfit=0.0,
        evaluations=1,
        windows=len(measures.analysed_windows()),
        uncertain_windows=len(measures.gains()),
    )
    moved = np.array(logs) - np.log([item.start for item in PARAMETERS])
    off = _off(result, moved)
    return replace(result, misfit=float(off @ off))


def _off(result: Fit, moved: np.ndarray) -> np.ndarray:
    """Every anchor's miss, and the pull towards the start."""
    misses = [(value / anchor.value - 1.0) / anchor.share for anchor, value in result.anchors]
    return np.concatenate([misses, PULL * moved])


def anchor_values(measures: Measures) -> tuple[tuple[Anchor, float], ...]:
    """Ours for every anchor; a mean of nothing counts as 0."""
    tables = summarise(measures)[TELEOPERATION]["tasks"]
    return tuple((anchor, tables[anchor.kind][anchor.measure][anchor.statistic] or 0.0) for anchor in ANCHORS)


def report(item: Fit) -> str:
    """One fit as plain text."""
    lines = [f"{item.variant}: misfit {item.misfit:.1f} after {item.evaluations} evaluations"]
    lines += [f"  {name:<18} {value:.4g}" for name, value in item.values.items()]
    lines.append(f"  {'anchor':<36} {'paper':>8} {'ours':>8} {'off':>6}")
    for anchor, value in item.anchors:
        off = value / anchor.value - 1.0
        missed = "  MISSED" if abs(off) > rule().anchor_tolerance else ""
        lines.append(f"  {anchor.label:<36} {anchor.value:>8.4g} {value:>8.4g} {off:>+6.0%}{missed}")
    at_bound = [of.name for of in PARAMETERS if not of.low * 1.001 < item.values[of.name] < of.high * 0.999]
    if at_bound:
        lines.append(f"  stands at a bound: {', '.join(at_bound)}")
    lines.append(f"  windows with entropy above 0.7 (not fitted): {item.uncertain_windows} of {item.windows}")
    return "\n".join(lines)


def assumed() -> dict[str, float]:
    """Means of the traits that can be off and are not fitted: a population's file states them, or they are off."""
    found = {parameter.name for parameter in PARAMETERS}
    return {name: TRAITS[name].mean for name in OFF if name not in found}


def as_json(fits: list[Fit], participants: int, seed: int) -> str:
    """The file that ships: the best fit's numbers, and how they were found."""
    best = min(fits, key=lambda item: item.misfit)
    numbers = {name: float(f"{value:.4g}") for name, value in best.values.items()}
    only = f" --transition {best.variant}" if len(fits) == 1 else ""
    data = {
        "participants": {**assumed(), **means_of(numbers)},
        "study": study_changes(best.variant, numbers),
        "found": {
            "by": f"salab fit{only} --participants {participants} --seed {seed}",
            "on": "what the paper reports for pure teleoperation, nothing else",
            "rule": rule().sha256,
            "variants": {
                item.variant: {
                    "misfit": round(item.misfit, 2),
                    "values": {name: float(f"{value:.4g}") for name, value in item.values.items()},
                    "anchors": [
                        {
                            "measure": anchor.measure,
                            "kind": anchor.kind,
                            "statistic": anchor.statistic,
                            "paper": anchor.value,
                            "ours": round(value, 5),
                        }
                        for anchor, value in item.anchors
                    ],
                    "windows": item.windows,
                    "windows_above_entropy": item.uncertain_windows,
                }
                for item in fits
            },
        },
    }
    return json.dumps(data, indent=2) + "\n"


def run(variants: tuple[str, ...], participants: int, seed: int, workers: int, out: Path | None) -> str:
    """Fit each variant, write the file, return the report."""
    if out is not None and not out.absolute().parent.is_dir():
        raise LabError(f"{out}: there is no folder {out.parent}; make it first")
    fits = []
    for variant in variants:
        with progress(f"evaluations of {variant}", 1 + 5 * (len(PARAMETERS) + len(_DAMPING))) as bar:
            fits.append(fit(variant, participants, seed, workers, say=bar.update))
    if out is not None:
        out.write_text(as_json(fits, participants, seed), encoding="utf-8")
    return "\n\n".join([hash_line(), *(report(item) for item in fits)])
