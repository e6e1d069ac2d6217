"""How a simulated participant is in the task at hand: practised, tired, in a mood, mixed up.

    state = Course(traits, rng, tasks_before).state("wipes_tub", carrying=False, tick=120)

One task is one object to be fetched, or to be brought away. Its state is drawn when it begins and holds until it ends,
also where a grasp was missed and the task begins again. Every habit draws from a stream of its own, which the driver's
own draws never touch: with these traits at 0, a participant does exactly what one without them does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from app.simulated.traits import TRAITS, Device, Traits
from sim.interface import TICK_S

MIDDLE_TASK = 12
"""Of a study with three trials of six tasks, each after a practice of two: where learning counts as 1, so that the
means of the other traits are those of the middle of a study."""
PRACTICE_TASKS = 2
RESTED_MIN = 3.5
"""Minutes into a trial at which tiredness counts as 1: the middle of the paper's trials of about seven minutes."""
NOTICED_AFTER = 8
"""Presses, on average, until somebody who is mixed up sees it. Assumed: four seconds."""

MOST_CHECKING_TICKS = 20
"""So long, on average, somebody looks again before using the gripper. A reading comes every 40 ticks, after which one
looks again from the beginning: who took longer would never come to an end."""


@dataclass(frozen=True)
class Hands:
    """What a device does to how one drives: factors on traits. A pad is what the paper's participants held, hence 1."""

    two_axes: float = 1.0
    slip: float = 1.0
    pause: float = 1.0


HANDS: Mapping[Device, Hands] = MappingProxyType(
    {"gamepad": Hands(), "keyboard": Hands(two_axes=0.4, slip=1.5, pause=0.9)}
)
"""Assumed. Two axes at once take two fingers on a keyboard and one push on a stick; six keys that look alike are mixed
up more often than a stick's sides; and a finger that rests on a key sets off sooner."""


@dataclass(frozen=True)
class TaskState:
    """One person in one task: the traits as they are in it, how far off depth is judged, and for how many presses one
    goes for the wrong side (0 = not at all)."""

    traits: Traits
    depth_error_m: float
    mixed_up: int


class Course:
    """One person through the tasks of one trial or practice. `tasks_before` are those done earlier in the study."""

    def __init__(self, traits: Traits, rng: np.random.Generator, tasks_before: int = 0) -> None:
        self._traits = with_hands(traits)
        self._moods, self._depths, self._mix_ups = rng.spawn(3)
        self._tasks_before = tasks_before
        self._states: dict[tuple[str, bool], TaskState] = {}

    def state(self, object_id: str, carrying: bool, tick: int) -> TaskState:
        """The state in that task; drawn the first time, at tick `tick` of the trial."""
        task = (object_id, carrying)
        if task not in self._states:
            self._states[task] = self._drawn(tick)
        return self._states[task]

    def _drawn(self, tick: int) -> TaskState:
        traits = self._traits
        number = 1 + self._tasks_before + len(self._states)
        skill = practised(traits.learning, number) * tired(traits.fatigue, tick * TICK_S / 60.0)
        mood = math.exp(traits.mood * self._moods.standard_normal() - traits.mood**2 / 2.0)
        presses = 0
        if self._mix_ups.random() < traits.mix_up:
            presses = 1 + int(self._mix_ups.poisson(NOTICED_AFTER - 1))
        depth_error_m = traits.depth_error_m * float(self._depths.standard_normal())
        return TaskState(slowed(traits, skill * mood, skill), depth_error_m, presses)


def tasks_before(tasks_per_trial: int, trial: int, practising: bool) -> int:
    """Tasks done in a study before that trial (from 1), or before the practice for it."""
    return (trial - 1) * (PRACTICE_TASKS + tasks_per_trial) + (0 if practising else PRACTICE_TASKS)


def practised(learning: float, number: int) -> float:
    """Pauses and errors in a person's task `number`, from 1, as a multiple of those in the middle of the study: the
    power law of practice (Newell & Rosenbloom 1981)."""
    return math.pow(number / MIDDLE_TASK, -learning)


def tired(fatigue: float, minutes: float) -> float:
    """The same for the minutes since the trial began; a break between trials is taken to undo it."""
    return max(1.0 + fatigue * (minutes - RESTED_MIN) / 10.0, 0.0)


def slowed(traits: Traits, pace: float, errors: float) -> Traits:
    """Those traits with pauses, looks, checks and second tries times `pace` and errors times `errors`, in
    bounds."""
    if pace == 1.0 and errors == 1.0:
        return traits

    def at_most(name: str, value: float) -> float:
        return min(value, TRAITS[name].high)

    fine_pause = at_most("fine_pause", 1.0 + (traits.fine_pause - 1.0) * pace)
    return replace(
        traits,
        look=at_most("look", traits.look * pace),
        pause=at_most("pause", 1.0 + (traits.pause - 1.0) * pace),
        fine_pause=fine_pause,
        checks=min(at_most("checks", traits.checks * pace), MOST_CHECKING_TICKS / fine_pause),
        second_try=at_most("second_try", traits.second_try * pace),
        slip=at_most("slip", traits.slip * errors),
        overshoot=at_most("overshoot", traits.overshoot * errors),
        eye_error=at_most("eye_error", traits.eye_error * errors),
    )


def with_hands(traits: Traits) -> Traits:
    """Those traits with what the person's device makes of them."""
    hands = HANDS[traits.device]
    if hands == Hands():
        return traits
    return replace(
        traits,
        two_axes=traits.two_axes * hands.two_axes,
        slip=traits.slip * hands.slip,
        pause=1.0 + (traits.pause - 1.0) * hands.pause,
    )


def ticks_of(seconds: float) -> int:
    """Whole ticks that a time takes."""
    return max(0, round(seconds / TICK_S))
