"""From a participant's plan (ids) to a trial's set-up (places, things, numbers): where study and robot meet."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from app.autonomy.arbiters.weighing import CALIBRATED
from app.autonomy.calibration import PRINTED, Band, Calibration, calibrate_alpha, calibrate_on_visits
from app.autonomy.errors import AutonomyError
from app.autonomy.interface import Arbiter, Models
from app.autonomy.looking import Looking
from app.autonomy.transition import TransitionModel
from app.trial.guarded_distractor import GuardedDistractor
from app.trial.labels import Labels
from app.trial.parts import ARBITERS, make_arbiter, make_distractor, make_inference, named, shelf
from app.trial.values import BOLTZMANN, CycleSetup, RobotTiming, TimeLimits, TrialSetup
from app.trial.visits import visits
from app.trial.world import layout_of
from sim.layouts import Layout, practice_scene
from sim.layouts import scene as layout_scene
from study.definition.named_parts import parameters_of
from study.definition.sections import MODEL_FIELDS, ArbiterSettings, DistractorSettings
from study.definition.study import SessionPlan, Study
from study.parts.errors import PartError
from study.parts.shelf import Named, code_among
from study.records import TICK_S, TrialRow

CALIBRATION_SEED = 2020
"""Fixed, so that every lab that runs the same study file gets the same alpha."""


@dataclass(frozen=True)
class StudySetup:
    """A study file together with the world it runs in, its parts, and the weight calibrated for it.

    `arbiters` and `inferences` are those of each condition, by its id, with all they take.
    """

    study: Study
    layout: Layout
    calibration: Calibration | None
    arbiters: Mapping[str, Named]
    inferences: Mapping[str, Named]
    distractor: GuardedDistractor

    def models(self, condition_id: str) -> Models:
        """The models of the person and of the arm under one condition."""
        condition = self.study.condition(condition_id)
        chosen = {name: getattr(condition, name) for name in MODEL_FIELDS}
        return _models(self.study.arbiter, {name: value for name, value in chosen.items() if value is not None})

    def arbiter(self, condition_id: str) -> Arbiter:
        """The arbiter of one condition, as it is before a trial."""
        return make_arbiter(self.arbiters[condition_id], self.models(condition_id))

    def arbiter_like(self, name: str) -> tuple[Named, Models]:
        """The arbiter of the condition with that id, or of the first one with an arbiter of that name; without one, a
        shipped one with the study's model and its calibrated alpha.

        Raises `AutonomyError` when there is no alpha to take, and `PartError` for an unknown name.
        """
        for condition in self.study.conditions:
            if name == condition.id:
                return self.arbiters[name], self.models(name)
        for condition in self.study.conditions:
            if name == condition.arbiter:
                return self.arbiters[condition.id], self.models(condition.id)
        settings = self.study.arbiter
        shared = {"entropy_floor": settings.entropy_floor, "stickiness": settings.stickiness}
        if name == "balanced":
            if self.calibration is None:
                raise AutonomyError("alpha is missing; this study has no balanced condition to take it from")
            shared["alpha"] = self.calibration.alpha
        elif name not in ARBITERS.shipped:
            ARBITERS.place_of(name)  # says which there are
            raise PartError(f"no condition of this lab's study has the arbiter {name!r}")
        return Named("arbiter", name, shared), _models(settings, {})

    def labels(self) -> Labels:
        """The words for everything that can be named in an instruction."""
        return Labels(
            objects={spec.id: spec.label for spec in (*self.layout.objects, self.layout.practice_object)},
            bins={item.id: item.label for item in self.layout.bins},
        )

    def trial_setup(
        self, participant: str, plan: SessionPlan, trial: int, kind: Literal["trial", "practice"]
    ) -> TrialSetup:
        """Everything trial `trial` (or the practice before it) depends on besides the inputs."""
        drawn, settings = plan.trial(trial), self.study.robot
        cycles: tuple[CycleSetup, ...]
        if kind == "practice":
            # Sideways, and into a bin, as in a trial; the bins take turns.
            as_rounds = self.study.practice_task == "round"
            into = self.study.bins[(trial - 1) % len(self.study.bins)] if as_rounds else None
            cycles = (CycleSetup(practice_scene(self.layout), self.layout.practice_object.id, into),)
        else:
            done: set[str] = set()
            made = []
            for pickup in drawn.pickups:
                remaining = [name for name in drawn.placement if name not in done]
                made.append(
                    CycleSetup(layout_scene(self.layout, drawn.placement, remaining), pickup.object, pickup.bin)
                )
                done.add(pickup.object)
            cycles = tuple(made)
        return TrialSetup(
            participant=participant,
            trial=trial,
            condition=drawn.condition,
            kind=kind,
            cycles=cycles,
            arbiter=self.arbiters[drawn.condition],
            inference=self.inferences[drawn.condition],
            models=self.models(drawn.condition),
            timing=RobotTiming(
                speed_m_s=settings.speed_m_s,
                gripper_ticks=settings.gripper_ticks,
                settle_timeout_ticks=settings.settle_timeout_ticks,
                reset_ticks=settings.reset_ticks,
            ),
            limits=TimeLimits(
                task_ticks=_ticks(self.study.task_limit_s) if kind == "trial" else 0,
                trial_ticks=_ticks(self.study.trial_limit_s),
            ),
            keep_way_on=self.study.arbiter.keep_way_on,
        )

    def trial_row(self, participant: str, plan: SessionPlan, trial: int) -> TrialRow:
        """The trial's row as it begins."""
        drawn = plan.trial(trial)
        return TrialRow(
            participant=participant,
            condition=drawn.condition,
            trial=trial,
            layout=self.layout.name,
            placement=json.dumps(drawn.placement),
            parameters=json.dumps(self.parameters_json(drawn.condition)),
            outcome="running",
            ticks=0,
            overruns=0,
            started_utc=None,
            finished_utc=None,
        )

    def parameters_json(self, condition_id: str) -> dict[str, Any]:
        """Every parameter of the arbiter under one condition, and the models it reasons with, for the record."""
        arbiter, inference = self.arbiters[condition_id], self.inferences[condition_id]
        models = self.models(condition_id)
        # Records from before there was a choice say nothing of it.
        unsaid = ("information", "look_ahead_m") if arbiter.parameters.get("information") == "next" else ()
        weights = {name: arbiter.parameters[name] for name in _WEIGHTS if name in arbiter.parameters}
        recorded = {
            "condition": arbiter.name,
            **weights,
            "rationality_per_m": models.rationality_per_m,
            **{name: value for name, value in arbiter.parameters.items() if name not in (*weights, *unsaid)},
            "transition": vars(models.transition),
        }
        if self.study.arbiter.calibrated_on != "sampled" and "alpha" in weights:
            recorded["calibrated_on"] = self.study.arbiter.calibrated_on
        if self.study.arbiter.keep_way_on:
            recorded["keep_way_on"] = True
        if inference != BOLTZMANN:
            recorded["inference"] = {"kind": inference.name, **inference.parameters}
        return recorded


_WEIGHTS = ("alpha", "beta", "gamma")
"""What stands first in the record."""


def setup_to_end(study: Study) -> StudySetup:
    """What a session whose parts cannot be used is ended with: it has the words, and makes no trial."""
    common = study.distractor.model_dump(include=set(DistractorSettings.model_fields) - {"kind"})
    readings = GuardedDistractor(make_distractor(DistractorSettings(**common)))
    return StudySetup(study, layout_of(study), None, {}, {}, readings)


def study_setup(study: Study, trust: bool = False) -> StudySetup:
    """The study with its layout and parts; alpha is calibrated if any condition asks for it (about a second).

    Raises `PartError` with one line for a part that cannot be used: code beside the study file that is not trusted, a
    package that is not the one the study was made with, a class that is broken.
    """
    held, layout = shelf(trust), layout_of(study)
    calibrations: dict[Looking, Calibration] = {}
    arbiters, inferences = {}, {}
    for condition in study.conditions:
        code = code_among(study.codes, "arbiter", condition.arbiter)
        given = parameters_of(condition, study.arbiter, held.load("arbiter", condition.arbiter, code).Parameters)
        if given.get("alpha") == CALIBRATED:
            looking = _looking(given)
            if looking not in calibrations:
                calibrations[looking] = _calibrate(study, layout, looking)
            given = {**given, "alpha": calibrations[looking].alpha}
        arbiters[condition.id] = named("arbiter", condition.arbiter, given, study.codes, held)
        chosen = condition.inference or study.inference
        inferences[condition.id] = named("inference", chosen.kind, chosen.parameters, study.codes, held)
    distractor = GuardedDistractor(make_distractor(study.distractor, study.codes, trust))
    first = next(iter(calibrations.values()), None)
    setup = StudySetup(study, layout, first, arbiters, inferences, distractor)
    for condition in study.conditions:  # what cannot be made is told now, not in a trial
        setup.arbiter(condition.id)
        make_inference(setup.inferences[condition.id], setup.models(condition.id))
    return setup


def _ticks(limit_s: float) -> int:
    """The first tick at whose end so much time has passed."""
    return math.ceil(limit_s / TICK_S)


def _models(settings: ArbiterSettings, instead: Mapping[str, Any]) -> Models:
    chosen = {**{name: getattr(settings, name) for name in MODEL_FIELDS}, **instead}
    model = TransitionModel(chosen["transition"], chosen["step_m"], chosen["planning_delay"])
    return Models(chosen["rationality_per_m"], model)


def calibration_text(calibration: Calibration) -> str:
    """The weight and how well it does what the paper wants of it (IV-A), in one line."""
    vague, sure = calibration.shares.information_above_0_7, calibration.shares.goals_below_0_3
    if calibration.shares.in_use:
        low, high = calibration.ratio_quartiles
        return (
            f"alpha is calibrated to {calibration.alpha:.4g}, on {calibration.samples} states in which hands leave the "
            f"controls in teleoperation, near half entropy (quartiles {low:.4g} and {high:.4g}). In use, by entropy: "
            + "; ".join(_band_text(band) for band in calibration.shares.in_use)
        )
    return (
        f"alpha is calibrated to {calibration.alpha:.4g}. Of sampled states, information weighs more than "
        f"goals in {vague:.0%} with a vague belief (entropy above 0.7), goals weigh more in {sure:.0%} with a sure one "
        f"(below 0.3)"
    )


def _band_text(band: Band) -> str:
    """A band of entropies in use, as `0.3 to 0.7: 26% of states, information leads in 44%, goals in 56%`."""
    leads = band.information_leads
    return (
        f"{band.low:g} to {band.high:g}: {band.states:.0%} of states, information leads in {leads:.0%}, goals in "
        f"{1.0 - leads:.0%}"
    )


def _looking(parameters: Mapping[str, Any]) -> Looking:
    """Where an arbiter with these parameters looks at information; one that cannot be is told with its parameters."""
    try:
        return Looking(parameters.get("information", "next"), parameters.get("look_ahead_m", PRINTED.look_ahead_m))
    except (AutonomyError, TypeError):
        return PRINTED


def _calibrate(study: Study, layout: Layout, looking: Looking) -> Calibration:
    """Over the goals a participant can meet: all objects of the layout, fewer of them, and the bins."""
    models = _models(study.arbiter, {})
    if study.arbiter.calibrated_on == "visited":
        way_m = study.robot.speed_m_s * TICK_S
        found = visits(layout, study.objects, study.bins, study.pickups_per_trial, models, way_m, CALIBRATION_SEED)
        return calibrate_on_visits(found, models.transition, models.rationality_per_m, looking)
    scene = layout_scene(layout, study.objects, study.objects)
    grasps = np.array([_grasp(scene.object(name)) for name in study.objects])
    bins = np.array([item.release_world_m for item in layout.bins])
    goal_sets = [grasps, *(grasps[left_out:] for left_out in range(1, study.pickups_per_trial)), bins]
    low = grasps.min(axis=0) - 0.10
    high = np.maximum(grasps.max(axis=0), bins.max(axis=0)) + 0.05
    return calibrate_alpha(
        goal_sets, (low, high), models.transition, models.rationality_per_m, CALIBRATION_SEED, looking=looking
    )


def _grasp(placed: Any) -> tuple[float, float, float]:
    x_m, y_m, z_m = placed.base_world_m
    return (x_m, y_m, z_m + placed.spec.grasp_height_m)
