"""What the numbers say, in sentences: what differs and why, and on what data of the first robot stay usable."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.physics_comparison.choices import WHYS
from app.physics_comparison.closed_loop import CONTROL, OUTCOMES, REFUSED
from app.physics_comparison.comparing import Compared
from app.physics_comparison.equivalence import EVERY, Difference, Equivalence, Verdict
from app.physics_comparison.open_loop import ENDS, Paths
from app.physics_comparison.rule import Rule, rule
from app.replication.formats import CONDITION_NAMES, MEASURE_NAMES, percent
from app.simulated.study import setup_of

NAMES = {
    **MEASURE_NAMES,
    "efficiency_ticks": "ticks",
    "picked": "picked up",
    "delivered": "delivered",
    "dropped": "dropped",
    "pushed": "pushed aside",
    "blocked_ticks": "blocked ticks",
}
_DECIMALS = {"belief_gain": 4, "window_rate": 4, "picked": 3, "delivered": 3, "dropped": 3, "pushed": 3}
_A_TICK_EVERY = 1000


def name_of(one: Equivalence) -> str:
    """A measure or an outcome in a few words."""
    name = NAMES.get(one.measure, one.measure)
    return name if one.key in OUTCOMES or one.kind == "all" else f"{name} {one.kind}"


def condition_of(condition: str) -> str:
    """A condition in a word."""
    return "all" if condition == EVERY else CONDITION_NAMES.get(condition, condition)


def number(value: float, measure: str, sign: bool = False) -> str:
    """A value with the decimals of its measure; nothing for what is not known."""
    return "" if value != value else f"{value:{'+' if sign else ''}.{_DECIMALS.get(measure, 1)}f}"


def interval(found: Difference, measure: str) -> str:
    """A difference with its 95 % interval."""
    if found.error != found.error:
        return number(found.mean, measure, sign=True)
    low, high = (number(found.mean + side * found.reach(0.95), measure, sign=True) for side in (-1.0, 1.0))
    return f"{number(found.mean, measure, sign=True)} [{low}, {high}]"


# ---- the verdict ----------------------------------------------------------------------------------------------------


def first_verdict(paths: Paths, by: Rule) -> str:
    """What the rule says of the way up to first contact."""
    near = paths.apart_quantile_mm <= by.apart_mm and paths.turned_deg[1] <= by.turned_deg
    told = "paths agree" if near else "paths do not agree"
    if paths.same_share != paths.same_share:
        return f"{told}; the arbiter made no choice by itself"
    if paths.same_share >= by.same_choices:
        return f"{told}, and so do decisions"
    same, least = percent(paths.same_share, 1), percent(by.same_choices)
    return f"{told}, decisions do not ({same} are the same, the rule asks for {least})"


def verdicts(compared: Compared) -> list[str]:
    """A paragraph for each robot beside the first."""
    by = rule()
    return [" ".join(_verdict(compared, paths, by)) for paths in compared.paths]


def _verdict(compared: Compared, paths: Paths, by: Rule) -> Iterator[str]:
    first, other, rows = compared.first, paths.robot, compared.of(paths.robot)

    def named(verdict: Verdict) -> list[Equivalence]:
        return [one for one in rows if one.verdict == verdict]

    def list_of(found: Sequence[Equivalence]) -> str:
        return ", ".join(name_of(one) for one in found)

    yield f"{first} and {other}: up to first contact {first_verdict(paths, by)}."
    usable, carried = named("interchangeable"), named("effects carry over")
    differing, open_ = named("differs"), named("not shown")
    if not differing and not open_ and not carried:
        yield f"Data taken on {first} stay usable on {other}, for everything that was compared."
    elif usable:
        yield f"Data taken on {first} stay usable on {other} for: {list_of(usable)}."
    else:
        yield f"For no measure is it shown that data taken on {first} stay usable on {other}."
    if carried:
        yield (
            f"Differences between conditions carry over, but values of the two must not be mixed, for: "
            f"{list_of(carried)}."
        )
    if differing:
        yield f"Data do not stay usable for: {list_of(differing)}."
    if open_:
        told = (f"{name_of(one)} ({_people(one.people_needed)})" for one in open_)
        yield f"Not shown either way with {compared.asked.people.number} people: {', '.join(told)}."


def _people(needed: float) -> str:
    if needed != needed:
        return "no spread is known"
    return "beyond the bound as it stands" if needed == float("inf") else f"about {needed:.0f} needed"


# ---- what differs, and why ------------------------------------------------------------------------------------------


def reasons(compared: Compared) -> list[str]:
    """Sentences, robot by robot."""
    plan = compared.asked.people.plan
    speed_m_s = setup_of(plan.study_text, plan.trust).study.robot.speed_m_s
    found = []
    for paths in compared.paths:
        rows = compared.of(paths.robot)
        found += [
            _path_sentence(compared.first, paths, speed_m_s),
            _choice_sentence(paths),
            _ends_sentence(paths),
            _outcome_sentence(compared.first, paths.robot, rows),
            _blocked_sentence(compared, paths.robot),
            *_ticks_sentences(compared.first, paths.robot, rows),
        ]
    return found


def _path_sentence(first: str, paths: Paths, speed_m_s: float) -> str:
    if not paths.ticks:
        return f"{paths.robot}: no tick could be followed on it and {first} alike."
    along_mm = abs(paths.behind_mm)
    told = (
        f"{paths.robot}: over {paths.ticks} ticks of the same commands its gripper is {paths.apart_mm[50]:.2f} mm from "
        f"{first}'s in the median, {paths.apart_quantile_mm:.2f} mm at 99 % and {paths.apart_mm[100]:.2f} mm at most, "
        f"and turned by {paths.turned_deg[2]:.2f}° at most."
    )
    if paths.behind_mm != paths.behind_mm:
        return told
    late_ms = along_mm / speed_m_s
    side = "behind" if paths.behind_mm > 0.0 else "ahead of"
    told += (
        f" While the arm moves it is {along_mm:.2f} mm {side} {first}'s along the way and {paths.beside_mm:.2f} mm to "
        "its side:"
    )
    if along_mm > 2.0 * paths.beside_mm:
        when = "later" if paths.behind_mm > 0.0 else "earlier"
        return f"{told} the same way, {late_ms:.0f} ms {when}: the drives follow a command sooner on one of the two."
    return f"{told} the two ways themselves differ, by how the joints give way and not by lag alone."


def _choice_sentence(paths: Paths) -> str:
    if not paths.choices:
        return f"{paths.robot}: the arbiter never chose by itself before first contact."
    parted = paths.ended["choice"]
    same = f"{paths.same_choices} of {paths.choices} ticks in which it chose by itself ({percent(paths.same_share, 1)})"
    if not parted:
        return f"{paths.robot}: the arbiter chose the same in {same}."
    told = ", ".join(f"in {count} {WHYS[why]}" for why, count in paths.why.items() if count)
    return f"{paths.robot}: the arbiter chose the same in {same}; of the {parted} other choices, {told}."


def _ends_sentence(paths: Paths) -> str:
    told = ", ".join(f"{count} until {ENDS[why]}" for why, count in paths.ended.items() if count)
    return f"{paths.robot}: of {paths.attempts} attempts at a pick-and-place were followed {told}."


def _outcome_sentence(first: str, other: str, rows: Sequence[Equivalence]) -> str:
    told = []
    for one in rows:
        level = one.levels[0]
        if one.key in OUTCOMES and abs(level.difference.mean) > level.difference.reach(0.95):
            told.append(f"{OUTCOMES[one.key]} ({interval(level.difference, one.measure)})")
    if not told:
        return (
            f"{other}: no outcome (picked up, delivered, dropped, pushed aside) differs from {first}'s beyond chance."
        )
    return f"{other}: beyond chance differ, from {first}'s, a task or an attempt: {'; '.join(told)}."


def blocked_rates(compared: Compared) -> dict[str, dict[str, float]]:
    """Reason to robot to blocked ticks in a thousand control ticks, the most frequent first."""
    rates: dict[str, dict[str, float]] = {}
    for robot, values in compared.values.items():
        for name, count in values.counts.items():
            if name.startswith(REFUSED):
                of = rates.setdefault(name.removeprefix(REFUSED), dict.fromkeys(compared.values, 0.0))
                of[robot] = _A_TICK_EVERY * count / max(values.counts[CONTROL], 1)
    return dict(sorted(rates.items(), key=lambda item: -max(item[1].values())))


def _blocked_sentence(compared: Compared, other: str) -> str:
    rates, first = blocked_rates(compared), compared.first
    here, there = (sum(of[robot] for of in rates.values()) for robot in (first, other))
    told = f"{other}: {there:.1f} of a thousand control ticks are blocked, on {first} {here:.1f}."
    if not rates:
        return told
    why, of = max(rates.items(), key=lambda item: abs(item[1][other] - item[1][first]))
    if of[other] == of[first]:
        return told
    return f"{told} Most of the difference: “{why}” ({of[other]:.1f} for {of[first]:.1f})."


def _ticks_sentences(first: str, other: str, rows: Sequence[Equivalence]) -> Iterator[str]:
    of = {one.key: one for one in rows}
    for kind in ("pickup", "dropoff"):
        blocked = {level.condition: level for level in of["blocked_ticks", kind].levels}
        for level in of["efficiency_ticks", kind].levels:
            longer = level.difference
            if not abs(longer.mean) > longer.reach(0.95):
                continue
            part = blocked[level.condition].difference.mean
            more, blocked_more = ("more" if value > 0.0 else "fewer" for value in (longer.mean, part))
            yield (
                f"{other}: a {kind} under {condition_of(level.condition)} takes {abs(longer.mean):.1f} ticks {more} "
                f"than on {first} ({interval(longer, 'efficiency_ticks')}); blocked ticks are {abs(part):.1f} "
                f"{blocked_more}."
            )
