"""The replication as tables for a spreadsheet, and `columns.csv`, which says what every column of them is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

from app.errors import LabError
from app.replication import long_tasks
from app.replication.ceiling import Ceiling, ceiling, numbers_of
from app.replication.comparisons import Means, Share
from app.replication.formats import write_csv
from app.replication.reasons import missed
from app.replication.replicate import Replication
from app.replication.text import report

_SHARE: Mapping[str, str] = {
    "measure": "what is compared",
    "kind": "of pickups alone, or of all tasks",
    "first": "condition",
    "second": "condition that is taken off the first",
    "paper_says": "different = the paper's Tukey test was significant at .05; same = it was not",
    "paper_difference": "difference of the paper's means",
    "difference": "mean of the studies' adjusted differences; blank = no study could be tested",
    "low": "2.5 % quantile of the studies' differences",
    "high": "97.5 % quantile of the studies' differences",
    "same_sign": "share of studies with the sign of the paper's means; blank = the paper's means are equal",
    "significant": "share of studies with Tukey's p < .05, in the paper's direction if it found a difference",
    "significant_opposite": "share of studies with p < .05 in the other direction",
    "margin": "differences smaller than this count as none; blank where the paper found one",
    "within_margin": "share of studies whose difference is smaller than the margin",
    "shown_equivalent": "share of studies that show it to be (two one-sided tests at .05)",
    "ceiling_same_sign": "same_sign with the paper's own means, SDs and numbers of values exactly true",
    "ceiling_significant": "significant, likewise",
    "aim": "share to be reached: of significance, or of none where the paper found no difference",
    "aim_met": "1 = it is reached, and same_sign is at least .95 where the paper found a difference",
}
_MEANS: Mapping[str, str] = {
    "measure": "what is measured",
    "kind": "of pickups alone, or of all tasks",
    "condition": "condition",
    "paper_mean": "the paper's mean",
    "paper_sd": "the paper's standard deviation",
    "mean": "mean over the studies of their means; blank = no values",
    "low": "2.5 % quantile of the studies' means",
    "high": "97.5 % quantile of the studies' means",
    "sd": "mean over the studies of the standard deviation within one",
    "within_sd": "1 = ours is within one of the paper's SD of its mean",
}
_JOINT: Mapping[str, str] = {
    "of": "simulated = these studies; ceiling = drawn with the paper's own numbers",
    "comparisons": "how many differences are looked at together",
    "studies": "how many studies",
    "signs": "share of the studies in which all have the paper's sign",
    "significant": "share in which all are significant in its direction",
    "mean_signs": "how many have the paper's sign, on average",
    "mean_significant": "how many are significant in its direction, on average",
}
_CEILING: Mapping[str, str] = {
    "measure": "what is compared",
    "kind": "of pickups alone, or of all tasks",
    "values": "how many values the paper's degrees of freedom give, all conditions together",
    "df_error": "the paper's error degrees of freedom",
    "f_reported": "the F that the paper reports; blank = none",
    "f_implied": "the F that its means, SDs and numbers of values imply",
    "absorbed": "share of the variance within conditions that its model must have taken up; blank = no F reported",
}
TABLES: Mapping[str, Mapping[str, str]] = {
    "comparisons.csv": _SHARE,
    "means.csv": _MEANS,
    "joint.csv": _JOINT,
    "implied_f.csv": _CEILING,
    "lengths.csv": long_tasks.COLUMNS,
    "varied.csv": {"varied": "what was changed", "studies": "in how many studies", **_SHARE},
    "reasons.csv": {
        "experiment": "what was changed, for the comparisons that miss their aim",
        "reason": "the reason for a miss that it speaks for",
        "studies": "in how many studies",
        "simulated": "1 = simulated anew, 0 = the same studies with their values changed or analysed otherwise",
        **_SHARE,
    },
}


def write(result: Replication, out_dir: Path) -> None:
    """The report and its tables. Raises `LabError` when they cannot be written."""
    off = {share.claim for share in missed(result.shares)}
    rows: dict[str, Sequence[Sequence[Any]]] = {
        "comparisons.csv": [_share_row(item) for item in result.shares],
        "means.csv": [_means_row(item) for item in result.means],
        "joint.csv": [
            [name, *_cells(astuple(of))] for name, of in (("simulated", result.joint), ("ceiling", ceiling().joint))
        ],
        "implied_f.csv": _implied_rows(ceiling()),
        "lengths.csv": [_by_name(item, long_tasks.COLUMNS) for item in result.lengths],
        "varied.csv": [
            [one.variation.name, one.studies, *_share_row(item)] for one in result.varied for item in one.after
        ],
        "reasons.csv": [
            [one.name, one.reason, one.studies, int(one.simulated), *_share_row(share)]
            for one in result.experiments
            for share in one.after
            if share.claim in off
        ],
    }
    described = [(name, column, about) for name, of in TABLES.items() for column, about in of.items()]
    try:
        (out_dir / "replication.md").write_text(report(result), encoding="utf-8")
        for name, of in TABLES.items():
            write_csv(out_dir / name, tuple(of), rows[name])
        write_csv(out_dir / "columns.csv", ("file", "column", "description"), described)
    except OSError as error:
        raise LabError(f"{out_dir}: cannot be written: {error.strerror or error}") from None


def _share_row(item: Share) -> list[Any]:
    claim, bound = item.claim, ceiling().rows[item.claim]
    numbers = (claim.paper_difference, item.mean, *item.interval, item.same_sign, item.significant, item.opposite)
    return [
        *(claim.measure, claim.kind, claim.first, claim.second, claim.verdict),
        *_cells(numbers),
        *(_cells((claim.margin, item.within, item.equivalent)) if claim.margin else ("", "", "")),
        *_cells((bound.same_sign, bound.significant, bound.aim)),
        int(bound.met_by(item)),
    ]


def _means_row(item: Means) -> list[Any]:
    numbers = (item.paper_mean, item.paper_sd, item.mean, *item.interval, item.sd)
    return [item.measure, item.kind, item.condition, *_cells(numbers), int(item.within_sd)]


def _implied_rows(of: Ceiling) -> list[list[Any]]:
    return [
        [
            *(item.tested.measure, item.tested.kind, sum(numbers_of(item.tested)), item.tested.df_error),
            *("" if value is None else _cell(value) for value in (item.tested.f, item.f, item.absorbed)),
        ]
        for item in of.implied
    ]


def _by_name(row: Any, names: Mapping[str, str]) -> list[Any]:
    values = {field.name: getattr(row, field.name) for field in fields(row)}
    return [_cell(values[name]) for name in names]


def _cells(values: Sequence[Any]) -> list[Any]:
    return [_cell(value) for value in values]


def _cell(value: Any) -> Any:
    """Numbers short; what is not known is blank."""
    if not isinstance(value, float):
        return value
    return "" if value != value else f"{value:.6g}"
