"""The comparison as text: what is printed, and the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.physics_comparison.closed_loop import OUTCOMES
from app.physics_comparison.comparing import Compared
from app.physics_comparison.equivalence import Equivalence
from app.physics_comparison.rule import hash_line, rule
from app.physics_comparison.words import blocked_rates, condition_of, interval, name_of, number, reasons, verdicts
from app.replication.formats import code, columns, percent
from app.simulated.study import setup_of

Row = tuple[str, ...]


def on_screen(compared: Compared) -> str:
    """What the command prints."""
    parts = [
        hash_line(),
        made_of(compared),
        "Up to first contact:\n" + paths_table(compared),
        "The same people on each:\n" + values_table(compared),
        "Blocked ticks, of a thousand control ticks:\n" + blocked_table(compared),
        *reasons(compared),
        *verdicts(compared),
    ]
    return "\n\n".join(parts)


def report(compared: Compared) -> str:
    """The whole report, Markdown."""
    parts = [
        f"# {' and '.join(compared.asked.robots)}: the same inputs, the same people",
        made_of(compared),
        "## Verdict",
        *verdicts(compared),
        "## The rule",
        f"{hash_line()}.",
        "\n".join(f"- {sentence}" for sentence in rule().sentences),
        "## Up to first contact",
        code(paths_table(compared)),
        PATHS_LEGEND,
        "## The same people on each",
        code(values_table(compared)),
        VALUES_LEGEND,
        "## Blocked ticks",
        code(blocked_table(compared)),
        "Of a thousand control ticks, by the reason that stands in the record.",
        "## What differs, and why",
        "\n".join(f"- {sentence}" for sentence in reasons(compared)),
    ]
    return "\n\n".join(parts) + "\n"


def made_of(compared: Compared) -> str:
    """Where the numbers are from."""
    asked, people = compared.asked, compared.asked.people
    study = setup_of(people.plan.study_text, people.plan.trust).study
    inputs = f"those of {asked.recorded} of these people on {compared.first}"
    if asked.export is not None:
        drove = ", ".join(asked.export.robots) or "a robot that the export does not name"
        inputs = f"{asked.export.people} people of {asked.export.folder.name}, who drove {drove}"
    return (
        f"{people.studies} x {people.participants} simulated people, seed {people.plan.seed}, on each of "
        f"{', '.join(asked.robots)}; layout {study.layout}, {study.robot.speed_m_s:g} m/s. Recorded inputs: {inputs}."
    )


PATHS_LEGEND = (
    "Distance between the grippers after every slice (1/30 s), angle after every tick, over the ticks in which every "
    "command is the same on both. behind: along the way, while the first one moves; beside: to its side (medians). "
    "same choices: of the ticks in which the arbiter chose by itself."
)


def paths_table(compared: Compared) -> str:
    """Paths beside the first robot's."""
    rows: list[Row] = [
        (
            "",
            "ticks",
            "apart mm, median",
            "99 %",
            "most",
            "behind",
            "beside",
            "turned deg, 99 %",
            "most",
            "same choices",
        )
    ]
    for one in compared.paths:
        millimetres = (one.apart_mm[50], one.apart_quantile_mm, one.apart_mm[100], one.behind_mm, one.beside_mm)
        rows.append(
            (
                f"{compared.first} - {one.robot}",
                str(one.ticks),
                *("" if value != value else f"{value:.2f}" for value in millimetres),
                *("" if value != value else f"{value:.3f}" for value in one.turned_deg[1:]),
                percent(one.same_share, 1),
            )
        )
    return columns(rows)


VALUES_LEGEND = (
    "Means over people's means (SD between people's means); difference = the other robot less the first, of the same "
    "person, with its 95 % interval. Below the conditions of a measure: the difference between two of them. What is "
    "held against the bound is the 90 % interval, as two one-sided tests at .05 ask. Outcomes, a task or an attempt: "
    + "; ".join(f"{name[0]} = {about}" for name, about in OUTCOMES.items())
    + "."
)


def values_table(compared: Compared) -> str:
    """Every measure, outcome and effect, robot beside robot."""
    rows: list[Row] = []
    for robot in compared.asked.robots[1:]:
        rows.append(("", "", compared.first, robot, "difference [95 %]", "bound", "verdict"))
        for one in compared.of(robot):
            rows += _rows(one)
    return columns(rows, ends_in_words=True)


def _rows(one: Equivalence) -> Iterator[Row]:
    bound = number(one.bound, one.measure)
    verdict = "" if one.verdict == "no bound" else one.verdict
    for place, level in enumerate(one.levels):
        head = (name_of(one), condition_of(level.condition))
        last = (bound, verdict) if place == 0 else ("", "")
        yield (*head, _mean(level.first, one), _mean(level.other, one), interval(level.difference, one.measure), *last)
    for effect in one.effects if one.bound == one.bound else ():
        means = (number(value, one.measure, sign=True) for value in (effect.first, effect.other))
        between = " - ".join(map(condition_of, effect.conditions))
        yield (name_of(one), between, *means, interval(effect.difference, one.measure), "", "")


def _mean(of: Sequence[float], one: Equivalence) -> str:
    mean, spread = of
    return (
        f"{number(mean, one.measure)} ({number(spread, one.measure)})"
        if spread == spread
        else number(mean, one.measure)
    )


def blocked_table(compared: Compared) -> str:
    """Blocked ticks by reason."""
    rows: list[Row] = [("", *compared.asked.robots)]
    rates = blocked_rates(compared)
    for why, of in rates.items():
        rows.append((why, *(f"{of[robot]:.2f}" for robot in compared.asked.robots)))
    totals = (sum(of[robot] for of in rates.values()) for robot in compared.asked.robots)
    rows.append(("all", *(f"{total:.2f}" for total in totals)))
    return columns(rows)
