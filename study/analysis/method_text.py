"""Numbers and methods in the words of a paper. Pure text: no markup."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from study.analysis.analysis import Analysis
from study.analysis.effect_sizes import Interval
from study.analysis.linear_model import Anova
from study.analysis.measures import GAIN_ENTROPY, WINDOW_TICKS
from study.analysis.summaries import Summary
from study.definition.builtin_questionnaires import INSTRUMENTS, Instrument
from study.definition.questionnaires import own_instruments
from study.records import TICK_S

MINUS = "−"


def number(value: float, decimals: int) -> str:
    """Fixed decimals with a true minus; no negative zero."""
    text = f"{value:.{decimals}f}"
    if float(text) == 0.0:
        text = text.lstrip("-")
    return text.replace("-", MINUS)


def p_value(p: float) -> str:
    """As the paper writes it: `< .0001`, else three decimals without the leading 0."""
    if p < 1e-4:
        return "<\N{NO-BREAK SPACE}.0001"
    if p < 1e-3:
        return "<\N{NO-BREAK SPACE}.001"
    return "1.000" if p > 0.9995 else f"{p:.3f}"[1:]


def degrees(df: float) -> str:
    """Degrees of freedom: whole ones as such, others with one decimal."""
    return f"{df:.0f}" if abs(df - round(df)) < 1e-6 else number(df, 1 if df >= 1.0 else 2)


def f_test(anova: Anova) -> str:
    """F(2, 88.1) = 20.61"""
    return f"F({anova.df_effect}, {degrees(anova.df_error)}) = {number(anova.f, 2)}"


def mean_sd(found: Summary, decimals: int) -> str:
    """M (SD)."""
    if found.mean is None:
        return "no values"
    sd = number(found.sd, decimals) if found.sd is not None else "one value"
    return f"{number(found.mean, decimals)} ({sd})"


def interval(found: Interval, decimals: int) -> str:
    """Estimate [low, high]."""
    low, high = number(found.low, decimals), number(found.high, decimals)
    return f"{number(found.value, decimals)} [{low}, {high}]"


def settings(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Every leaf of nested settings as `a.b` and its value."""
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from settings(value, f"{name}.")
        elif isinstance(value, list) and value and all(isinstance(item, Mapping) for item in value):
            for item in value:
                yield from settings(item, f"{name}[{item.get('id', '')}].")
        elif isinstance(value, (list, tuple)):
            yield name, ", ".join(map(str, value))
        elif isinstance(value, float) and math.isfinite(value):
            yield name, f"{value:.6g}"
        else:
            yield name, str(value)


def methods(analysis: Analysis) -> list[str]:
    """The methods of this analysis, ready to be pasted."""
    data, quality = analysis.data, analysis.data.quality
    forms = dict(INSTRUMENTS)
    for study in data.studies.values():
        forms |= own_instruments(study)
    scales = [forms[name] for name in sorted({score.instrument for score in data.scores}) if name in forms]
    paragraphs = [
        f"{quality.participants} participants completed {quality.trials} trials under {len(data.conditions)} "
        f"conditions within participants. A tick is {TICK_S:g} s. Completed trials alone were analysed. Failed "
        "pickups were kept; dropoffs that failed or, after a failed pickup, were not run were left out. Pickups and "
        "all tasks were analysed separately.",
        "Total task efficiency is the number of ticks of a task without gripper and reset ticks. Belief convergence "
        "speed is the number of user actions observed up to and including the first from which the instructed goal is "
        "the single most likely one for the rest of the task, over ticks in which it is a candidate (candidates switch "
        "to the bins while an object is held); tasks that never converged were left out and counted. A shared autonomy "
        f"window is a run of at least {WINDOW_TICKS} consecutive ticks of a task without input; user actions, gripper "
        "ticks, pauses and the end of the task end it. Belief accuracy gain is the change of the probability of the "
        "instructed goal at the user action that ends a window, where the entropy before it (to the base of the number "
        f"of candidates) is above {GAIN_ENTROPY}. The window rate is the number of windows, of any entropy, divided by "
        "the ticks without gripper and reset ticks, per participant and condition.",
        "Objective measures were compared over tasks (belief gain: over windows) by a linear mixed model with the "
        "condition as fixed effect and the position of the trial in the order and the instructed goal as crossed "
        "random intercepts, fitted by restricted maximum likelihood; the condition was tested by F with "
        "Satterthwaite's degrees of freedom, and its adjusted means compared in pairs with Tukey's adjustment. This "
        "is the analysis that the paper states (V-B: condition fixed, condition order and task goal as random "
        "covariates). Beside it stand, for comparison, Kenward and Roger's degrees of freedom; the same model with a "
        "random intercept per participant, since tasks of one person are not independent; and an analysis of variance "
        "in which position and goal are fixed categories, each effect tested given the others. Window rate and survey "
        "scales have one value per participant and condition and were compared by one-way repeated-measures analysis "
        "of variance, F(k − 1, (k − 1)(n − 1)), with Greenhouse and Geisser's correction stated and Tukey's HSD on its "
        "error term. Effect sizes are partial η² with 90 % and Hedges' g (tasks, pooled SD) or d_z (participants, SD "
        "of differences) with 95 % confidence intervals from noncentral distributions. Slopes over the number of goals "
        "are least squares over windows. Means with standard deviations (M, SD) are those of the plain "
        "values. The significance level was .05.",
    ]
    if any(item.frees or item.pickups_over_time or item.dropoffs_over_time for item in quality.ended):
        paragraphs.append(
            "Whenever the arm was freed, the pick-and-place began again; the ticks of all attempts count, windows end "
            "with an attempt, and user actions until convergence are those of all attempts. A pickup that a time limit "
            "ended enters with the ticks it had, which are the least it would have taken; a dropoff that one ended is "
            "left out as any that failed. Whether the results hang on either was looked at in three ways: without "
            "pick-and-places in which the arm was freed, without tasks that a time limit ended, and by Cox's "
            "proportional hazards model of the ticks without gripper and reset ticks until a task was over, in which "
            "tasks that a time limit ended, dropoffs too, are right-censored (participants as strata, Efron's method "
            "for ties, the condition tested by Wald's χ²)."
        )
    if scales:
        text = " ".join(_scale(form) for form in scales)
        paragraphs.append(f"After each trial participants answered questionnaires. {text}")
    if simulated := data.meta.get("simulated"):
        told = ", ".join(f"{name} = {value}" for name, value in settings(simulated)) if simulated is not True else ""
        paragraphs.append(f"The participants are simulated{': ' + told if told else ''}.")
    return [*paragraphs, _robot(analysis)]


def _scale(form: Instrument) -> str:
    source = f": {form.source.rstrip('.')}" if form.source else ""
    return f"“{form.title}”{source}; a high score means {form.score_means}."


def _robot(analysis: Analysis) -> str:
    """Parameters in a sentence; the tables below state the rest."""
    told = []
    for condition, sets in analysis.data.parameters.items():
        for parameters in sets:
            told.append(f"{condition}: " + ", ".join(f"{name} = {value}" for name, value in settings(parameters)))
    text = "Parameters of the arbiter as logged with the trials (rationality per metre, lengths in metres): "
    text += "; ".join(told) + "."
    for study in analysis.data.studies.values():
        parts = [
            ", ".join(f"{name} = {value}" for name, value in settings(study[section], f"{section}."))
            for section in ("robot", "distractor")
            if isinstance(study.get(section), Mapping)
        ]
        chosen = [f"{name} = {value}" for name, value in settings(study) if name in ("layout", "pickups_per_trial")]
        if parts or chosen:
            text += " Study file: " + "; ".join([*chosen, *parts]) + "."
    machines = analysis.data.meta.get("machines") or []
    versions = [
        ", ".join(f"{name} {value}" for name, value in machine.items())
        for machine in machines
        if isinstance(machine, Mapping)
    ]
    if versions:
        text += " Recorded on: " + "; ".join(versions) + "."
    return text
