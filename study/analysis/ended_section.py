"""The report's section on what did not end by itself: freed arms, time limits, and whether the results hang on them."""

from __future__ import annotations

from html import escape

from study.analysis.analysis import KIND_TITLES, Analysis, Subset
from study.analysis.effect_sizes import NotFitted
from study.analysis.method_text import f_test, interval, mean_sd, p_value
from study.analysis.report_pieces import label_of, name_of, relation, table
from study.analysis.sensitivity import LeftOut

_WITHOUT: dict[LeftOut, str] = {
    "freed": "Without pick-and-places in which the arm was freed",
    "censored": "Without tasks that a time limit ended",
}


def ended_section(analysis: Analysis) -> list[str]:
    """HTML: counts by condition, and the comparisons once more where there is anything to leave out."""
    return [_counts(analysis), *(_subset(analysis, subset) for subset in analysis.subsets), *_hazards(analysis)]


def _counts(analysis: Analysis) -> str:
    rows = [
        (
            escape(name_of(analysis, item.condition)),
            *(str(number) for number in (item.cycles, item.freed_cycles, item.frees)),
            *(str(number) for number in (item.by_participant, item.by_experimenter)),
            *(str(number) for number in (item.pickups_over_time, item.dropoffs_over_time, item.not_run_for_time)),
        )
        for item in analysis.data.quality.ended
    ]
    header: tuple[str, ...] = ("Condition", "Pick-and-places", "with a freed arm", "Arm freed", "by the participant")
    header += ("by an experimenter", "Pickups over time", "Dropoffs over time", "Not run: the trial was over")
    return table(header, rows, numbers=8) + (
        "<p>Whoever frees the arm begins the pick-and-place again; the ticks of all attempts count. A task over its "
        "time is right-censored: it would have taken longer than was seen.</p>"
    )


def _subset(analysis: Analysis, subset: Subset) -> str:
    rows: list[list[str]] = []
    marked: list[int] = []
    for comparison in subset.comparisons:
        decimals = comparison.measure.decimals
        cells = [escape(label_of(comparison))]
        cells += [f"{mean_sd(found, decimals)}, {found.n}" for found in comparison.summaries.values()]
        anova, whole = comparison.anova, analysis.comparison(comparison.measure.id, comparison.kind)
        if isinstance(anova, NotFitted):
            cells += ["not fitted", ""]
        else:
            cells += [f_test(anova), p_value(anova.p)]
            if anova.p < 0.05:
                marked.append(len(rows))
        before = whole.anova if whole is not None else None
        cells.append("" if before is None or isinstance(before, NotFitted) else p_value(before.p))
        rows.append(cells)
    names = [f"{escape(name_of(analysis, c))}<br>M (SD), n" for c in analysis.data.conditions]
    header = ["Measure", *names, "Condition", "p", "p of all tasks"]
    title = f"<h3>{_WITHOUT[subset.left_out]}: {subset.tasks} tasks left out</h3>"
    return title + table(header, rows, numbers=len(names) + 3, marked=marked)


def _hazards(analysis: Analysis) -> list[str]:
    if not analysis.hazards:
        return []
    rows = []
    for kind, model in analysis.hazards:
        if isinstance(model, NotFitted):
            rows.append((KIND_TITLES[kind], f"not fitted: {escape(model.reason)}", "", "", ""))
            continue
        ratios = "<br>".join(
            f"{escape(name_of(analysis, condition))}: {interval(ratio, 2)}, p {relation(p)}"
            for condition, ratio, p in model.ratios
        )
        tested = f"χ²({model.df}) = {model.chi_squared:.2f}"
        rows.append((KIND_TITLES[kind], ratios, tested, p_value(model.p), f"{model.tasks}, {model.censored} censored"))
    against = escape(name_of(analysis, analysis.data.conditions[0]))
    return [
        "<h3>Control ticks until a task is over, with tasks over their time as right-censored</h3>",
        "<p>Cox's proportional hazards with participants as strata. A hazard ratio above 1: tasks end sooner.</p>",
        table(("Tasks", f"Hazard ratio against {against} [95 % CI]", "Condition (Wald)", "p", "Tasks"), rows),
    ]
