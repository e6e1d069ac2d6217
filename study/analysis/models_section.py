"""The report's section on models: the one that is reported, those beside it, and which of them is which."""

from __future__ import annotations

from html import escape

from study.analysis.analysis import Analysis, Beside, Comparison
from study.analysis.effect_sizes import NotFitted
from study.analysis.linear_model import Anova
from study.analysis.method_text import f_test, number
from study.analysis.mixed_model import MixedModel
from study.analysis.report_pieces import label_of, name_of, relation, table


def models_section(analysis: Analysis) -> list[str]:
    """HTML: F of the condition under every model, its adjusted means, and what the random parts came to."""
    found = [(item, item.beside) for item in analysis.comparisons if item.beside is not None]
    return [
        "<p>The first column is the model that the paper states (V-B): the condition fixed, the position in the order "
        "and the goal as <b>random</b> covariates. All tables, figures and brackets of this page are of this model, "
        "with Satterthwaite’s degrees of freedom. The others show whether the result hangs on that choice: Kenward and "
        "Roger’s degrees of freedom; a random participant as well, since tasks of one person are not independent; and "
        "position and goal as <b>fixed</b> categories, which is <b>not</b> what the paper states.</p>",
        _tests(found),
        "<h3>Adjusted means under each model</h3>",
        _means(analysis, found),
        "<h3>How much positions, goals and participants differ</h3>",
        "<p>Standard deviations of the random intercepts, in the measure’s unit.</p>",
        _parts(found),
    ]


def _tests(found: list[tuple[Comparison, Beside]]) -> str:
    rows = []
    for comparison, beside in found:
        model, person = comparison.model, beside.with_participant
        rows.append(
            (
                escape(label_of(comparison)),
                _test(comparison.anova),
                _test(model.kenward_roger if isinstance(model, MixedModel) else None),
                _test(person.anova if isinstance(person, MixedModel) else person),
                _test(beside.fixed),
            )
        )
    header = ("Measure", "Random covariates (the paper’s)", "with Kenward–Roger", "and random participants")
    return table((*header, "Fixed covariates"), rows)


def _test(found: Anova | NotFitted | None) -> str:
    if found is None:
        return ""
    if isinstance(found, NotFitted):
        return f"not fitted: {escape(found.reason)}"
    text = f"{f_test(found)}, p {relation(found.p)}"
    return f"<b>{text}</b>" if found.p < 0.05 else text


def _means(analysis: Analysis, found: list[tuple[Comparison, Beside]]) -> str:
    rows = []
    for comparison, beside in found:
        decimals, person = comparison.measure.decimals, beside.with_participant
        models = (comparison.anova, person.anova if isinstance(person, MixedModel) else person, beside.fixed)
        for condition in comparison.summaries:
            cells = [escape(label_of(comparison)), escape(name_of(analysis, condition))]
            cells += [_mean(model, condition, decimals) for model in models]
            plain = comparison.summaries[condition].mean
            rows.append((*cells, "" if plain is None else number(plain, decimals)))
    header = ("Measure", "Condition", "Random covariates, mean (SE)", "and random participants", "Fixed covariates")
    return table((*header, "Plain M"), rows, numbers=4)


def _mean(model: Anova | NotFitted, condition: str, decimals: int) -> str:
    if isinstance(model, NotFitted):
        return ""
    of = next((item for item in model.adjusted_means if item.condition == condition), None)
    return "" if of is None else f"{number(of.mean, decimals)} ({number(of.se, decimals)})"


def _parts(found: list[tuple[Comparison, Beside]]) -> str:
    rows = []
    for comparison, beside in found:
        for name, model in (("the paper’s", comparison.model), ("and participants", beside.with_participant)):
            if not isinstance(model, MixedModel):
                continue
            sds = {part.name: f"{number(part.sd, comparison.measure.decimals)}" for part in model.random}
            cells = [
                escape(label_of(comparison)),
                name,
                *(sds.get(of, "") for of in ("position", "goal", "participant")),
            ]
            cells += [number(model.residual_sd, comparison.measure.decimals), escape("; ".join(model.notes))]
            rows.append(cells)
    if not rows:
        return "<p>No mixed model could be fitted.</p>"
    return table(("Measure", "Model", "Positions", "Goals", "Participants", "Residual", "Note"), rows)
