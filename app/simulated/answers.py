"""What simulated participants answer: questionnaires after a trial, and the forms before and after. Pure.

The questionnaire model, in points of the 1 to 7 scale:

    usability = 5.4 + 0.8 leniency - 0.15 (minutes - 7) - 0.25 failures - 2.5 contrary + 0.4 noise
    workload  = 3.1 + 1.1 strain   + 0.10 (minutes - 7) + 0.20 missed   + 2.0 contrary + 0.4 noise

`minutes` is how long the trial took, `failures` how many tasks failed, `missed` how many readings were not answered
or wrong, `contrary` the share of the robot's own moves that led away from the instructed goal. Each item then adds its
own noise (sd 0.7), is rounded, and is turned round where the questionnaire does so.

**Circular, and to be read that way:** the base values are the paper's for pure teleoperation, and that moves away
from one's goal annoy is *assumed*, in the direction of the paper's finding. That the simulated balanced condition is
rated less usable therefore says nothing about people. What is not assumed is how often the robot moves away, how long
trials take and how many tasks fail; those come out of the simulation. Use these answers to pilot an analysis, not as a
finding.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.simulated.traits import Traits
from study.definition.study import Study

USABILITY, WORKLOAD = 5.4, 3.1
LENIENCY, STRAIN = 0.8, 1.1
USUAL_MINUTES = 7.0
ITEM_NOISE = 0.7
SCORE_NOISE = 0.4


@dataclass(frozen=True)
class Experience:
    """What a trial was like, as far as the answers depend on it. `contrary` is a share, 0 to 1."""

    minutes: float
    failures: int
    missed: int
    contrary: float


def survey_answers(
    study: Study, traits: Traits, felt: Experience, rng: np.random.Generator
) -> dict[str, dict[str, int]]:
    """Answers to every questionnaire of the study, as `study.flow.answers.validate_surveys` takes them.

    A questionnaire that is about neither usability nor workload is answered around the middle.
    """
    extra = felt.minutes - USUAL_MINUTES
    usability = USABILITY + LENIENCY * traits.leniency - 0.15 * extra - 0.25 * felt.failures - 2.5 * felt.contrary
    workload = WORKLOAD + STRAIN * traits.strain + 0.10 * extra + 0.20 * felt.missed + 2.0 * felt.contrary
    levels = {"sus_modified": usability, "tlx_raw": workload}
    answers: dict[str, dict[str, int]] = {}
    for form in study.instruments:
        name = form.id
        level = levels.get(name, (form.points + 1) / 2.0) + SCORE_NOISE * float(rng.standard_normal())
        answers[name] = {}
        for item in form.items:
            point = round(level + ITEM_NOISE * float(rng.standard_normal()))
            point = min(max(point, 1), form.points)
            answers[name][item.id] = form.points + 1 - point if item.reversed else point
    return answers


def demographic_answers(study: Study, rng: np.random.Generator) -> dict[str, Any]:
    """Any of the options, all as likely; a number from 18 to 65; no words."""
    answers: dict[str, Any] = {}
    for item in study.demographics:
        if item.kind == "choice":
            answers[item.id] = item.options[int(rng.integers(len(item.options)))].id
        elif item.kind == "number":
            answers[item.id] = int(rng.integers(18, 66))
        elif item.required:
            answers[item.id] = "simulated"
    return answers


def comprehension_answers(study: Study) -> Mapping[str, str]:
    """Everything right: simulated participants have read the instructions."""
    return {question.id: question.correct for question in study.instructions.questions}
