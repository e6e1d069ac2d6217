"""What the paper reports, number by number (IV-C and V-C): what a simulation is held against."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["different", "same"]
TELEOPERATION, GOAL_ORIENTED, BALANCED = "teleoperation", "goal_oriented", "balanced"
CONDITIONS_IN_ORDER = (TELEOPERATION, GOAL_ORIENTED, BALANCED)


@dataclass(frozen=True)
class Reported:
    """Mean and standard deviation of a measure under the three conditions; None where the paper gives none."""

    measure: str
    kind: Literal["pickup", "all"]
    means: dict[str, float]
    sds: dict[str, float]


@dataclass(frozen=True)
class Tested:
    """The F test of the condition that the paper reports for a measure: F(2, `df_error`)."""

    measure: str
    kind: Literal["pickup", "all"]
    df_error: int
    f: float | None
    """None = not reported."""


@dataclass(frozen=True)
class Claim:
    """One comparison: `first` less `second` is `sign` (+1, -1), significant at .05, or no difference was found.

    `margin` is ours: differences smaller than this count as none. For efficiency, convergence and window rate a tenth
    of the paper's pure teleoperation, for belief gain 0.005 (the paper's smallest significant difference is 0.008), for
    scales half a point.
    """

    measure: str
    kind: Literal["pickup", "all"]
    first: str
    second: str
    verdict: Verdict
    sign: int = 0
    margin: float = 0.0

    @property
    def paper_difference(self) -> float:
        """The difference of the paper's means."""
        of = reported(self.measure, self.kind).means
        return of[self.first] - of[self.second]


def _reported(
    measure: str,
    kind: Literal["pickup", "all"],
    teleoperation: tuple[float, float],
    goal_oriented: tuple[float, float],
    balanced: tuple[float, float],
) -> Reported:
    values = {TELEOPERATION: teleoperation, GOAL_ORIENTED: goal_oriented, BALANCED: balanced}
    return Reported(
        measure,
        kind,
        {name: mean for name, (mean, _) in values.items()},
        {name: sd for name, (_, sd) in values.items()},
    )


REPORTED: tuple[Reported, ...] = (
    _reported("belief_gain", "pickup", (0.005, 0.004), (0.007, 0.005), (0.018, 0.017)),
    _reported("belief_gain", "all", (0.003, 0.005), (0.011, 0.017), (0.013, 0.023)),
    _reported("convergence_user_actions", "pickup", (26.22, 26.09), (13.14, 15.15), (9.53, 13.48)),
    _reported("convergence_user_actions", "all", (24.11, 24.07), (10.64, 13.17), (14.85, 19.13)),
    _reported("efficiency_ticks", "pickup", (147.7, 76.08), (104.9, 46.91), (122.0, 52.08)),
    _reported("efficiency_ticks", "all", (137.8, 71.75), (91.79, 47.06), (117.2, 53.61)),
    _reported("window_rate", "all", (0.025, 0.002), (0.025, 0.004), (0.025, 0.002)),
    _reported("sus_modified", "all", (5.38, 1.04), (5.18, 1.16), (4.33, 1.02)),
    _reported("tlx_raw", "all", (3.07, 1.29), (3.04, 1.14), (3.67, 1.74)),
)

TESTS: tuple[Tested, ...] = (
    Tested("belief_gain", "pickup", 105, 16.57),
    Tested("belief_gain", "all", 244, 7.72),
    Tested("convergence_user_actions", "pickup", 87, 9.52),
    Tested("convergence_user_actions", "all", 174, 13.22),
    Tested("efficiency_ticks", "pickup", 88, 20.61),
    Tested("efficiency_ticks", "all", 181, 40.33),
    Tested("window_rate", "all", 22, None),
    Tested("sus_modified", "all", 22, 8.21),
    Tested("tlx_raw", "all", 22, 5.60),
)
"""In the order of `REPORTED`. Twelve people under three conditions have F(2, 22) where each gives one value."""
PARTICIPANTS = 12

CLAIMS: tuple[Claim, ...] = (
    Claim("belief_gain", "pickup", BALANCED, GOAL_ORIENTED, "different", +1),
    Claim("belief_gain", "pickup", BALANCED, TELEOPERATION, "different", +1),
    Claim("belief_gain", "pickup", GOAL_ORIENTED, TELEOPERATION, "same", +1, 0.005),
    Claim("belief_gain", "all", BALANCED, TELEOPERATION, "different", +1),
    Claim("belief_gain", "all", GOAL_ORIENTED, TELEOPERATION, "different", +1),
    Claim("belief_gain", "all", BALANCED, GOAL_ORIENTED, "same", +1, 0.005),
    Claim("convergence_user_actions", "pickup", BALANCED, TELEOPERATION, "different", -1),
    Claim("convergence_user_actions", "pickup", GOAL_ORIENTED, TELEOPERATION, "different", -1),
    Claim("convergence_user_actions", "pickup", BALANCED, GOAL_ORIENTED, "same", -1, 2.6),
    Claim("convergence_user_actions", "all", BALANCED, TELEOPERATION, "different", -1),
    Claim("convergence_user_actions", "all", GOAL_ORIENTED, TELEOPERATION, "different", -1),
    Claim("convergence_user_actions", "all", BALANCED, GOAL_ORIENTED, "same", +1, 2.4),
    Claim("efficiency_ticks", "pickup", BALANCED, TELEOPERATION, "different", -1),
    Claim("efficiency_ticks", "pickup", GOAL_ORIENTED, TELEOPERATION, "different", -1),
    Claim("efficiency_ticks", "pickup", BALANCED, GOAL_ORIENTED, "same", +1, 14.8),
    Claim("efficiency_ticks", "all", BALANCED, TELEOPERATION, "different", -1),
    Claim("efficiency_ticks", "all", GOAL_ORIENTED, TELEOPERATION, "different", -1),
    Claim("efficiency_ticks", "all", BALANCED, GOAL_ORIENTED, "different", +1),
    Claim("window_rate", "all", GOAL_ORIENTED, TELEOPERATION, "same", 0, 0.0025),
    Claim("window_rate", "all", BALANCED, TELEOPERATION, "same", 0, 0.0025),
    Claim("window_rate", "all", BALANCED, GOAL_ORIENTED, "same", 0, 0.0025),
    Claim("sus_modified", "all", BALANCED, GOAL_ORIENTED, "different", -1),
    Claim("sus_modified", "all", BALANCED, TELEOPERATION, "different", -1),
    Claim("sus_modified", "all", GOAL_ORIENTED, TELEOPERATION, "same", -1, 0.5),
    Claim("tlx_raw", "all", BALANCED, GOAL_ORIENTED, "different", +1),
    Claim("tlx_raw", "all", BALANCED, TELEOPERATION, "different", +1),
    Claim("tlx_raw", "all", GOAL_ORIENTED, TELEOPERATION, "same", -1, 0.5),
)

CIRCULAR = ("sus_modified", "tlx_raw")
"""Measures that the simulation's model assumes rather than predicts; see `app.simulated.answers`."""

DIFFERENCES: tuple[Claim, ...] = tuple(c for c in CLAIMS if c.verdict == "different" and c.measure not in CIRCULAR)
"""The thirteen differences that the paper found in what it measured of the robot and the tasks."""

UNCERTAIN_WINDOWS = {"pickup": 108, "all": 247}
"""How many windows had entropy above 0.7, all conditions together, at least: error degrees of freedom and 3. Of about
337 and 624 windows in all (ticks times rate)."""


def reported(measure: str, kind: str) -> Reported:
    """The paper's numbers for one measure."""
    return next(item for item in REPORTED if (item.measure, item.kind) == (measure, kind))
