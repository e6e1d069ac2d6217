"""The run as one figure: sessions against lateness, processor time, memory, and how long until something is on disk."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from app.sizing.rule import LATE_MS, Room, Step, Verdict, why_it_breaks
from study.analysis.figures import FULL_WIDTH_MM, Picture, figure_of, rendered

TITLE = "How many people this machine holds"
HEIGHT_MM = 120.0
GREY, ORANGE, BLUE, GREEN = "#4D4D4D", "#D55E00", "#0072B2", "#009E73"
SHOWS_FREE = 3.0
"""Free memory is drawn where it is less than so many times what the lab takes."""
LEAST_MS = 0.1
"""What is below stands on the floor of a logarithmic axis."""


def draw(steps: Sequence[Step], verdict: Verdict, room: Room) -> Picture:
    """Four panels over the same numbers of people; where the machine is full is shaded."""
    last_of = {step.sessions: step for step in steps}
    found = [last_of[sessions] for sessions in sorted(last_of)]
    with figure_of(FULL_WIDTH_MM, HEIGHT_MM) as figure:
        late, cores, memory, commits = figure.subplots(2, 2, sharex=True).ravel()
        _lines(late, found, ("median", lambda step: max(LEAST_MS, step.late_p50_ms), BLUE, "o", "-"),
               ("99th percentile", lambda step: max(LEAST_MS, step.late_p99_ms), ORANGE, "s", "--"))  # fmt: skip
        late.axhline(LATE_MS, color=GREY, linestyle=":")
        late.set_yscale("log")
        late.set_ylabel("tick begins late by (ms)")
        _lines(cores, found, ("sessions' processes", lambda step: step.worker_cores, ORANGE, "s", "--"),
               ("lab's own", lambda step: step.web_cores, BLUE, "o", "-"),
               ("scripted people", lambda step: step.people_cores, GREY, "D", ":"))  # fmt: skip
        cores.axhline(room.lab_cores, color=GREY, linestyle=":")
        cores.set_ylabel("processor time (cores)")
        _lines(memory, found, ("lab, in all", lambda step: step.lab_mb, BLUE, "o", "-"))
        if min(step.free_mb for step in found) < SHOWS_FREE * max(step.lab_mb for step in found):
            _lines(memory, found, ("free", lambda step: step.free_mb, GREY, "D", ":"))
        memory.set_ylabel("memory (MB)")
        _lines(commits, found, ("median", lambda step: step.commit_p50_ms, BLUE, "o", "-"),
               ("99th percentile", lambda step: step.commit_p99_ms, ORANGE, "s", "--"))  # fmt: skip
        commits.set_ylabel("until it is on disk (ms)")
        if verdict.capacity:
            late.plot([], [], color=GREEN, label=f"{verdict.capacity} are taken")
        for axes in (cores, memory, commits):
            axes.set_ylim(bottom=0.0)
        for letter, axes in zip("ABCD", (late, cores, memory, commits), strict=True):
            axes.set_title(letter, loc="left")
            axes.legend()
            _shade(axes, found, verdict)
        for axes in (memory, commits):
            axes.set_xlabel("people at once")
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            axes.set_xlim(left=0.0)
        svg, png = rendered(figure, dpi=150)
    return Picture(
        "sessions",
        TITLE,
        f"By number of people who drive at once: (A) how late ticks begin; dotted: {LATE_MS:g} ms. (B) Processor time "
        "in cores; dotted: what the lab has. (C) Memory. (D) From what happened to its being on disk. Shaded: steps "
        "that did not hold; the upright line is how many are taken.",
        svg,
        png,
    )


Curve = tuple[str, Callable[[Step], float], str, str, str]


def _lines(axes: Axes, steps: Sequence[Step], *curves: Curve) -> None:
    at = [step.sessions for step in steps]
    for label, of, colour, marker, style in curves:
        axes.plot(at, [of(step) for step in steps], color=colour, marker=marker, linestyle=style, label=label)


def _shade(axes: Axes, steps: Sequence[Step], verdict: Verdict) -> None:
    if verdict.capacity:
        axes.axvline(verdict.capacity, color=GREEN)
    broken = [step.sessions for step in steps if why_it_breaks(step)]
    if broken:
        low = (max((one.sessions for one in steps if one.sessions < broken[0]), default=0) + broken[0]) / 2
        axes.axvspan(low, broken[-1] + (broken[0] - low), color=GREY, alpha=0.12, linewidth=0)
