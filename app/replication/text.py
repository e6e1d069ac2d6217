"""The replication as text: the table on the screen, and the report."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise

from app.replication import long_tasks
from app.replication import spread as people_spread
from app.replication.ceiling import IMPLIED_LEGEND, ceiling, implied_table
from app.replication.ceiling import LEGEND as CEILING_LEGEND
from app.replication.comparisons import SIGN_AIM, SIGNIFICANT_AIM
from app.replication.fit import ANCHORS
from app.replication.formats import CONDITION_NAMES, MEASURE_NAMES, code, columns, name_of, number, percent
from app.replication.paper import BALANCED, CIRCULAR, GOAL_ORIENTED, TELEOPERATION, UNCERTAIN_WINDOWS
from app.replication.replicate import Replication, calibrated_alpha
from app.replication.rule import fitted_sentence, hash_line, rule, seed_sentence
from app.replication.rule import table as open_values
from app.replication.varied_text import reasons_section, varied_section
from app.simulated.study import setup_of
from app.simulated.traits import TRAITS
from app.simulated.variants import fitted


def table(result: Replication) -> str:
    """The comparisons, for the screen and the report."""
    rows: list[tuple[str, ...]] = [
        ("comparison", "paper", "ours [95 % of studies]", "sign", "(ceil.)", "p<.05", "(ceil.)", "none", "shown", "aim")
    ]
    for item in result.shares:
        claim, (low, high) = item.claim, item.interval
        bound = ceiling().rows[claim]
        same = claim.verdict == "same"
        rows.append(
            (
                name_of(claim),
                f"{number(claim.paper_difference, claim.measure)} {'n.s.' if same else '*   '}",
                f"{number(item.mean, claim.measure)} [{number(low, claim.measure)}, {number(high, claim.measure)}]"
                if item.differences
                else "not tested",
                percent(item.same_sign),
                f"({percent(bound.same_sign)})" if claim.sign else "",
                percent(item.significant),
                f"({percent(bound.significant)})",
                percent(item.within) if same else "",
                percent(item.equivalent) if same else "",
                ("met" if bound.met_by(item) else "MISSED") + ("*" if claim.measure in CIRCULAR else ""),
            )
        )
    return columns(rows, ends_in_words=True)


_SIGN, _SIGNIFICANT = f"{SIGN_AIM:.0%}", f"{SIGNIFICANT_AIM:.0%}"
LEGEND = f"""\
sign: share of studies with the sign of the paper's means. p<.05: Tukey after the paper's mixed model, in the paper's
direction; where the paper found no difference, in any. none: the study's difference is smaller than the margin.
shown: the study shows that it is (two one-sided tests). (ceil.): the same share with the paper's own means, SDs and
numbers of values exactly true, plain Tukey. Aim, where the paper found a difference: sign in {_SIGN} and significance
in {_SIGNIFICANT} of studies, or as often as the ceiling if that is lower; where it found none: none in {_SIGNIFICANT}.
* circular: usability and workload follow from an assumed model (app/simulated/answers.py) and replicate nothing."""


def on_screen(result: Replication) -> str:
    """What the command prints."""
    lengths = f"{long_tasks.table(result.lengths)}\n\n{long_tasks.sentence(result.lengths)}"
    header = f"{hash_line()}\n{seed_sentence(result.plan.seed)}"
    lacking = untested(result)
    compared = f"{table(result)}\n\n{lacking}" if lacking else table(result)
    return f"{header}\n\n{compared}\n\n{LEGEND}\n\n{joint_sentence(result)}\n\nWithout time limits:\n{lengths}"


def untested(result: Replication) -> str:
    """Which comparisons could not be made in some studies, and why, a sentence each; empty = all were made."""
    lines = []
    for item in result.shares:
        if item.untested:
            reasons = Counter(item.untested).most_common(2)
            why = "; ".join(reason for reason, _ in reasons)
            more = "; and others" if len(set(item.untested)) > len(reasons) else ""
            lines.append(
                f"- {name_of(item.claim)} could not be tested in {len(item.untested)} of {len(result.studies)} "
                f"studies, which count against it: {why}{more}."
            )
    return "\n".join(lines)


def report(result: Replication) -> str:
    """The whole report, Markdown."""
    setup = setup_of(result.plan.study_text)
    study = setup.study
    parts = [
        "# The paper's comparisons in simulation",
        f"{len(result.studies)} simulated studies of {result.participants} participants, seed {result.plan.seed}, "
        f"robot {result.plan.robot}, preset {result.preset}, layout {study.layout}. Arbiter: transition "
        f"{study.arbiter.transition}, planning delay {study.arbiter.planning_delay:g} of a tick, model step "
        f"{study.arbiter.step_m:g} m, rationality {study.arbiter.rationality_per_m:g} per metre, stickiness "
        f"{study.arbiter.stickiness:g}, alpha {calibrated_alpha(setup):.4g} (calibrated). Robot speed "
        f"{study.robot.speed_m_s:g} m/s. Readings: {study.distractor.placement}.",
        f"{hash_line()}. {seed_sentence(result.plan.seed)} {fitted_sentence()}",
        rule().blind,
        "## Comparisons",
        code(table(result)),
        *([untested(result)] if untested(result) else []),
        LEGEND,
        _verdict(result),
        CEILING_LEGEND,
        "## Pure teleoperation against what it was fitted to",
        code(_anchors_table(result)),
        f"The aim is {rule().anchor_tolerance:.0%}. Of the three conditions only this one was looked at for the fit.",
        "## All at once",
        joint_sentence(result),
        "## The paper's F against its means and SDs",
        code(implied_table(ceiling())),
        IMPLIED_LEGEND,
        "## Means",
        code(_means_table(result)),
        "Ours is the mean over studies with the middle 95 %, and the mean SD within a study.",
        "## Between people and within",
        code(people_spread.table(result.studies)),
        people_spread.LEGEND,
        "## Belief gain by number of goals (the paper's Fig. 4)",
        code(_goals_table(result)),
        goals_sentence(result),
        "## How long tasks take without time limits",
        code(long_tasks.table(result.lengths)),
        long_tasks.sentence(result.lengths),
        LENGTHS_LEGEND,
        "## What happened",
        code(_counts_table(result)),
        *reasons_section(result),
        *varied_section(result),
        "## How the open values were chosen",
        rule().equations,
        code(open_values(setup)),
        "\n".join(f"- {item.name}: {item.how}." for item in rule().open),
        "\n".join(f"{place}. {step}" for place, step in enumerate(rule().procedure, 1)),
        "A miss is: " + "; ".join(rule().misses) + f". {rule().then}",
        "## Calibration",
        code(_fit_table()),
        "## The model of a participant",
        code(_traits_table(result)),
        "Spread is the standard deviation of the logarithm over people. How the traits act stands in "
        "app/simulated/driver.py.",
    ]
    return "\n\n".join(parts) + "\n"


LENGTHS_LEGEND = (
    "Whoever reached a time limit was simulated again without, so that the longest are what they would have been. "
    "Failed and unfinished tasks count. Lengths are control ticks of 0.5 s, as in the paper's task efficiency; M and "
    "SD are the paper's of it (for dropoffs, of all tasks). blocked: share of them in which the arm was asked to move "
    "and did not; cannot fold: in which it did not because it cannot fold further."
)


def joint_sentence(result: Replication) -> str:
    """In how many studies everything comes out at once, beside what the paper's own numbers let one expect."""
    of, bound = result.joint, ceiling().joint
    return (
        f"All {of.comparisons} differences have the paper's sign at once in {percent(of.signs)} of the {of.studies} "
        f"studies (ceiling {percent(bound.signs)}), and all are significant at once in {percent(of.significant)} "
        f"({percent(bound.significant)}).\nOn average {of.mean_signs:.1f} have the sign ({bound.mean_signs:.1f}) and "
        f"{of.mean_significant:.1f} are significant ({bound.mean_significant:.1f}). The ceiling draws the comparisons "
        "independently, since the paper\ndoes not say how they hang together."
    )


def _verdict(result: Replication) -> str:
    own = [item for item in result.shares if item.claim.measure not in CIRCULAR]
    different = [item for item in own if item.claim.verdict == "different"]
    same = [item for item in own if item.claim.verdict == "same"]
    rows = ceiling().rows
    signed = sum(item.same_sign >= SIGN_AIM for item in different)
    reached = sum(item.significant >= rows[item.claim].aim for item in different)
    possible = sum(rows[item.claim].significant >= SIGNIFICANT_AIM for item in different)
    off = [item for item in result.means if item.known and item.measure not in CIRCULAR and not item.within_sd]
    named = ", ".join(f"{MEASURE_NAMES[i.measure]} {i.kind} {CONDITION_NAMES[i.condition]}" for i in off)
    lines = [
        f"Of the paper's {len(different)} differences, {signed} have its sign in at least {SIGN_AIM:.0%} of studies, "
        f"and {reached} are significant in at least {SIGNIFICANT_AIM:.0%} or as often as the ceiling, which itself "
        f"reaches {SIGNIFICANT_AIM:.0%} in {possible}. Of the {len(same)} comparisons without a difference, "
        f"{sum(rows[item.claim].met_by(item) for item in same)} stay without one in at least {SIGNIFICANT_AIM:.0%}.",
        f"{len(off)} means lie outside the paper's SD{': ' + named if named else ''}.",
    ]
    return "\n\n".join(lines)


def _anchor_name(measure: str, kind: str, statistic: str) -> str:
    return f"{'SD of ' if statistic == 'sd' else ''}{MEASURE_NAMES[measure]} {kind}"


def _anchors_table(result: Replication) -> str:
    rows: list[tuple[str, ...]] = [("pure teleoperation", "paper", "ours", "off", "aim")]
    of_measure = {(item.measure, item.kind): item for item in result.means if item.condition == TELEOPERATION}
    for anchor in ANCHORS:
        item = of_measure[anchor.measure, anchor.kind]
        ours = item.mean if anchor.statistic == "mean" else item.sd
        off = ours / anchor.value - 1.0
        known = off == off
        rows.append(
            (
                _anchor_name(anchor.measure, anchor.kind, anchor.statistic),
                number(anchor.value, anchor.measure),
                number(ours, anchor.measure) if known else "no values",
                f"{off:+.0%}" if known else "",
                "" if not known else "met" if abs(off) <= rule().anchor_tolerance else "MISSED",
            )
        )
    return columns(rows)


def _means_table(result: Replication) -> str:
    rows: list[tuple[str, ...]] = [("measure", "paper M (SD)", "ours M [95 %] (SD)", "within SD")]
    for item in result.means:
        mean, low, high, sd = (number(value, item.measure) for value in (item.mean, *item.interval, item.sd))
        rows.append(
            (
                f"{MEASURE_NAMES[item.measure]} {item.kind}, {CONDITION_NAMES[item.condition]}",
                f"{number(item.paper_mean, item.measure)} ({number(item.paper_sd, item.measure)})",
                f"{mean} [{low}, {high}] ({sd})" if item.known else "no values",
                ("yes" if item.within_sd else "NO") if item.known else "",
            )
        )
    return columns(rows)


def goals_sentence(result: Replication) -> str:
    """The trend of the means, beside the paper's; without tests, as in the paper."""
    told = ["The paper's trend, untested there, is upward for balanced and downward for goal-oriented."]
    for condition in (GOAL_ORIENTED, BALANCED):
        of = next((item.by_goals for item in result.goals if item.condition == condition), {})
        if len(of) < 2:
            told.append(f"Under {CONDITION_NAMES[condition]} too few numbers of goals occurred to tell.")
            continue
        told.append(f"Under {CONDITION_NAMES[condition]} the means {_trend(of)}.")
    told.append(
        "Dropoffs have two goals and pickups four to six, so that a trend over all can be pickups against dropoffs. "
        "rising, falling: share of studies whose straight line through the windows does."
    )
    return " ".join(told)


def _trend(by_goals: Mapping[int, float]) -> str:
    """How means run with the number of goals: over all, and from the fewest of pickups on."""
    counts = sorted(by_goals)
    values = [by_goals[count] for count in counts]
    first, last = (number(values[end], "belief_gain") for end in (0, -1))
    ends = f"from {first} at {counts[0]} to {last} at {counts[-1]}"
    steps = [after - before for before, after in pairwise(values)]
    if all(step < 0.0 for step in steps):
        return f"fall with every further goal, {ends}"
    if all(step > 0.0 for step in steps):
        return f"rise with every further goal, {ends}"
    return f"run {ends}, neither falling nor rising throughout"


def _goals_table(result: Replication) -> str:
    counts = sorted({count for item in result.goals for count in item.by_goals})
    rows: list[tuple[str, ...]] = [
        ("condition", *(f"{count} goals" for count in counts), "rising", "rising p<.05", "falling p<.05")
    ]
    for item in result.goals:
        gains = (number(item.by_goals[count], "belief_gain") if count in item.by_goals else "" for count in counts)
        parts = (item.rising, item.rising_significant, item.falling_significant)
        rows.append((CONDITION_NAMES[item.condition], *gains, *(percent(part) for part in parts)))
    return columns(rows)


def _counts_table(result: Replication) -> str:
    studies = len(result.studies)
    totals: Counter[str] = Counter()
    for item in result.studies:
        totals.update(item.counts)
    paper = {
        "tasks": "216",
        "failed_pickups": "1",
        "failed_dropoffs": "3",
        "never_converged": "9",
        "windows_pickup": "about 337 (ticks times rate)",
        "windows_all": "about 624",
        "uncertain_windows_pickup": f"at least {UNCERTAIN_WINDOWS['pickup']} (degrees of freedom)",
        "uncertain_windows_all": f"at least {UNCERTAIN_WINDOWS['all']}",
    }
    rows: list[tuple[str, ...]] = [("per study", "ours", "paper")]
    rows += [(name.replace("_", " "), f"{total / studies:.1f}", paper.get(name, "")) for name, total in totals.items()]
    return columns(rows, ends_in_words=True)


def _fit_table() -> str:
    found = fitted()["found"]
    if not isinstance(found, dict):
        return str(found)
    rows: list[tuple[str, ...]] = [("pure teleoperation", "paper", *found["variants"])]
    first = next(iter(found["variants"].values()))
    for place, anchor in enumerate(first["anchors"]):
        ours = (number(item["anchors"][place]["ours"], anchor["measure"]) for item in found["variants"].values())
        rows.append(
            (
                _anchor_name(anchor["measure"], anchor["kind"], anchor.get("statistic", "mean")),
                number(anchor["paper"], anchor["measure"]),
                *ours,
            )
        )
    rows.append(("misfit", "", *(f"{item['misfit']:.1f}" for item in found["variants"].values())))
    windows = (f"{item['windows_above_entropy']} of {item['windows']}" for item in found["variants"].values())
    rows.append(("windows above 0.7 (not fitted)", "", *windows))
    values = "\n".join(f"{name}: {json.dumps(item['values'])}" for name, item in found["variants"].items())
    note = found.get("note", "")
    return f"{columns(rows)}\n\n{values}\n\n{found['by']}. {note}"


def _traits_table(result: Replication) -> str:
    rows: list[tuple[str, ...]] = [("trait", "mean", "spread", "fitted", "meaning; source")]
    for name, trait in TRAITS.items():
        mean, spread = result.plan.population.mean(name), trait.spread * result.plan.population.spread_scale
        off = " (off)" if mean == trait.off else ""
        about = f"{trait.about}; {trait.source}"
        rows.append((name, f"{mean:.4g}{off}", f"{spread:.2g}", "yes" if trait.fitted else "", about))
    return columns(rows, ends_in_words=True)
