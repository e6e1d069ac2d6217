"""The comparison as one figure: paths, differences by their bounds, outcomes, and what blocks the arm."""

from __future__ import annotations

from itertools import cycle
from textwrap import shorten
from typing import NamedTuple

from matplotlib.axes import Axes

from app.physics_comparison.closed_loop import OUTCOMES
from app.physics_comparison.comparing import Compared
from app.physics_comparison.rule import rule
from app.physics_comparison.words import blocked_rates, condition_of, name_of
from study.analysis.figures import FULL_WIDTH_MM, Picture, figure_of, rendered

NAME = "comparison"
MOST_REASONS = 6
MOST_BOUNDS = 5.0
"""What is farther out is cut off."""


class Look(NamedTuple):
    """How a robot is drawn: nothing hangs on colour alone."""

    colour: str
    marker: str
    line: str


_LOOKS = (
    Look("#4D4D4D", "o", "-"),
    Look("#D55E00", "s", "--"),
    Look("#0072B2", "^", ":"),
    Look("#009E73", "D", "-."),
    Look("#CC79A7", "v", "-"),
)


def draw(compared: Compared) -> Picture:
    """Four panels; the first robot is grey."""
    looks = dict(zip(compared.asked.robots, cycle(_LOOKS), strict=False))
    measured = [one for one in compared.equivalences if one.bound == one.bound and one.key not in OUTCOMES]
    lines = max(1, sum(len(one.levels) + len(one.effects) for one in measured if one.robot == compared.asked.robots[1]))
    with figure_of(FULL_WIDTH_MM, 55.0 + 3.4 * lines) as figure:
        grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.1))
        paths, outcomes, blocked = (figure.add_subplot(grid[row, 0]) for row in range(3))
        _paths(paths, compared, looks)
        _outcomes(outcomes, compared, looks)
        _blocked(blocked, compared, looks)
        _differences(figure.add_subplot(grid[:, 1]), compared, looks)
        svg, png = rendered(figure, dpi=110)
    return Picture(
        NAME,
        "The same inputs and people on each robot",
        f"(A) Share of moments up to first contact in which the gripper is within so many millimetres of "
        f"{compared.first}'s; dotted: the rule's bound. (B) Outcomes, means over people with 95 % intervals. (C) Ticks "
        "in which the arm was asked to move and did not, by reason. (D) Differences by their bounds with 90 % "
        "intervals: in the band as a whole = shown to be within.",
        svg,
        png,
    )


def _title(ax: Axes, letter: str, text: str) -> None:
    ax.set_title(f"{letter}  {text}", loc="left")


def _paths(ax: Axes, compared: Compared, looks: dict[str, Look]) -> None:
    for one in compared.paths:
        look = looks[one.robot]
        apart_mm = [max(value, 1e-3) for value in one.apart_mm]
        ax.plot(apart_mm, range(101), color=look.colour, linestyle=look.line, label=one.robot)
    ax.axvline(rule().apart_mm, color="#888888", linestyle=":", linewidth=0.8)
    ax.set_xscale("log")
    ax.set_xlabel(f"distance from {compared.first}'s gripper (mm)")
    ax.set_ylabel("% of moments")
    _title(ax, "A", "Up to first contact")
    if compared.paths:
        ax.legend(frameon=False, loc="upper left")


def _outcomes(ax: Axes, compared: Compared, looks: dict[str, Look]) -> None:
    robots = compared.asked.robots
    for row, key in enumerate(OUTCOMES):
        for place, robot in enumerate(robots):
            observed = compared.values[robot].observations[key]
            people = {one.participant for one in observed}
            means = [_mean([one.value for one in observed if one.participant == who]) for who in sorted(people)]
            middle = _mean(means)
            reach = 1.96 * (_mean([(value - middle) ** 2 for value in means]) / max(len(means) - 1, 1)) ** 0.5
            look = looks[robot]
            y = -row + 0.22 * ((len(robots) - 1) / 2.0 - place)
            ax.errorbar(middle, y, xerr=reach, color=look.colour, marker=look.marker, markersize=3.5, linewidth=0.8)
    ax.set_yticks(
        [-row for row in range(len(OUTCOMES))], [name.replace("pushed", "pushed aside") for name, _ in OUTCOMES]
    )
    ax.set_xlabel("a task, an attempt")
    ax.set_xlim(-0.02, 1.02)
    _title(ax, "B", "Outcomes")
    for robot in robots:
        ax.plot(
            [], [], color=looks[robot].colour, marker=looks[robot].marker, markersize=3.5, linestyle="", label=robot
        )
    ax.legend(frameon=False, loc="center", fontsize=6.0)


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else float("nan")


def _blocked(ax: Axes, compared: Compared, looks: dict[str, Look]) -> None:
    robots, rates = compared.asked.robots, list(blocked_rates(compared).items())[:MOST_REASONS]
    height = min(0.8, 0.25 * len(robots)) / len(robots)
    for place, robot in enumerate(robots):
        at = [-row - height * (place - (len(robots) - 1) / 2.0) for row in range(len(rates))]
        ax.barh(at, [of[robot] for _, of in rates], height, color=looks[robot].colour, label=robot)
    ax.set_yticks([-row for row in range(len(rates))], [shorten(why, 34, placeholder="…") for why, _ in rates])
    ax.set_ylim(0.5 - max(len(rates), 3), 0.5)
    ax.set_xlabel("of 1,000 control ticks")
    _title(ax, "C", "Blocked")


def _differences(ax: Axes, compared: Compared, looks: dict[str, Look]) -> None:
    others = compared.asked.robots[1:]
    labels: dict[str, float] = {}
    y = 0.0
    for number, one in enumerate(compared.of(others[0])):
        if one.bound != one.bound or one.key in OUTCOMES or one.bound == 0.0:
            continue
        if number:
            y -= 0.6
        same = [found for found in compared.equivalences if found.key == one.key]
        places = [(condition_of(level.condition), [of.levels[at].difference for of in same])
                  for at, level in enumerate(one.levels)]  # fmt: skip
        places += [(" - ".join(map(condition_of, effect.conditions)), [of.effects[at].difference for of in same])
                   for at, effect in enumerate(one.effects)]  # fmt: skip
        for name, differences in places:
            for place, (of, found) in enumerate(zip(same, differences, strict=True)):
                look = looks[of.robot]
                ax.errorbar(
                    found.mean / of.bound,
                    y + 0.3 * ((len(same) - 1) / 2.0 - place),
                    xerr=found.reach(1.0 - 2.0 * rule().alpha) / of.bound,
                    color=look.colour,
                    marker=look.marker,
                    markersize=2.5,
                    linewidth=0.8,
                )
            labels[f"{name_of(one)}: {name}"] = y
            y -= 1.0
    ax.axvspan(-1.0, 1.0, color="#E8F1EA", zorder=0)
    ax.axvline(0.0, color="#888888", linewidth=0.5)
    ax.set_yticks(list(labels.values()), list(labels), fontsize=5.5)
    ax.set_ylim(y + 0.3, 0.8)
    low, high = ax.get_xlim()
    ax.set_xlim(max(low, -MOST_BOUNDS), min(high, MOST_BOUNDS))
    ax.set_xlabel(f"difference from {compared.first}, in bounds")
    _title(ax, "D", "Differences and effects")


__all__ = ["NAME", "draw"]
