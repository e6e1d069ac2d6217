"""The replication as text: the table on the screen, and the report."""

from __future__ import annotations

import json
from collections.abc import Sequence

from app.replication import long_tasks
from app.replication.ceiling import IMPLIED_LEGEND, ceiling, implied_table
from app.replication.ceiling import LEGEND as CEILING_LEGEND
from app.replication.comparisons import SIGN_AIM, SIGNIFICANT_AIM, Share
from app.replication.formats import CONDITION_NAMES, MEASURE_NAMES, code, columns, name_of, number, percent
from app.replication.paper import CIRCULAR, TELEOPERATION, UNCERTAIN_WINDOWS, Claim
from app.replication.replicate import Replication, Variation, calibrated_alpha
from app.replication.rule import fitted_sentence, hash_line, rule, seed_sentence
from app.replication.rule import table as open_values
from app.simulated.study import setup_of
from app.simulated.traits import TRAITS
from app.simulated.variants import fitted

MOVED = 0.15
"""A variation is said to move a comparison when a share changes by more than this and twice its standard error."""


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
                f"{number(item.mean, claim.measure)} [{number(low, claim.measure)}, {number(high, claim.measure)}]",
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
    return f"{header}\n\n{table(result)}\n\n{LEGEND}\n\n{joint_sentence(result)}\n\nWithout time limits:\n{lengths}"


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
        "## Belief gain by number of goals (the paper's Fig. 4)",
        code(_goals_table(result)),
        "The paper's trend is upward for balanced and downward for goal-oriented (untested there). Dropoffs have two "
        "goals, pickups four to six, so a trend can be pickups against dropoffs.",
        "## How long tasks take without time limits",
        code(long_tasks.table(result.lengths)),
        long_tasks.sentence(result.lengths),
        LENGTHS_LEGEND,
        "## What happened",
        code(_counts_table(result)),
        *_varied(result),
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
    off = [item for item in result.means if item.measure not in CIRCULAR and not item.within_sd]
    named = ", ".join(f"{MEASURE_NAMES[i.measure]} {i.kind} {CONDITION_NAMES[i.condition]}" for i in off)
    lines = [
        f"Of the paper's {len(different)} differences, {signed} have its sign in at least {SIGN_AIM:.0%} of studies, "
        f"and {reached} are significant in at least {SIGNIFICANT_AIM:.0%} or as often as the ceiling, which itself "
        f"reaches {SIGNIFICANT_AIM:.0%} in {possible}. Of the {len(same)} comparisons without a difference, "
        f"{sum(rows[item.claim].met_by(item) for item in same)} stay without one in at least {SIGNIFICANT_AIM:.0%}.",
        f"{len(off)} means lie outside the paper's SD{': ' + named if named else ''}.",
    ]
    return "\n\n".join(lines)


def _varied(result: Replication) -> list[str]:
    """One thing at a time: what each variation does to every comparison that was missed, and to the others."""
    if not result.varied:
        return []
    parts = [
        "## One thing at a time",
        f"Each variation changes one thing in the simulation and runs the first {result.vary} studies again, with the "
        "same people; everything else, alpha's calibration included, follows. It is held against the same studies "
        f"unchanged: a share moves when it changes by more than {MOVED:.0%} and twice its standard error. Nothing was "
        "tuned by these.",
    ]
    own = [item for item in result.shares if item.claim.measure not in CIRCULAR]
    for title, items in (
        ("Comparisons that missed their aim", [item for item in own if not ceiling().rows[item.claim].met_by(item)]),
        ("Comparisons that met it", [item for item in own if ceiling().rows[item.claim].met_by(item)]),
    ):
        lines = [f"### {title}"]
        for item in items:
            before = _same(item.claim, result.unvaried)
            moved = [
                text
                for variation, of in result.varied
                if (text := _moves(before, _same(item.claim, of), variation, result.vary))
            ]
            lines.append(
                f"- **{name_of(item.claim)}** (sign {percent(item.same_sign)}, p<.05 {item.significant:.0%}, "
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


def _moves(before: Share, after: Share, variation: Variation, studies: int) -> str | None:
    """What a variation does to a comparison, if that is more than chance."""
    told = []
    for word, one, other in (
        ("sign", before.same_sign, after.same_sign),
        ("p<.05", before.significant, after.significant),
    ):
        error = (max(one * (1.0 - one), 0.04) / studies) ** 0.5
        if abs(other - one) > max(MOVED, 2.0 * error):
            told.append(f"{word} {one:.0%} to {other:.0%}")
    if not told:
        return None
    numbers = (number(share.mean, share.claim.measure) for share in (before, after))
    return f"{variation.name}: {', '.join(told)} (difference {' to '.join(numbers)})"


def _differences_table(result: Replication) -> str:
    own = [item for item in result.shares if item.claim.measure not in CIRCULAR]
    head = ("varied", *(f"{_CODES[item.claim.measure]}{item.claim.kind[0]}:{_pair(item.claim)}" for item in own))
    rows: list[tuple[str, ...]] = [
        head,
        ("paper", *(number(item.claim.paper_difference, item.claim.measure) for item in own)),
    ]
    for name, of in (("nothing", result.unvaried), *((variation.name, of) for variation, of in result.varied)):
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


def _anchors_table(result: Replication) -> str:
    rows: list[tuple[str, ...]] = [("pure teleoperation", "paper", "ours", "off", "aim")]
    for item in result.means:
        if item.condition == TELEOPERATION and item.measure not in CIRCULAR:
            rows.append(
                (
                    f"{MEASURE_NAMES[item.measure]} {item.kind}",
                    number(item.paper_mean, item.measure),
                    number(item.mean, item.measure),
                    "" if item.mean != item.mean else f"{item.off:+.0%}",
                    "met" if abs(item.off) <= rule().anchor_tolerance else "MISSED",
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
                f"{mean} [{low}, {high}] ({sd})",
                "yes" if item.within_sd else "NO",
            )
        )
    return columns(rows)


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
    totals = {name: sum(item.counts.get(name, 0) for item in result.studies) for name in result.studies[0].counts}
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
            (f"{MEASURE_NAMES[anchor['measure']]} {anchor['kind']}", number(anchor["paper"], anchor["measure"]), *ours)
        )
    rows.append(("misfit", "", *(f"{item['misfit']:.1f}" for item in found["variants"].values())))
    windows = (f"{item['windows_above_entropy']} of {item['windows']}" for item in found["variants"].values())
    rows.append(("windows above 0.7 (not fitted)", "", *windows))
    values = "\n".join(f"{name}: {json.dumps(item['values'])}" for name, item in found["variants"].items())
    note = found.get("note", "")
    return f"{columns(rows)}\n\n{values}\n\n{found['by']}. {note}"


def _traits_table(result: Replication) -> str:
    rows: list[tuple[str, ...]] = [("trait", "mean", "spread", "fitted", "meaning")]
    for name, trait in TRAITS.items():
        mean, spread = result.plan.population.mean(name), trait.spread * result.plan.population.spread_scale
        rows.append((name, f"{mean:.4g}", f"{spread:.2g}", "yes" if trait.fitted else "", trait.about))
    return columns(rows, ends_in_words=True)
