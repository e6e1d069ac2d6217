"""From a participant's plan (ids) to a trial's set-up (places, things, numbers): where study and robot meet."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from app.autonomy.arbiter import ArbiterParameters, Condition
from app.autonomy.calibration import Calibration, calibrate_alpha
from app.autonomy.errors import AutonomyError
from app.autonomy.transition import TransitionModel
from app.trial.labels import Labels
from app.trial.values import CycleSetup, RobotTiming, TrialSetup
from app.trial.world import layout_of
from sim.layouts import Layout, practice_scene
from sim.layouts import scene as layout_scene
from study.definition.study import SessionPlan, Study
from study.records import TrialRow

CALIBRATION_SEED = 2020
"""Fixed, so that every lab that runs the same study file gets the same alpha."""


@dataclass(frozen=True)
class StudySetup:
    """A study file together with the world it runs in and the weight calibrated for it."""

    study: Study
    layout: Layout
    calibration: Calibration | None

    def parameters(self, condition_id: str) -> ArbiterParameters:
        """The arbiter's parameters under one condition."""
        condition, settings = self.study.condition(condition_id), self.study.arbiter
        alpha = condition.alpha
        if alpha == "calibrated":
            assert self.calibration is not None
            alpha = self.calibration.alpha
        return ArbiterParameters(
            condition=condition.arbiter,
            alpha=float(alpha),
            beta=condition.beta,
            gamma=condition.gamma,
            rationality_per_m=settings.rationality_per_m,
            transition=TransitionModel(settings.transition, settings.step_m, settings.planning_delay),
            entropy_floor=settings.entropy_floor,
            stickiness=settings.stickiness,
        )

    def parameters_like(self, arbiter: Condition) -> ArbiterParameters:
        """The parameters of the study's first condition with that arbiter; without one, the study's model with
        the calibrated alpha. Raises `AutonomyError` when there is no alpha to take."""
        for condition in self.study.conditions:
            if condition.arbiter == arbiter:
                return self.parameters(condition.id)
        if arbiter == "balanced" and self.calibration is None:
            raise AutonomyError("alpha is missing; this study has no balanced condition to take it from")
        like = self.parameters(self.study.conditions[0].id)
        alpha = self.calibration.alpha if self.calibration and arbiter == "balanced" else 0.0
        return replace(like, condition=arbiter, alpha=alpha)

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
            cycles = (CycleSetup(practice_scene(self.layout), self.layout.practice_object.id, None),)
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
            parameters=self.parameters(drawn.condition),
            timing=RobotTiming(
                speed_m_s=settings.speed_m_s,
                gripper_ticks=settings.gripper_ticks,
                settle_timeout_ticks=settings.settle_timeout_ticks,
                reset_ticks=settings.reset_ticks,
            ),
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
        """Every parameter of the arbiter under one condition, for the record."""
        parameters = self.parameters(condition_id)
        fields = {name: value for name, value in vars(parameters).items() if name != "transition"}
        return {**fields, "transition": vars(parameters.transition)}


def study_setup(study: Study) -> StudySetup:
    """The study with its layout; alpha is calibrated if any condition asks for it (about a second)."""
    layout = layout_of(study)
    setup = StudySetup(study, layout, None)
    if all(condition.alpha != "calibrated" for condition in study.conditions):
        return setup
    settings = study.arbiter
    model = TransitionModel(settings.transition, settings.step_m, settings.planning_delay)
    return replace(setup, calibration=_calibrate(setup, model))


def calibration_text(calibration: Calibration) -> str:
    """The weight and how well it does what the paper wants of it (IV-A), in one line."""
    vague, sure = calibration.share_information_above_0_7, calibration.share_goals_below_0_3
    return (
        f"alpha is calibrated to {calibration.alpha:.4g}. Of sampled states, information weighs more than "
        f"goals in {vague:.0%} with a vague belief (entropy above 0.7), goals weigh more in {sure:.0%} with a sure one "
        f"(below 0.3)"
    )


def _calibrate(setup: StudySetup, model: TransitionModel) -> Calibration:
    """Over the goals a participant can meet: all objects of the layout, fewer of them, and the bins."""
    study, layout = setup.study, setup.layout
    scene = layout_scene(layout, study.objects, study.objects)
    grasps = np.array([_grasp(scene.object(name)) for name in study.objects])
    bins = np.array([item.release_world_m for item in layout.bins])
    goal_sets = [grasps, *(grasps[left_out:] for left_out in range(1, study.pickups_per_trial)), bins]
    low = grasps.min(axis=0) - 0.10
    high = np.maximum(grasps.max(axis=0), bins.max(axis=0)) + 0.05
    return calibrate_alpha(goal_sets, (low, high), model, study.arbiter.rationality_per_m, CALIBRATION_SEED)


def _grasp(placed: Any) -> tuple[float, float, float]:
    x_m, y_m, z_m = placed.base_world_m
    return (x_m, y_m, z_m + placed.spec.grasp_height_m)
