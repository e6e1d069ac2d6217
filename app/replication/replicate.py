"""`salab replicate`: many simulated studies with the fitted numbers, each analysed as the paper analysed its own, and a
report that puts the paper's numbers beside ours and says what moves them.

Left in the folder: `replication.md` (the report), `comparisons.csv`, `means.csv`, `varied.csv`, and the studies' values
in `studies/` and `varied/`, from which an interrupted run goes on and which `salab power` reads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.errors import LabError
from app.replication.comparisons import GoalGain, Joint, Means, Share, compared, goal_gains, joint, means, shares
from app.replication.long_tasks import Lengths, summed_up
from app.replication.paper import Claim
from app.replication.studies import MAX_STUDIES, Values, run_studies
from app.simulated.study import MAX_WORKERS, Plan, check_count, run_jobs, setup_of
from app.simulated.traits import TRAITS, Population
from app.simulated.variants import Changes, changed_study
from app.trial.setup import StudySetup
from app.trial.world import parse_text


@dataclass(frozen=True)
class Variation:
    """One thing changed from the fitted simulation: the study file, the people, or alpha times a factor."""

    name: str
    about: str
    study: Changes
    means: Mapping[str, float]
    spread_scale: float = 1.0
    alpha_factor: float | None = None


def variations(plan: Plan) -> tuple[Variation, ...]:
    """One thing at a time, around the plan's own numbers."""
    arbiter, robot = setup_of(plan.study_text).study.arbiter, setup_of(plan.study_text).study.robot
    mean = plan.population.mean

    def study(name: str, about: str, section: str, key: str, value: Any) -> Variation:
        return Variation(name, about, {section: {key: value}}, {})

    def people(name: str, about: str, **means_: float) -> Variation:
        return Variation(name, about, {}, means_)

    def bounded(trait: str, value: float) -> float:
        return min(max(value, TRAITS[trait].low), TRAITS[trait].high)

    other = "mix" if arbiter.transition == "replan" else "replan"
    return (
        study("step / 2", "model step halved", "arbiter", "step_m", arbiter.step_m / 2.0),
        study("step x 2", "model step doubled", "arbiter", "step_m", arbiter.step_m * 2.0),
        study("rationality / 2", "", "arbiter", "rationality_per_m", arbiter.rationality_per_m / 2.0),
        study("rationality x 2", "", "arbiter", "rationality_per_m", arbiter.rationality_per_m * 2.0),
        study("delay - 0.3", "planning delay", "arbiter", "planning_delay", max(arbiter.planning_delay - 0.3, 0.0)),
        study("delay + 0.15", "planning delay", "arbiter", "planning_delay", min(arbiter.planning_delay + 0.15, 0.95)),
        study(f"transition {other}", "the other transition model", "arbiter", "transition", other),
        study("stickiness 0", "nothing against dithering", "arbiter", "stickiness", 0.0),
        Variation("alpha / 3", "information counts a third", {}, {}, alpha_factor=1.0 / 3.0),
        Variation("alpha x 3", "information counts three times", {}, {}, alpha_factor=3.0),
        study("layout rows", "the other layout", "", "layout", "rows"),
        study("speed x 1.5", "robot speed", "robot", "speed_m_s", min(robot.speed_m_s * 1.5, 0.1)),
        people("away 3.5 s", "shorter readings", away_s=3.5),
        people("away 9 s", "longer readings", away_s=9.0),
        study("one screen", "readings on the same page", "distractor", "placement", "same_page_away"),
        people(
            "steady people",
            "no slips, no overshoot, half the eye error",
            slip=0.0,
            overshoot=0.0,
            eye_error=mean("eye_error") / 2.0,
        ),
        people(
            "clumsy people",
            "twice the slips, overshoot and eye error",
            slip=bounded("slip", 2.0 * mean("slip")),
            overshoot=bounded("overshoot", 2.0 * mean("overshoot")),
            eye_error=bounded("eye_error", 2.0 * mean("eye_error")),
        ),
        people("one axis", "never two axes at once", two_axes=0.0),
        people("two axes", "mostly two axes at once", two_axes=0.7),
        Variation("equal people", "no differences between people", {}, {}, spread_scale=0.0),
    )


def varied(plan: Plan, variation: Variation) -> Plan:
    """The plan with that one thing changed."""
    study = changed_study(parse_text(plan.study_text, "the study simulated"), variation.study)
    text = study.source_text
    if variation.alpha_factor is not None:
        alpha = calibrated_alpha(setup_of(text))
        text = text.replace('alpha = "calibrated"', f"alpha = {alpha * variation.alpha_factor:.6g}")
    scale = plan.population.spread_scale * variation.spread_scale
    people = Population({**plan.population.means, **variation.means}, scale)
    return replace(plan, study_text=text, population=people)


def calibrated_alpha(setup: StudySetup) -> float:
    """The weight of information that the study was calibrated to."""
    if setup.calibration is None:
        raise LabError("no condition of the study calibrates alpha, so it cannot be varied")
    return setup.calibration.alpha


@dataclass(frozen=True)
class Replication:
    """Everything the report is made of."""

    plan: Plan
    preset: str
    participants: int
    studies: tuple[Values, ...]
    shares: tuple[Share, ...]
    means: tuple[Means, ...]
    goals: tuple[GoalGain, ...]
    joint: Joint
    """The paper's thirteen differences at once."""
    lengths: tuple[Lengths, ...]
    """How long tasks take without time limits."""
    varied: tuple[tuple[Variation, tuple[Share, ...]], ...] = ()
    unvaried: tuple[Share, ...] = ()
    """The first studies with nothing changed: as many as each variation ran, of the same people."""
    vary: int = 0


def replicate(
    plan: Plan,
    preset: str,
    studies: int,
    participants: int,
    workers: int,
    vary: int,
    out_dir: Path | None,
) -> Replication:
    """Run, compare, vary. Raises `LabError` out of bounds, or for a folder of another run."""
    check_count("studies", studies, MAX_STUDIES)
    check_count("participants", participants, 200)
    check_count("workers", workers, MAX_WORKERS)
    if participants < 2:
        raise LabError("participants is 1; comparing conditions within people takes at least 2")
    if not 0 <= vary <= studies:
        raise LabError(f"vary is {vary}; it must be from 0 (vary nothing) to {studies}, the number of studies")
    check_place(out_dir)
    folder = out_dir / "studies" if out_dir else None
    values = run_studies(plan, studies, participants, workers, folder)
    base = compare_all(values, workers)
    rows = []
    for variation in variations(plan) if vary else ():
        place = out_dir / "varied" / _slug(variation.name) if out_dir else None
        changed = run_studies(varied(plan, variation), vary, participants, workers, place, f"studies, {variation.name}")
        rows.append((variation, shares(compare_all(changed, workers))))
    return Replication(
        plan=plan,
        preset=preset,
        participants=participants,
        studies=tuple(values),
        shares=shares(base),
        means=means(values),
        goals=goal_gains(values),
        joint=joint(base),
        lengths=summed_up([task for study in values for task in study.lengths]),
        varied=tuple(rows),
        unvaried=shares(base[:vary]) if vary else (),
        vary=min(vary, studies),
    )


def compare_all(values: Sequence[Values], workers: int) -> list[dict[Claim, Any]]:
    """Every study's comparisons."""
    jobs = list(enumerate(values))
    found = {job[0]: result for job, result in run_jobs(_compared, jobs, min(workers, 1 + len(values) // 50))}
    return [found[number] for number in sorted(found)]


def _compared(job: tuple[int, Values]) -> dict[Claim, Any]:
    return compared(job[1])


def check_place(out_dir: Path | None) -> None:
    """Raises `LabError` when the results could not be written there."""
    if out_dir is None:
        return
    if out_dir.is_dir() and any(out_dir.iterdir()) and not (out_dir / "studies").is_dir():
        raise LabError(f"{out_dir}: not empty and not of an earlier run; choose another folder with --out")
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LabError(f"{out_dir}: cannot be made: {error.strerror or error}") from None


def _slug(name: str) -> str:
    return "".join(char if char.isalnum() else "_" for char in name)
