"""Pieces of the report's page: tables and names, as HTML."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from study.analysis.analysis import KIND_TITLES, Analysis, Comparison
from study.analysis.effect_sizes import NotFitted
from study.analysis.figures import looks
from study.analysis.method_text import number, p_value


def name_of(analysis: Analysis, condition: str) -> str:
    """How a condition is called."""
    return looks(analysis.data.conditions)[condition].name


def table(header: Sequence[str], rows: Iterable[Sequence[str]], numbers: int = 0, marked: Iterable[int] = ()) -> str:
    """A table of ready HTML cells; the last `numbers` columns are set right, rows in `marked` bold."""
    first = len(header) - numbers
    bold = set(marked)

    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(f"<{tag}{' class=n' if i >= first else ''}>{cell}</{tag}>" for i, cell in enumerate(row))

    lines = [f"<tr{' class=sig' if index in bold else ''}>{cells('td', row)}</tr>" for index, row in enumerate(rows)]
    head = f"<thead><tr>{cells('th', header)}</tr></thead>" if any(header) else ""
    return f"<div class=wide tabindex=0><table>{head}<tbody>{''.join(lines)}</tbody></table></div>"


def label_of(comparison: Comparison) -> str:
    """What is compared, over which tasks."""
    kind = f", {KIND_TITLES[comparison.kind]}" if comparison.kind else ""
    return f"{comparison.measure.title}{kind}"


def adjusted(comparison: Comparison, condition: str) -> str:
    """A condition's adjusted mean and its standard error, as HTML."""
    anova = comparison.anova
    if isinstance(anova, NotFitted):
        return "not fitted"
    of = next((item for item in anova.adjusted_means if item.condition == condition), None)
    if of is None:
        return "no values"
    decimals = comparison.measure.decimals
    return f"{number(of.mean, decimals)} ({number(of.se, decimals)})"


def relation(p: float) -> str:
    """`= .012` or `< .001`, as HTML."""
    text = p_value(p)
    return escape(text) if text.startswith("<") else f"= {text}"
