"""Simulated participants: who they are. How they drive stands in `driver`, what they answer in `answers`.

A participant is a handful of named traits (`Traits`). A population (`Population`) says how each is spread over
people; `draw_traits` makes one individual. Traits marked "fitted" in `TRAITS` were calibrated on what the paper reports
for pure teleoperation (`app.replication.fit`), the others are plain assumptions that stand here to be argued with.

Nobody's traits know about conditions: whatever differs between conditions in simulated data comes from what the
robot did while the hands were off.

Random numbers: every participant, trial and purpose has a stream of its own (`stream`), so that a longer trial or one
more reading shifts nothing else.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np

from app.errors import LabError

Purpose = Literal["traits", "practice", "trial", "alerts", "survey", "forms", "page"]
Device = Literal["gamepad", "keyboard"]
_PURPOSES: tuple[Purpose, ...] = ("traits", "practice", "trial", "alerts", "survey", "forms", "page")
_NO_TRIAL = 0
"""First key of every stream here. The plan of a session uses the trial's number, from 1, in that place."""


@dataclass(frozen=True)
class Spread:
    """How one trait is spread over people: log-normal around `mean` with `spread` (sd of the logarithm), cut at the
    bounds. A spread of 0 gives everyone the mean."""

    mean: float
    spread: float
    low: float
    high: float
    fitted: bool
    about: str
    source: str = "assumed"
    """Where the mean, or the form, is from: a publication, the paper (its section), or "assumed". A fitted mean is from
    the paper's pure teleoperation whatever stands here."""
    off: float | None = None
    """The value at which the trait does nothing; None for one that cannot be switched off."""


TRAITS: Mapping[str, Spread] = MappingProxyType(
    {
        # ---- choosing a direction
        "rationality": Spread(4.0, 0.3, 0.5, 20.0, False, "weight of progress, per step, when choosing a direction"),
        "habit": Spread(1.0, 0.5, 0.0, 5.0, False, "strength of the preference for some axes over others, per choice"),
        "two_axes": Spread(0.15, 0.5, 0.0, 0.9, False, "chance that a movement uses two axes at once"),
        "slip": Spread(0.02, 0.5, 0.0, 0.3, False, "chance that a movement starts in the wrong direction"),
        # ---- carrying a movement out
        "look": Spread(0.08, 0.4, 0.0, 0.6, True, "chance per tick of stopping in mid-movement to look"),
        "pause": Spread(2.0, 0.3, 1.0, 4.0, True, "mean ticks of looking between two movements, 1 to 4 each time"),
        "overshoot": Spread(0.30, 0.4, 0.0, 0.9, False, "chance per tick of going on past where one meant to stop"),
        "eye_error": Spread(0.10, 0.3, 0.0, 0.5, False, "error in judging a distance, as a share of it"),
        # ---- fine positioning
        "fine_m": Spread(0.08, 0.3, 0.0, 0.3, False, "distance in metres from which one goes on in single taps"),
        "fine_pause": Spread(2.2, 0.3, 1.0, 4.0, True, "mean ticks of looking between two taps, 1 to 4 each time"),
        "tolerance_m": Spread(0.012, 0.2, 0.005, 0.03, False, "how exactly one lines up with an object, metres"),
        "checks": Spread(2.0, 0.4, 0.0, 10.0, True, "times one looks again before closing or opening the gripper"),
        # ---- the readings
        "reaction_s": Spread(1.2, 0.3, 0.3, 5.0, False, "from the sound until the hands leave the controls, seconds"),
        "away_s": Spread(5.5, 0.2, 3.0, 15.0, False, "hands away for one reading, seconds (mean of that person)"),
        "return_s": Spread(1.0, 0.3, 0.0, 4.0, False, "from being back until the first movement, seconds"),
        "typing_error": Spread(0.03, 0.6, 0.0, 0.5, False, "chance that an answer is wrong: a reading, in one digit"),
        "miss": Spread(0.005, 0.6, 0.0, 0.5, False, "chance that a reading is not answered at all"),
        # ---- from task to task (`task_state`)
        "learning": Spread(
            *(0.15, 0.5, 0.0, 1.0, False),
            "pauses, looks, checks and errors in the n-th task go with n to the power of minus this",
            "form: Newell & Rosenbloom (1981), the power law of practice; the exponent is assumed",
            off=0.0,
        ),
        "fatigue": Spread(
            *(0.10, 0.5, 0.0, 1.0, False),
            "growth of the same in ten minutes of a trial, as a share; a break undoes it",
            off=0.0,
        ),
        "mood": Spread(
            *(0.40, 0.2, 0.0, 1.5, False),
            "sd over one person's tasks of the logarithm of pauses, looks and checks",
            "assumed; within people times vary about as much as between them (Salthouse & Berish 2005)",
            off=0.0,
        ),
        "mix_up": Spread(
            *(0.05, 0.7, 0.0, 1.0, False),
            "chance that a task begins towards the wrong side; seen after eight presses on average",
            "assumed; 15 % of people say they tell left from right badly (van der Ham et al. 2020)",
            off=0.0,
        ),
        "second_try": Spread(
            *(0.15, 0.3, 0.0, 0.6, True),
            "chance, on arriving, that it does not look right: one backs out and comes again",
            "assumed; what makes one person's tasks differ as much as the paper's do",
            off=0.0,
        ),
        "wrong_button": Spread(
            *(0.001, 0.5, 0.0, 0.1, False),
            "chance, per movement, that a gripper button is pressed instead",
            "a third of .003, for the wrong one of a group of labelled controls (Swain & Guttmann 1983)",
            off=0.0,
        ),
        "depth_error_m": Spread(
            *(0.02, 0.3, 0.0, 0.1, False),
            "sd over tasks of what one is off in judging how deep the arm is among the objects, metres",
            off=0.0,
        ),
        "lift_m": Spread(
            *(0.07, 0.3, 0.0, 0.12, True),
            "how much higher than needed a grasped object is lifted before it is pulled out, metres",
            off=0.0,
        ),
        "firmness": Spread(
            *(0.8, 0.1, 0.0, 1.0, False),
            "chance that, where the last press came to nothing or the arm undid it, one holds on the next time",
            off=0.0,
        ),
        # ---- what is in the hands
        "keyboard": Spread(
            *(0.0, 0.0, 0.0, 1.0, False),
            "share of people who drive with a keyboard; the others have a gamepad",
            "the paper's participants had a gamepad (IV-A)",
            off=0.0,
        ),
    }
)
"""Every trait that varies over people. Means marked as fitted are where the fit starts; see `fitted.json`."""

OFF: Mapping[str, float] = MappingProxyType(
    {name: trait.off for name, trait in TRAITS.items() if trait.off is not None}
)
"""Means that switch off what can be: people as they were before they learned, tired, and bumped into things."""


@dataclass(frozen=True)
class Traits:
    """One individual. Meaning and units of each field stand in `TRAITS`; the last four are drawn without a mean."""

    rationality: float
    habit: float
    two_axes: float
    slip: float
    look: float
    pause: float
    overshoot: float
    eye_error: float
    fine_m: float
    fine_pause: float
    tolerance_m: float
    checks: float
    reaction_s: float
    away_s: float
    return_s: float
    typing_error: float
    miss: float
    learning: float
    fatigue: float
    mood: float
    mix_up: float
    second_try: float
    wrong_button: float
    depth_error_m: float
    lift_m: float
    firmness: float
    keyboard: float
    axis_taste: tuple[float, float, float]
    """Preference for moving along x, y and z first; standard normal."""
    leniency: float
    """How much better than the average person this one rates a system, standard normal."""
    strain: float
    """How much more workload than the average person this one reports, standard normal."""
    device: Device = "gamepad"
    """What is in the hands."""


@dataclass(frozen=True)
class Population:
    """How traits are spread: `TRAITS` with some means replaced and all spreads scaled."""

    means: Mapping[str, float] = field(default_factory=dict)
    spread_scale: float = 1.0

    def __post_init__(self) -> None:
        for name, mean in self.means.items():
            if name not in TRAITS:
                raise LabError(f"no trait {name!r}; traits are {', '.join(TRAITS)}")
            low, high = TRAITS[name].low, TRAITS[name].high
            if not low <= mean <= high:
                raise LabError(f"trait {name} has mean {mean!r}; it must be from {low:g} to {high:g}")
        if not 0.0 <= self.spread_scale <= 5.0:
            raise LabError(f"spread_scale is {self.spread_scale!r}; it must be from 0 to 5")

    def mean(self, name: str) -> float:
        """Mean of a trait in this population."""
        return self.means.get(name, TRAITS[name].mean)


def draw_traits(population: Population, rng: np.random.Generator) -> Traits:
    """One individual of the population."""
    own = int(rng.spawn(1)[0].integers(2**63))
    drawn = {name: _drawn(name, population, _stream_of(name, own, rng)) for name in TRAITS}
    x, y, z = (float(value) for value in rng.standard_normal(3))
    leniency, strain = float(rng.standard_normal()), float(rng.standard_normal())
    chance = _stream_of("keyboard", own, rng).random()
    device: Device = "keyboard" if chance < drawn["keyboard"] else "gamepad"
    return Traits(**drawn, axis_taste=(x, y, z), leniency=leniency, strain=strain, device=device)


def _stream_of(name: str, own: int, rng: np.random.Generator) -> np.random.Generator:
    """The stream of one trait. The first traits share one; who came later has one by name, so that one trait more
    makes nobody else of anybody."""
    if TRAITS[name].off is None:
        return rng
    return np.random.default_rng(np.random.SeedSequence(own, spawn_key=(zlib.crc32(name.encode()),)))


def _drawn(name: str, population: Population, rng: np.random.Generator) -> float:
    trait = TRAITS[name]
    spread = trait.spread * population.spread_scale
    # The second term keeps the mean of the log-normal where it is said to be.
    value = population.mean(name) * float(np.exp(spread * rng.standard_normal() - spread * spread / 2.0))
    return min(max(value, trait.low), trait.high)


def stream(seed: int, purpose: Purpose, *key: int) -> np.random.Generator:
    """The random stream of one participant (by seed) for one purpose, and trial or alert if the purpose has them."""
    spawn_key = (_NO_TRIAL, _PURPOSES.index(purpose), *key)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=spawn_key))
