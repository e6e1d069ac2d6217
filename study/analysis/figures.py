"""The figures of the report, as SVG and PNG: sizes in millimetres, the same bytes for the same data.

Every condition has a colour that colour-blind readers tell apart (Okabe and Ito), a marker of its own and a letter, so
that nothing hangs on colour. Text in SVG stays text.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from study.analysis.analysis import MEASURES, OBJECTIVE, Analysis, Comparison, GoalTrend
from study.analysis.effect_sizes import NotFitted
from study.analysis.heatmap import FloatArray, Heatmap, share_of_range
from study.analysis.measures import TaskKind
from study.analysis.observations import Observation
from study.records import TICK_S

MM = 1.0 / 25.4
PNG_DPI = 300
FULL_WIDTH_MM = 180.0
HEATMAP_NAME = "fig2_heatmaps"
MAX_LINES = 40
"""Participants up to which each one's conditions are joined by a line."""

_STYLE: dict[str, Any] = {
    "font.size": 7.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 7.0,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "legend.fontsize": 6.5,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "shared-autonomy-lab",
    "path.simplify": True,
}


@dataclass(frozen=True)
class Look:
    """How a condition is drawn."""

    colour: str
    marker: str
    letter: str
    name: str


_KNOWN_LOOKS = {
    "teleoperation": Look("#4D4D4D", "o", "T", "pure teleoperation"),
    "goal_oriented": Look("#0072B2", "s", "G", "goal-oriented"),
    "balanced": Look("#D55E00", "^", "B", "balanced"),
}
_SPARE_LOOKS = (("#009E73", "D"), ("#CC79A7", "v"), ("#56B4E9", "P"), ("#E69F00", "X"), ("#000000", "*"))


@dataclass(frozen=True)
class Picture:
    """One figure: its file name without ending, caption and drawing."""

    name: str
    title: str
    caption: str
    svg: str
    png: bytes
    table: str = ""
    """What is drawn, as CSV; empty where the report's tables have it."""

    def write(self, folder: Path, name: str | None = None) -> None:
        """`name`.svg and `name`.png, and `name`.csv if there is a table; the picture's own name if none is given."""
        name = self.name if name is None else name
        (folder / f"{name}.svg").write_text(self.svg, encoding="utf-8")
        (folder / f"{name}.png").write_bytes(self.png)
        if self.table:
            (folder / f"{name}.csv").write_text(self.table, encoding="utf-8")


def looks(conditions: Iterable[str]) -> dict[str, Look]:
    """A look for every condition: the paper's three always the same, others in turn."""
    found: dict[str, Look] = {}
    spare = iter(_SPARE_LOOKS * 3)
    for condition in conditions:
        if condition in _KNOWN_LOOKS:
            found[condition] = _KNOWN_LOOKS[condition]
        else:
            colour, marker = next(spare)
            taken = {look.letter for look in found.values()} | {look.letter for look in _KNOWN_LOOKS.values()}
            letters = [char.upper() for char in condition if char.isalnum() and char.upper() not in taken]
            letter = letters[0] if letters else str(len(found) + 1)
            found[condition] = Look(colour, marker, letter, condition.replace("_", " "))
    return found


def stars(p: float) -> str:
    """The paper's marks: * p < .05, ** .01, *** .001, **** .0001; nothing above."""
    return next((mark for bound, mark in ((1e-4, "****"), (1e-3, "***"), (1e-2, "**"), (0.05, "*")) if p < bound), "")


def draw_all(analysis: Analysis, heatmap: Heatmap | None) -> tuple[Picture, ...]:
    """Every figure that the data allow, in the order of the report."""
    pictures = [objective_figure(analysis), goals_figure(analysis)]
    if any(analysis.comparison(instrument) for instrument in ("sus_modified", "tlx_raw")):
        pictures.append(survey_figure(analysis))
    pictures.append(window_figure(analysis))
    if heatmap is not None:
        pictures.append(heatmap_figure(heatmap))
    return tuple(pictures)


# ---- the figures ----------------------------------------------------------------------------------------------------

_COMMON = (
    "Small marks: participants' means (lines join one participant's conditions); large marks: adjusted means of the "
    "conditions with their standard errors, as in the tables ({model}); where nothing could be fitted, the plain mean. "
    "Brackets: pairs of adjusted means that differ (Tukey), * p < .05, ** p < .01, *** p < .001, **** p < .0001."
)
_OVER_TASKS = _COMMON.format(model="position and goal as random covariates")
_WITHIN = _COMMON.format(model="within participants, over those with every condition")


def objective_figure(analysis: Analysis) -> Picture:
    """The paper's Fig. 3: gain (A), convergence (B), efficiency (C), for pickups and for all tasks."""
    with figure_of(FULL_WIDTH_MM, 74.0) as figure:
        axes = figure.subplots(1, 3)
        for letter, ax, measure in zip("ABC", axes, OBJECTIVE, strict=True):
            groups = [analysis.comparison(measure, kind) for kind in ("pickup", "all")]
            _draw_groups(ax, [g for g in groups if g], analysis.data.conditions, ["pickups", "all tasks"])
            _title(ax, letter, MEASURES[measure].title)
            ax.set_ylabel(_axis_label(measure))
        _legend(figure, analysis.data.conditions)
        svg, png = rendered(figure)
    return Picture(
        "fig3_objective_measures",
        "Objective measures",
        "(A) Belief accuracy gain at the first user action after a window in which entropy was above 0.7; (B) user "
        "actions until the instructed goal stayed the most likely, without tasks that never converged; (C) ticks "
        f"without gripper and reset ticks. Lower is better in B and C. {_OVER_TASKS} After the paper's Fig. 3.",
        svg,
        png,
    )


def goals_figure(analysis: Analysis) -> Picture:
    """The paper's Fig. 4: belief gain by the number of candidate goals."""
    conditions = analysis.data.conditions
    gains = analysis.comparison("belief_gain", "all")
    found = gains.observations if gains else ()
    counts = sorted({item.goals for item in found})
    with figure_of(FULL_WIDTH_MM, 62.0) as figure:
        axes = np.atleast_1d(figure.subplots(1, len(conditions), sharey=True))
        for ax, trend in zip(axes, analysis.trends, strict=True):
            _draw_trend(ax, trend, [item for item in found if item.condition == trend.condition], counts)
        people = [mean for count in counts for mean in _all_means([o for o in found if o.goals == count])] or [0.0]
        low, high = min(0.0, *people), max(0.0, *people)
        axes[0].set_ylim(low - 0.08 * (high - low or 1.0), high + 0.16 * (high - low or 1.0))
        axes[0].set_ylabel(_axis_label("belief_gain"))
        svg, png = rendered(figure)
    return Picture(
        "fig4_gain_by_goals",
        "Belief gain by number of candidate goals",
        "Belief accuracy gain after windows with entropy above 0.7, by the number of candidate goals of the task. "
        "Small marks: participants' means; large marks: plain mean over the n windows, as in the table, with its "
        "standard error (SD / √n, as if windows were independent). "
        "After the paper's Fig. 4.",
        svg,
        png,
    )


def survey_figure(analysis: Analysis) -> Picture:
    """Usability and workload."""
    names = [name for name in ("sus_modified", "tlx_raw") if analysis.comparison(name)]
    with figure_of(60.0 * len(names), 70.0) as figure:
        for ax, name in zip(np.atleast_1d(figure.subplots(1, len(names))), names, strict=True):
            comparison = analysis.comparison(name)
            assert comparison is not None
            _draw_groups(ax, [comparison], analysis.data.conditions, [""], scale=(1.0, 7.0))
            ax.set_yticks(range(1, 8))
            _title(ax, "", MEASURES[name].title)
            ax.set_ylabel(_axis_label(name))
        _legend(figure, analysis.data.conditions)
        svg, png = rendered(figure)
    return Picture(
        "fig5_surveys",
        "Survey scales",
        "Mean of all items on 1 to 7 after reversing. High usability is good, high workload is bad. " + _WITHIN,
        svg,
        png,
    )


def window_figure(analysis: Analysis) -> Picture:
    """Window rate, the paper's check that windows were equally frequent."""
    with figure_of(75.0, 70.0) as figure:
        ax = figure.subplots()
        groups = [analysis.comparison("window_rate", kind) for kind in ("pickup", "all")]
        _draw_groups(ax, [g for g in groups if g], analysis.data.conditions, ["pickups", "all tasks"])
        ax.set_ylim(bottom=0.0)
        _title(ax, "", MEASURES["window_rate"].title)
        ax.set_ylabel(_axis_label("window_rate"))
        _legend(figure, analysis.data.conditions)
        svg, png = rendered(figure)
    return Picture(
        "fig6_window_rate",
        "Window rate",
        "Windows of at least five ticks without input, divided by control ticks, per participant. " + _WITHIN,
        svg,
        png,
    )


def heatmap_figure(heatmap: Heatmap) -> Picture:
    """The paper's Fig. 2: information gain (A) and goal-oriented reward (B) over the table plane, by one colour scale.

    The colour is the share of a map's own range, in both; the ranges themselves stand below each map.
    """
    with figure_of(FULL_WIDTH_MM, 68.0) as figure:
        axes = figure.subplots(1, 2, sharey=True)
        panels = (
            ("A", "Expected information gain", heatmap.information, heatmap.information_weight_m, ""),
            ("B", "Goal-oriented reward", heatmap.reward, heatmap.reward_weight, " m"),
        )
        for ax, (letter, title, values, weight, unit) in zip(axes, panels, strict=True):
            mesh = _draw_map(ax, heatmap, share_of_range(values))
            low, high = float(np.nanmin(values)), float(np.nanmax(values))
            score = f"; in the score {low * weight:.2f} to {high * weight:.2f} m" if weight else ""
            ax.set_xlabel(f"y, left (m)\nrange {low:.2g} to {high:.2g}{unit}{score}")
            _title(ax, letter, title)
        axes[0].set_ylabel("x, forward (m)")
        bar = figure.colorbar(mesh, ax=axes, orientation="horizontal", shrink=0.5, aspect=45, pad=0.03)
        bar.set_label("share of the map's own range: 0 its lowest place, 1 its highest")
        bar.outline.set_linewidth(0.4)
        svg, png = rendered(figure)
    caption = f"{heatmap.caption} {heatmap.sentence()} After the paper's Fig. 2."
    return Picture(HEATMAP_NAME, "What each reward wants", caption, svg, png, heatmap.csv())


def _draw_map(ax: Axes, heatmap: Heatmap, shares: FloatArray) -> AxesImage:
    """One map with its goals; grey is where the arm cannot be."""
    edges = (heatmap.y_m[0], heatmap.y_m[-1], heatmap.x_m[0], heatmap.x_m[-1])
    ax.set_facecolor("#C9CCD0")
    mesh = ax.imshow(shares, cmap="cividis", extent=edges, origin="lower", vmin=0.0, vmax=1.0, interpolation="bilinear")
    levels = (0.25, 0.5, 0.75, 0.9)
    lines = ax.contour(heatmap.y_m, heatmap.x_m, shares, levels=levels, colors="white", linewidths=0.5)
    ax.clabel(lines, fmt=lambda level: f"{level:g}".lstrip("0"), fontsize=5.5)
    for goal in heatmap.goals:
        ax.plot(goal.y_m, goal.x_m, "o", ms=3.5, mfc="white", mec="black", mew=0.7)
        label = f"{goal.name} {goal.probability:.2f}".replace("0.", ".")
        box = {"boxstyle": "round,pad=0.18", "fc": "white", "ec": "#444444", "lw": 0.4, "alpha": 0.95}
        below = (0, -11) if goal.x_m > heatmap.x_m[-1] - 0.05 else (0, 6)
        ax.annotate(
            label,
            (goal.y_m, goal.x_m),
            below,
            textcoords="offset points",
            ha="center",
            fontsize=7.0,
            fontweight="bold",
            bbox=box,
            zorder=6,
        )
    x_m, y_m = heatmap.start_xy_m
    ax.plot(y_m, x_m, "x", ms=4.0, color="white", mew=1.0)
    ax.annotate("start", (y_m, x_m), (0, -9), textcoords="offset points", ha="center", color="white", fontsize=6.0)
    ax.invert_xaxis()
    ax.set_aspect("equal")
    return mesh


# ---- parts ----------------------------------------------------------------------------------------------------------


def _draw_groups(
    ax: Axes,
    groups: Sequence[Comparison],
    conditions: Sequence[str],
    group_names: Sequence[str],
    scale: tuple[float, float] | None = None,
) -> None:
    """Columns of every condition, group by group, with brackets over what differs."""
    look = looks(conditions)
    width = len(conditions) + 0.8
    means = [mean for g in groups for of in _person_means(g.observations).values() for mean in of.values()]
    for group in groups:
        if not isinstance(group.anova, NotFitted):
            means += [of.mean + end for of in group.anova.adjusted_means for end in (-of.se, of.se)]
    means = means or [0.0, 1.0]
    bottom, top = scale or (min(means), max(means))
    ticks, labels = [], []
    high = top
    for index, group in enumerate(groups):
        places = {condition: index * width + column for column, condition in enumerate(conditions)}
        _draw_people(ax, group.observations, places, look)
        _draw_adjusted(ax, group, places, look)
        ticks += list(places.values())
        labels += [look[condition].letter for condition in conditions]
        high = max(high, _draw_brackets(ax, group, places, top, (top - bottom) or 1.0))
        if group_names[index]:
            middle = index * width + (len(conditions) - 1) / 2.0
            ax.annotate(
                group_names[index],
                (middle, 0.0),
                (0, -17),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                ha="center",
                va="top",
            )
        if not group.observations:
            ax.text(index * width + (len(conditions) - 1) / 2.0, 0.5, "no values", ha="center")
    ax.set_xticks(ticks, labels)
    ax.set_xlim(-0.7, (len(groups) - 1) * width + len(conditions) - 0.3)
    margin = 0.05 * ((high - bottom) or 1.0)
    ax.set_ylim(bottom - margin, high + margin)


def _draw_people(
    ax: Axes, observations: Sequence[Observation], places: dict[str, float], look: dict[str, Look]
) -> None:
    people = _person_means(observations)
    names = sorted(people)
    many = len(names) > MAX_LINES
    shifts = np.linspace(-0.22, 0.22, len(names)) if len(names) > 1 else np.zeros(len(names))
    columns = {condition: np.array([people[name].get(condition, math.nan) for name in names]) for condition in places}
    if not many and names:
        for number, shift in enumerate(shifts):
            of = [(place + shift, columns[c][number]) for c, place in places.items() if c in people[names[number]]]
            ax.plot(*zip(*of, strict=True), color="#BBBBBB", lw=0.4, zorder=1)
    for condition, place in places.items():
        ax.plot(
            place + shifts,
            columns[condition],
            look[condition].marker,
            ms=1.2 if many else 2.2,
            mfc="none",
            mec=look[condition].colour,
            mew=0.4,
            alpha=0.35 if many else 0.8,
            zorder=2,
        )


def _draw_adjusted(ax: Axes, group: Comparison, places: dict[str, float], look: dict[str, Look]) -> None:
    """The adjusted mean of each condition with its standard error: the numbers that stand in the tables."""
    anova = group.anova
    means = {} if isinstance(anova, NotFitted) else {of.condition: (of.mean, of.se) for of in anova.adjusted_means}
    for condition, place in places.items():
        plain = group.summaries[condition].mean
        if condition in means:
            _draw_mean(ax, place, *means[condition], look[condition])
        elif plain is not None:
            _draw_mean(ax, place, plain, None, look[condition])


def _draw_mean(ax: Axes, place: float, mean: float, reach: float | None, look: Look) -> None:
    if reach is not None:
        ax.errorbar(place, mean, reach, color="black", lw=1.0, capsize=2.2, capthick=0.8, zorder=3)
    ax.plot(place, mean, look.marker, ms=5.0, mfc=look.colour, mec="black", mew=0.6, zorder=4)


def _draw_brackets(ax: Axes, group: Comparison, places: dict[str, float], top: float, extent: float) -> float:
    """Brackets over the pairs that differ; the height they reach."""
    height = top + 0.05 * extent
    for pair in sorted(group.pairs, key=lambda pair: abs(places[pair.first] - places[pair.second])):
        if mark := stars(pair.p):
            left, right = sorted((places[pair.first], places[pair.second]))
            tip = height + 0.02 * extent
            ax.plot([left, left, right, right], [height, tip, tip, height], color="black", lw=0.6, clip_on=False)
            ax.text((left + right) / 2.0, tip - 0.005 * extent, mark, ha="center", va="bottom", fontsize=6.5)
            height += 0.105 * extent
    return height


def _draw_trend(ax: Axes, trend: GoalTrend, found: Sequence[Observation], counts: Sequence[int]) -> None:
    look = looks([trend.condition])[trend.condition]
    means = []
    for count in counts:
        people = [of[trend.condition] for of in _person_means([o for o in found if o.goals == count]).values()]
        shifts = np.linspace(-0.2, 0.2, len(people)) if len(people) > 1 else np.zeros(len(people))
        many = len(people) > MAX_LINES
        style: dict[str, Any] = {"ms": 1.2 if many else 2.0, "mfc": "none", "mew": 0.4, "alpha": 0.35 if many else 0.7}
        ax.plot(count + shifts, people, look.marker, mec=look.colour, **style)
        windows = trend.by_goals.get(count)
        if windows is not None and windows.mean is not None:
            means.append((count, windows.mean))
            se = None if windows.sd is None else windows.sd / math.sqrt(windows.n)
            _draw_mean(ax, count, windows.mean, se, look)
        ax.annotate(
            f"n = {windows.n if windows else 0}",
            (count, 1.0),
            (0, -1),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=5.5,
            bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"},
            zorder=5,
        )
    if means:
        ax.plot(*zip(*means, strict=True), color=look.colour, lw=0.9, zorder=2.5)
    ax.axhline(0.0, color="#999999", lw=0.4, ls=(0, (4, 3)), zorder=0)
    ax.set_xticks(counts)
    ax.set_xlabel("candidate goals")
    _title(ax, look.letter, look.name)


def _person_means(observations: Iterable[Observation]) -> dict[str, dict[str, float]]:
    cells: dict[str, dict[str, list[float]]] = {}
    for item in observations:
        cells.setdefault(item.participant, {}).setdefault(item.condition, []).append(item.value)
    return {name: {key: math.fsum(of) / len(of) for key, of in by.items()} for name, by in cells.items()}


def _all_means(observations: Iterable[Observation]) -> list[float]:
    return [mean for of in _person_means(observations).values() for mean in of.values()]


def _title(ax: Axes, letter: str, title: str) -> None:
    ax.set_title(f"({letter}) {title}" if letter else title, loc="left", fontsize=7.5)


def _axis_label(measure: str) -> str:
    info = MEASURES[measure]
    return {
        "belief_gain": "gain in b(instructed goal)",
        "efficiency_ticks": f"task length (ticks of {TICK_S:g} s)",
    }.get(measure, info.unit)


def _legend(figure: Figure, conditions: Sequence[str]) -> None:
    """Below the figure, in as many columns as fit: conditions may have any names, and there may be any number."""
    look = looks(conditions)
    handles = [
        matplotlib.lines.Line2D([], [], ls="", marker=of.marker, ms=5.0, mfc=of.colour, mec="black", mew=0.6)
        for of in look.values()
    ]
    labels = [f"{of.letter}  {of.name}" for of in look.values()]
    widest_in = _LEGEND_MARK_IN + _LEGEND_SIGN_IN * max(map(len, labels))
    columns = max(1, min(len(labels), int(figure.get_figwidth() / widest_in)))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False)


_LEGEND_MARK_IN, _LEGEND_SIGN_IN = 0.35, 0.05
"""Room that a legend's entry takes: its mark with the gaps around it, and each sign of its name."""


@contextmanager
def figure_of(width_mm: float, height_mm: float) -> Iterator[Figure]:
    """An empty figure in the report's style."""
    settings: dict[Any, Any] = {**matplotlib.rcParamsDefault, **_STYLE}  # whose own type lists every key there is
    with matplotlib.rc_context(settings):
        yield Figure(figsize=(width_mm * MM, height_mm * MM), layout="constrained")


def rendered(figure: Figure, dpi: int = PNG_DPI) -> tuple[str, bytes]:
    """The figure as SVG and PNG."""
    layout = figure.get_layout_engine()
    assert layout is not None
    layout.execute(figure)
    figure.set_layout_engine("none")  # laid out once, not once for each file
    svg, png = io.StringIO(), io.BytesIO()
    figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
    figure.savefig(png, format="png", dpi=dpi, metadata={"Software": None})
    return svg.getvalue(), png.getvalue()


__all__ = ["Picture", "TaskKind", "draw_all", "looks", "stars"]
