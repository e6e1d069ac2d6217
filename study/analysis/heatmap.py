"""The values of the paper's Fig. 2, what they say of places near the likely goals, and the table of them.

Whoever knows the arbiter works them out (`app.report.figure2`); `study.analysis.figures` draws them.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

NEAR_M = 0.10
"""Places up to here from a goal are near it: about two thirds of the way to the next one."""
MATTERS = 0.05
"""A difference of so much of a map's range is called one: a twentieth can be seen in the colour."""
TOP = 0.10
"""The best places are so much of all."""

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class HeatmapGoal:
    """A candidate goal on the table plane."""

    name: str
    x_m: float
    y_m: float
    probability: float


@dataclass(frozen=True)
class Heatmap:
    """Values over a plane, (len(x_m), len(y_m)); NaN where the arm cannot be.

    `information` is in units of log |goals|, `reward` in metres.
    """

    x_m: FloatArray
    y_m: FloatArray
    information: FloatArray
    reward: FloatArray
    goals: tuple[HeatmapGoal, ...]
    start_xy_m: tuple[float, float]
    """What `reward` is counted from."""
    information_weight_m: float
    """alpha f1(H): metres of score for each unit of `information`. 0 for an arbiter that looks for none."""
    reward_weight: float
    """beta f2(H)."""
    caption: str
    """What was computed, with every parameter."""

    def sentence(self) -> str:
        """What the two maps say of places near the likely goals, beside what the paper's text says."""
        a, b = nearness(self, self.information), nearness(self, self.reward)
        return (
            "The paper's text: both reward states closer to the likelier goals, B much more aggressively. Here, as a "
            f"share of each map's own range: within {NEAR_M:g} m of a likely goal {a.likely:.2f} in A and "
            f"{b.likely:.2f} in B on average, within {NEAR_M:g} m of another goal only {a.other:.2f} and "
            f"{b.other:.2f}, everywhere {a.everywhere:.2f} and {b.everywhere:.2f}. Of the best tenth of the places "
            f"{a.best_near:.0%} in A and {b.best_near:.0%} in B are within {NEAR_M:g} m of a likely goal, of all "
            f"places {a.all_near:.0%}. "
            f"{_verdict(a, b)}"
        )

    def rows(self) -> Iterator[tuple[float, ...]]:
        """One for each place where the arm can be, as `COLUMNS`."""
        shares = [share_of_range(values) for values in (self.information, self.reward)]
        for row, x_m in enumerate(self.x_m):
            for column, y_m in enumerate(self.y_m):
                information, reward_m = self.information[row, column], self.reward[row, column]
                if np.isfinite(information):
                    yield (
                        *(round(float(value), 4) for value in (x_m, y_m)),
                        *(float(f"{value:.6g}") for value in (information, reward_m)),
                        float(f"{information * self.information_weight_m:.6g}"),
                        float(f"{reward_m * self.reward_weight:.6g}"),
                        *(round(float(each[row, column]), 4) for each in shares),
                    )

    def csv(self) -> str:
        """The table, with a header."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(self.rows())
        return text.getvalue()


COLUMNS = (
    "x_m",
    "y_m",
    "information",
    "reward_m",
    "weighted_information_m",
    "weighted_reward_m",
    "information_share",
    "reward_share",
)
"""Of the table: a place, both values, both as they enter the score, and both as shares of their map's range."""


@dataclass(frozen=True)
class Nearness:
    """Means of one map, as shares of its range, and where its best places are."""

    likely: float
    """Within `NEAR_M` of a likely goal."""
    other: float
    """Within `NEAR_M` of another goal and of no likely one; NaN where there is none."""
    everywhere: float
    best_near: float
    """The part of the best `TOP` of the places that is within `NEAR_M` of a likely goal."""
    all_near: float
    """The part of all places that is."""


def share_of_range(values: FloatArray) -> FloatArray:
    """(value - lowest) / (highest - lowest), the rule of both colour scales; a flat map is 0 everywhere."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    shares: FloatArray = (values - low) / ((high - low) or 1.0)
    return shares


def nearness(heatmap: Heatmap, values: FloatArray) -> Nearness:
    """Of one of the maps. Likely is a goal with the highest probability there is."""
    most = max(goal.probability for goal in heatmap.goals)
    away_m = {True: np.full(values.shape, np.inf), False: np.full(values.shape, np.inf)}
    for goal in heatmap.goals:
        likely = goal.probability >= most - 1e-9
        here_m = np.hypot(heatmap.x_m[:, None] - goal.x_m, heatmap.y_m[None, :] - goal.y_m)
        away_m[likely] = np.minimum(away_m[likely], here_m)
    fits = np.isfinite(values)
    shares = share_of_range(values)
    near = fits & (away_m[True] <= NEAR_M)
    other = fits & ~near & (away_m[False] <= NEAR_M)
    best = fits & (np.nan_to_num(shares, nan=-1.0) >= np.quantile(shares[fits], 1.0 - TOP))
    return Nearness(
        likely=_mean(shares[near]),
        other=_mean(shares[other]),
        everywhere=_mean(shares[fits]),
        best_near=float((best & near).sum() / best.sum()),
        all_near=float(near.sum() / fits.sum()),
    )


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if values.size else float("nan")


def _verdict(a: Nearness, b: Nearness) -> str:
    """In words, from the numbers: which half of the paper's sentence the equations give here."""
    if not (np.isfinite(a.other) and np.isfinite(b.other)):
        return "All goals are equally likely."
    pulls = {"A": a.likely - a.other, "B": b.likely - b.other}
    told = {
        name: f"{name} {'favours' if pull >= MATTERS else 'does not favour'} likely goals over the others ({pull:+.2f})"
        for name, pull in pulls.items()
    }
    above = {"A": a.likely - a.everywhere, "B": b.likely - b.everywhere}
    raised = " and ".join(f"{gain:+.2f} in {name}" for name, gain in above.items())
    return f"So {told['A']}, {told['B']}; near a likely goal both differ from everywhere by {raised}."
