"""`salab replicate`: many simulated studies, each analysed as the paper analysed its own, and a report that puts the
paper's numbers beside ours, says what moves them, and why a comparison misses its aim.

Left in the folder: `replication.md` (the report), tables that `columns.csv` describes, and the studies' values in
`studies/` and `varied/`, from which an interrupted run goes on and which `salab power` reads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.errors import LabError
from app.replication.comparisons import (
    Compared,
    GoalGain,
    Joint,
    Means,
    Share,
    compared,
    goal_gains,
    joint,
    means,
    shares,
)
from app.replication.long_tasks import Lengths, summed_up
from app.replication.paper import CONDITIONS_IN_ORDER
from app.replication.reasons import Experiment
from app.replication.reasons import experiments as reanalysed
from app.replication.studies import MAX_STUDIES, Batch, Studies, Values, run_batches, run_studies, unpacked
from app.simulated.study import MAX_WORKERS, Plan, check_count, run_jobs, setup_of
from app.simulated.traits import OFF, TRAITS, Population
from app.simulated.variants import Changes, changed_study
from app.trial.setup import StudySetup
from app.trial.world import parse_text

ALPHA_REASON, PEOPLE_REASON = "weight of information, alpha", "differences between people"
STUDIES_FOR_REASONS = 20
"""Where anything is varied, what tells of a reason for a miss is run this often, or as often as there are studies."""


WITHIN_PEOPLE = ("mood", "second_try", "learning", "fatigue")
"""Traits that make one person's tasks differ."""


@dataclass(frozen=True)
class Variation:
    """One thing changed from the fitted simulation: the study file, the people, or alpha times a factor."""

    name: str
    about: str
    study: Changes
    means: Mapping[str, float]
    spread_scale: float = 1.0
    alpha_factor: float | None = None
    reason: str | None = None
    """The reason for a miss that it tells of. Such a variation runs more studies, so that it can."""


def variations(plan: Plan) -> tuple[Variation, ...]:
    """One thing at a time, around the plan's own numbers; people are not varied to what they are."""
    own = setup_of(plan.study_text).study
    arbiter, robot, placement = own.arbiter, own.robot, own.distractor.placement
    mean = plan.population.mean

    def study(name: str, about: str, section: str, key: str, value: Any) -> Variation:
        return Variation(name, about, {section: {key: value}}, {})

    def people(name: str, about: str, **means_: float) -> Variation:
        return Variation(name, about, {}, means_)

    def bounded(trait: str, value: float) -> float:
        return min(max(value, TRAITS[trait].low), TRAITS[trait].high)

    one_screen = ("one screen", "readings on the same page", "distractor", "placement", "same_page_away")
    two_screens = ("two screens", "readings on a second device", "distractor", "placement", "second_device")
    elsewhere = two_screens if placement == "same_page_away" else one_screen
    other = "mix" if arbiter.transition == "replan" else "replan"
    every = (
        study("step / 2", "model step halved", "arbiter", "step_m", arbiter.step_m / 2.0),
        study("step x 2", "model step doubled", "arbiter", "step_m", arbiter.step_m * 2.0),
        study("rationality / 2", "", "arbiter", "rationality_per_m", arbiter.rationality_per_m / 2.0),
        study("rationality x 2", "", "arbiter", "rationality_per_m", arbiter.rationality_per_m * 2.0),
        study("delay - 0.3", "planning delay", "arbiter", "planning_delay", max(arbiter.planning_delay - 0.3, 0.0)),
        study("delay + 0.15", "planning delay", "arbiter", "planning_delay", min(arbiter.planning_delay + 0.15, 0.95)),
        study(f"transition {other}", "the other transition model", "arbiter", "transition", other),
        study("stickiness 0", "nothing against dithering", "arbiter", "stickiness", 0.0),
        Variation("alpha / 3", "information counts a third", {}, {}, alpha_factor=1.0 / 3.0, reason=ALPHA_REASON),
        Variation("alpha x 3", "information counts three times", {}, {}, alpha_factor=3.0, reason=ALPHA_REASON),
        study("layout rows", "the other layout", "", "layout", "rows"),
        study("speed x 1.5", "robot speed", "robot", "speed_m_s", min(robot.speed_m_s * 1.5, 0.1)),
        people("away 3.5 s", "shorter readings", away_s=3.5),
        people("away 9 s", "longer readings", away_s=9.0),
        study(*elsewhere),
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
        people("same in every task", "no mood, no second try, no learning, no fatigue", **_off(*WITHIN_PEOPLE)),
        people("no learning", "neither practice nor fatigue", **_off("learning", "fatigue")),
        people(
            "no mistakes", "sides, depth and buttons as they are", **_off("mix_up", "depth_error_m", "wrong_button")
        ),
        people("low lift", "things are lifted no higher than needed", **_off("lift_m")),
        people("keyboards", "everybody at a keyboard", keyboard=1.0),
        people("people of 0.1", "all these traits off", **OFF),
        people("one axis", "never two axes at once", two_axes=0.0),
        people("two axes", "mostly two axes at once", two_axes=0.7),
        Variation("equal people", "no differences between people", {}, {}, spread_scale=0.0, reason=PEOPLE_REASON),
    )
    return tuple(item for item in every if not item.means or any(mean(name) != to for name, to in item.means.items()))


def _off(*traits: str) -> dict[str, float]:
    return {name: OFF[name] for name in traits}


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
class Varied:
    """One thing changed, in the first so many studies, held against the same studies unchanged."""

    variation: Variation
    studies: int
    before: tuple[Share, ...]
    after: tuple[Share, ...]


@dataclass(frozen=True)
class Replication:
    """Everything the report is made of."""

    plan: Plan
    preset: str
    participants: int
    studies: Sequence[Values]
    shares: tuple[Share, ...]
    means: tuple[Means, ...]
    goals: tuple[GoalGain, ...]
    joint: Joint
    """The paper's thirteen differences at once."""
    lengths: tuple[Lengths, ...]
    """How long tasks take without time limits."""
    varied: tuple[Varied, ...] = ()
    experiments: tuple[Experiment, ...] = ()
    """For the comparisons that miss their aim: what they are missed for."""
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
    check_conditions(plan)
    check_place(out_dir)
    folder = out_dir / "studies" if out_dir else None
    values = run_studies(plan, studies, participants, workers, folder)
    base = compare_all(values, workers)
    rows = vary_each(plan, base, vary, participants, workers, out_dir)
    experiments = reanalysed(values, shares(base), workers) if vary else ()
    return Replication(
        plan=plan,
        preset=preset,
        participants=participants,
        studies=values,
        shares=shares(base),
        means=means(values),
        goals=goal_gains(values),
        joint=joint(base),
        lengths=summed_up(task for study in values for task in study.lengths),
        varied=rows,
        experiments=(*experiments, *(as_experiment(item) for item in rows if item.variation.reason)),
        vary=vary,
    )


def vary_each(
    plan: Plan,
    base: Sequence[Compared],
    vary: int,
    participants: int,
    workers: int,
    out_dir: Path | None,
) -> tuple[Varied, ...]:
    """Every variation, in the first studies; none if `vary` is 0."""
    if not vary:
        return ()
    todo = [(one, studies_of(one, vary, len(base))) for one in variations(plan)]
    places = [out_dir / "varied" / _slug(one.name) if out_dir else None for one, _ in todo]
    batches = [Batch(varied(plan, one), count, place) for (one, count), place in zip(todo, places, strict=True)]
    found = run_batches(batches, participants, workers, f"studies of {len(todo)} variations")
    tested = compare_all(Studies(study for of in found for study in of.packed), workers)
    rows, start = [], 0
    for variation, count in todo:
        rows.append(Varied(variation, count, shares(base[:count]), shares(tested[start : start + count])))
        start += count
    return tuple(rows)


def studies_of(variation: Variation, vary: int, studies: int) -> int:
    """How many studies a variation is run in."""
    return min(max(vary, STUDIES_FOR_REASONS), studies) if variation.reason else vary


def as_experiment(item: Varied) -> Experiment:
    """A variation as an experiment on what was missed."""
    reason = item.variation.reason or item.variation.about
    return Experiment(item.variation.name, reason, item.studies, item.before, item.after, simulated=True)


def compare_all(values: Sequence[Values], workers: int) -> list[Compared]:
    """Every study's comparisons."""
    studies = values if isinstance(values, Studies) else Studies.of(values)
    jobs = list(enumerate(studies.packed))
    found = {job[0]: result for job, result in run_jobs(_compared, jobs, min(workers, 1 + len(values) // 50))}
    return [found[number] for number in sorted(found)]


def _compared(job: tuple[int, bytes]) -> Compared:
    return compared(unpacked(job[1]))


def check_conditions(plan: Plan) -> None:
    """Raises `LabError` for a study without the paper's three conditions: nothing of it could be compared."""
    found = [condition.id for condition in setup_of(plan.study_text, plan.trust).study.conditions]
    absent = [name for name in CONDITIONS_IN_ORDER if name not in found]
    if absent:
        raise LabError(
            f"the study has no condition {' and none '.join(absent)}; the paper's comparisons are between "
            f"{', '.join(CONDITIONS_IN_ORDER)}, by these ids"
        )


def check_place(out_dir: Path | None, kept: str = "studies") -> None:
    """Raises `LabError` when the results could not be written there. An earlier run left a folder `kept` in it."""
    if out_dir is None:
        return
    if out_dir.is_dir() and any(out_dir.iterdir()) and not (out_dir / kept).is_dir():
        raise LabError(f"{out_dir}: not empty and not of an earlier run; choose another folder with --out")
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LabError(f"{out_dir}: cannot be made: {error.strerror or error}") from None


def _slug(name: str) -> str:
    return "".join(char if char.isalnum() else "_" for char in name)
