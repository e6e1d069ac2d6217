"""What scripted clients answer when a page asks them (`study.flow.page.Person`): simulated participants, and the bot.

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

from app.errors import LabError
from app.simulated.traits import Traits
from study.definition.study import Study
from study.flow.eligibility import USER_AGENTS
from study.flow.page import Content

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


class SimulatedPerson:
    """A simulated participant on one page, with a stream of its own to draw answers from."""

    def __init__(self, study: Study, traits: Traits, felt: Experience, rng: np.random.Generator) -> None:
        self._rng = rng
        self._device = traits.device
        self._right = {question.id: question.correct for question in study.instructions.questions}
        self._turned = {(form.id, item.id) for form in study.instruments for item in form.items if item.reversed}
        extra = felt.minutes - USUAL_MINUTES
        usability = USABILITY + LENIENCY * traits.leniency - 0.15 * extra - 0.25 * felt.failures - 2.5 * felt.contrary
        workload = WORKLOAD + STRAIN * traits.strain + 0.10 * extra + 0.20 * felt.missed + 2.0 * felt.contrary
        self._levels = {"sus_modified": usability, "tlx_raw": workload}

    def device(self, asked: Content) -> None:
        """There is none: nobody looks at a simulated screen."""

    def controls(self) -> Mapping[str, Any]:
        """What is in this person's hands."""
        if self._device == "keyboard":
            return {"device": "keyboard", "sound": True}
        return {"device": "gamepad", "pad_id": "simulated", "sound": True}

    def about(self, item: Content) -> Any:
        """Any of the options, all as likely; a number from 18 to 65; no words unless they are required."""
        if item["kind"] == "choice":
            return item["options"][int(self._rng.integers(len(item["options"])))]["id"]
        if item["kind"] == "number":
            return int(self._rng.integers(18, 66))
        return "simulated" if item["required"] else None

    def understood(self, question: Content) -> str:
        """Everything right: simulated participants have read the instructions."""
        return self._right[question["id"]]

    def rated(self, form: Content) -> dict[str, int]:
        """As the model above says; around the middle where a form is about neither usability nor workload."""
        name, points = form["id"], form["points"]
        level = self._levels.get(name, (points + 1) / 2.0) + SCORE_NOISE * float(self._rng.standard_normal())
        given = {}
        for item in form["items"]:
            point = round(level + ITEM_NOISE * float(self._rng.standard_normal()))
            point = min(max(point, 1), points)
            given[item["id"]] = points + 1 - point if (name, item["id"]) in self._turned else point
        return given


class PlainPerson:
    """Whom the bot stands for: the middle of every scale, the first option, the next one where that was wrong."""

    def __init__(self) -> None:
        self._tries: dict[str, int] = {}

    def device(self, asked: Content) -> Mapping[str, Any]:
        """A device that has everything. Its round trip is measured all the same."""
        size = {"width_px": 10_000, "height_px": 10_000}
        parts = {"has_touch_only": False, "has_webgl": True, "is_secure": True, "pad_id": "scripted"}
        agent = "".join(USER_AGENTS[name] for name in asked["browsers"][:1])
        return {**size, **parts, "user_agent": agent, "tones": (asked["tones"] or [None])[0]}

    def controls(self) -> Mapping[str, Any]:
        """The keyboard."""
        return {"device": "keyboard", "sound": True}

    def about(self, item: Content) -> Any:
        """The least that is required."""
        if not item["required"]:
            return None
        options = [option["id"] for option in item["options"]]
        return {"choice": options[0] if options else "", "number": 30, "text": "-"}[item["kind"]]

    def understood(self, question: Content) -> str:
        """One option after another until it is the right one, as somebody who has not read the text."""
        name, options = question["id"], [option["id"] for option in question["options"]]
        tries = self._tries.setdefault(name, 0)
        if tries >= len(options):
            raise LabError(f"no option of question {name!r} is right")
        return str(options[tries])

    def was_wrong(self, question: str) -> bool:
        """Remember that an option was wrong; whether this is a question that was tried at all."""
        if question not in self._tries:
            return False
        self._tries[question] += 1
        return True

    def rated(self, form: Content) -> dict[str, int]:
        """The middle."""
        return {item["id"]: (form["points"] + 1) // 2 for item in form["items"]}
