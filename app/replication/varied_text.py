"""What the report says of things that were changed: why a comparison misses its aim, and what each variation moves."""

from __future__ import annotations

from collections.abc import Sequence

from app.replication.ceiling import ceiling
from app.replication.comparisons import Share
from app.replication.formats import code, columns, name_of, number, percent
from app.replication.paper import CIRCULAR, Claim
from app.replication.reasons import MOVED, missed, noise, reason_line, spread_of
from app.replication.replicate import STUDIES_FOR_REASONS, Replication, Varied


def reasons_section(result: Replication) -> list[str]:
    """Every comparison that misses its aim, with the experiments."""
    off = missed(result.shares)
    parts = ["## Why comparisons miss their aim"]
    if not off:
        return [*parts, "None does."]
    if not result.vary:
        return [*parts, f"{len(off)} do. Without --vary no experiment was made that could tell why."]
    ours = spread_of(result.studies)
    lines = [reason_line(share, result.experiments, ours) for share in off]
    counts = "; ".join(f"{one.name}: {one.studies}" for one in result.experiments)
    return [*parts, _ABOUT, f"Studies in each experiment: {counts}.", "\n".join(lines)]


_ABOUT = (
    "Each experiment changes one thing and tests the same comparison again. *The paper's SD*: our values, as far from "
    "their mean as the paper's standard deviation has it. *The paper's means*: our values around the paper's means; "
    "then both. "
    "*No covariates*, *fixed covariates*: the same values in another model. *Twice the people*: two studies joined. "
    "The others are simulated anew, with alpha at a third or three times its value, or without differences between "
    "people; their shares stand beside those of the same studies unchanged. What reaches the aim alone is a reason "
    "that is enough, not the only one."
)


def varied_section(result: Replication) -> list[str]:
    """One thing at a time: what each variation does to every comparison."""
    if not result.varied:
        return []
    parts = [
        "## One thing at a time",
        f"Each variation changes one thing in the simulation and runs the first {result.vary} studies again "
        f"({STUDIES_FOR_REASONS} where it is an experiment above), with the same people; everything else, alpha's "
        "calibration included, follows. It is held against the same studies unchanged: a share moves when it changes "
        f"by more than {MOVED:.0%} and twice its standard error. Nothing was tuned by these.",
    ]
    rows = ceiling().rows
    own = [item for item in result.shares if item.claim.measure not in CIRCULAR]
    for title, items in (
        ("Comparisons that missed their aim", [item for item in own if not rows[item.claim].met_by(item)]),
        ("Comparisons that met it", [item for item in own if rows[item.claim].met_by(item)]),
    ):
        lines = [f"### {title}"]
        for item in items:
            moved = [text for one in result.varied if (text := _moves(item.claim, one))]
            lines.append(
                f"- **{name_of(item.claim)}** (sign {percent(item.same_sign)}, p<.05 {percent(item.significant)}, "
                f"difference {number(item.mean, item.claim.measure)}, "
                f"paper {number(item.claim.paper_difference, item.claim.measure)}): "
                + ("; ".join(moved) if moved else "no variation moves it")
                + "."
            )
        parts.append("\n".join([lines[0], "", *lines[1:]]) if items else f"{lines[0]}\n\nNone.")
    parts += ["### Mean differences under each variation", code(_differences_table(result))]
    return parts


def _same(claim: Claim, of: Sequence[Share]) -> Share:
    return next(share for share in of if share.claim == claim)


def _moves(claim: Claim, one: Varied) -> str | None:
    """What a variation does to a comparison, if that is more than chance."""
    before, after = _same(claim, one.before), _same(claim, one.after)
    told = [
        f"{word} {percent(was)} to {percent(is_)}"
        for word, was, is_ in (
            ("sign", before.same_sign, after.same_sign),
            ("p<.05", before.significant, after.significant),
        )
        if abs(is_ - was) > noise(was, one.studies)
    ]
    if not told:
        return None
    numbers = (number(share.mean, claim.measure) for share in (before, after))
    return f"{one.variation.name}: {', '.join(told)} (difference {' to '.join(numbers)})"


def _differences_table(result: Replication) -> str:
    own = [item for item in result.shares if item.claim.measure not in CIRCULAR]
    head = ("varied", *(f"{_CODES[item.claim.measure]}{item.claim.kind[0]}:{_pair(item.claim)}" for item in own))
    rows: list[tuple[str, ...]] = [
        head,
        ("paper", *(number(item.claim.paper_difference, item.claim.measure) for item in own)),
    ]
    unchanged = min(result.varied, key=lambda one: one.studies).before
    for name, of in (("nothing", unchanged), *((one.variation.name, one.after) for one in result.varied)):
        rows.append((name, *(number(_same(item.claim, of).mean, item.claim.measure) for item in own)))
    legend = (
        "G gain, C convergence, E efficiency, W window rate; p pickups, a all tasks;\n"
        "B balanced, O goal-oriented, T teleoperation."
    )
    return columns(rows) + "\n" + legend


_CODES = {"belief_gain": "G", "convergence_user_actions": "C", "efficiency_ticks": "E", "window_rate": "W"}


def _pair(claim: Claim) -> str:
    letters = {"teleoperation": "T", "goal_oriented": "O", "balanced": "B"}
    return f"{letters[claim.first]}-{letters[claim.second]}"
