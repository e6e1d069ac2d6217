"""The report of an analysis: one page that needs nothing else, figures, CSV tables and `measures.json`.

OUT/report.html  measures.json  figures/*.svg *.png  tables/*.csv
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from study.analysis.analysis import KIND_TITLES, Analysis, Comparison
from study.analysis.effect_sizes import Interval, NotFitted
from study.analysis.ended_section import ended_section
from study.analysis.figures import HEATMAP_NAME, Picture, draw_all
from study.analysis.heatmap import Heatmap
from study.analysis.linear_model import Pair, RepeatedMeasures
from study.analysis.measures import GAIN_ENTROPY, WINDOW_TICKS
from study.analysis.method_text import f_test, interval, mean_sd, methods, number, p_value, settings
from study.analysis.models_section import models_section
from study.analysis.report_pieces import adjusted, label_of, name_of, relation, table
from study.analysis.tables import MEASURES_FORMAT, all_tables, measures_json
from study.analysis.ticks import AnalysisError
from study.json_text import parse_json
from study.text_file import read_text

PAGE_NAME = "report.html"
MEASURES_NAME = "measures.json"
MOST_MEASURES_BYTES = 100_000_000


def write_report(analysis: Analysis, out_dir: Path | str, heatmap: Heatmap | None = None) -> Path:
    """Write everything into a folder, replacing an earlier report; the path of the page.

    `heatmap` holds the values of the paper's Fig. 2, which the caller computes. Raises `AnalysisError` for a folder
    that holds anything but an earlier report, or cannot be written.
    """
    claim(Path(out_dir))
    return write_drawn(analysis, out_dir, draw_all(analysis, heatmap))


def write_drawn(analysis: Analysis, out_dir: Path | str, pictures: Sequence[Picture]) -> Path:
    """As `write_report`, with the figures drawn already."""
    folder = Path(out_dir)
    claim(folder)
    try:
        for name in ("figures", "tables"):
            (folder / name).mkdir(exist_ok=True)
            for old in (folder / name).iterdir():
                if old.suffix in {".svg", ".png", ".csv"}:
                    old.unlink()
        (folder / MEASURES_NAME).write_text(measures_json(analysis), encoding="utf-8")
        for picture in pictures:
            picture.write(folder / "figures")
        for table in all_tables(analysis):
            table.write(folder / "tables")
        page = folder / PAGE_NAME
        page.write_text(html_page(analysis, pictures), encoding="utf-8")
    except OSError as error:
        raise AnalysisError(f"{folder}: cannot be written: {error.strerror or error}") from None
    return page


def claim(folder: Path) -> None:
    """Make the folder, or check that what it holds is an earlier report."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()) and not _is_report(folder):
            raise AnalysisError(f"{folder}: not empty and not an earlier report; choose another folder")
    except OSError as error:
        raise AnalysisError(f"{folder}: cannot be written: {error.strerror or error}") from None


def _is_report(folder: Path) -> bool:
    try:
        content = parse_json(read_text(folder / MEASURES_NAME, MOST_MEASURES_BYTES))
    except ValueError:
        return False
    return isinstance(content, dict) and content.get("format") == MEASURES_FORMAT


# ---- the page -------------------------------------------------------------------------------------------------------


def html_page(analysis: Analysis, pictures: Sequence[Picture]) -> str:
    """The whole page as text."""
    data, quality = analysis.data, analysis.data.quality
    titles = sorted({str(study["title"]) for study in data.studies.values() if "title" in study})
    title = titles[0] if titles else "Shared autonomy study"
    body = [
        f"<h1>{escape(title)}: analysis</h1>",
        f"<p class=lead>Data set “{escape(data.name)}”: {quality.participants} participants, "
        f"{quality.trials} completed trials, {len(data.measures.analysed_tasks())} tasks analysed, {quality.ticks:,} "
        "ticks. Conditions: "
        f"{escape(', '.join(name_of(analysis, c) for c in data.conditions))}.</p>",
        *_warnings(analysis),
        "<h2>Results</h2>",
        _results_table(analysis),
        "<p>Bold: <i>p</i> &lt; .05. The first line of a cell is the adjusted mean with its standard error, which the "
        "figures show too and the tests compare; the second is mean, standard deviation and number of the plain "
        "values.</p>",
        "<ul>",
        *(f"<li>{_sentence(analysis, comparison)}</li>" for comparison in analysis.comparisons),
        "</ul>",
        "<h2>Figures</h2>",
        *(_figure(picture, index) for index, picture in enumerate(pictures, 1)),
        *_missing_figures(pictures),
        "<h2>Pairwise comparisons</h2>",
        _pairs_table(analysis),
        "<h2>Models</h2>",
        *models_section(analysis),
        "<h2>Belief gain by number of candidate goals</h2>",
        _trend_table(analysis),
        "<h2>Tasks and windows</h2>",
        _counts_table(analysis),
        "<h2>Freed arms and time limits</h2>",
        *ended_section(analysis),
        "<h2>Data quality</h2>",
        *_quality(analysis),
        "<h2>Methods</h2>",
        *(f"<p>{escape(paragraph)}</p>" for paragraph in methods(analysis)),
        "<h2>Parameters</h2>",
        *_parameters(analysis),
    ]
    return (
        "<!doctype html>\n<html lang=en>\n<head>\n<meta charset=utf-8>\n"
        '<meta name=viewport content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}: analysis</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<main>\n"
        + "\n".join(body)
        + "\n</main>\n</body>\n</html>\n"
    )


_STYLE = """
:root { color-scheme: light; }
body { margin: 0; background: #fff; color: #1a1a1a; font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
main { max-width: 74rem; margin: 0 auto; padding: 2rem 1.5rem 4rem; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0 0 .5rem; }
h2 { font-size: 1.2rem; margin: 2.4rem 0 .6rem; padding-top: .6rem; border-top: 1px solid #ddd; }
h3 { font-size: 1rem; margin: 1.4rem 0 .4rem; }
.lead { color: #444; margin-top: 0; }
.note { border-left: 4px solid #b35900; background: #fff6ec; padding: .5rem .8rem; margin: .6rem 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .6rem 0 1rem; font-size: .86rem; font-variant-numeric: tabular-nums; }
th, td { padding: .28rem .7rem .28rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid #e5e5e5; }
thead th { border-bottom: 1.5px solid #333; font-weight: 600; }
td.n, th.n { text-align: right; white-space: nowrap; }
tr.sig td { font-weight: 600; }
figure { margin: 1.6rem 0; }
figure svg { max-width: 100%; height: auto; display: block; }
figcaption { font-size: .86rem; color: #333; max-width: 60rem; margin-top: .5rem; }
ul { padding-left: 1.2rem; max-width: 60rem; }
p { max-width: 60rem; }
li { margin: .3rem 0; }
.unit { color: #555; font-weight: 400; }
td:first-child { min-width: 8rem; }
code { font-size: .85em; }
@media print { main { max-width: none; padding: 0; } figure, table { break-inside: avoid; } }
"""


def _warnings(analysis: Analysis) -> list[str]:
    quality, found = analysis.data.quality, []
    if analysis.data.meta.get("simulated"):
        found.append("Simulated participants: these data were made by a model, not by people (see Methods).")
    for kind, count in quality.left_out_participants.items():
        found.append(f"{kind.capitalize()} participants left out: {count}.")
    if quality.complete_participants < quality.participants:
        some = quality.participants - quality.complete_participants
        found.append(f"{some} of {quality.participants} participants did not complete every condition.")
    places = {tuple(sorted(of.items())) for of in quality.position_counts.values()}
    if len(places) > 1:
        found.append("The order of conditions is not counterbalanced in these data (see Data quality).")
    if quality.missing_ticks:
        found.append(f"{quality.missing_ticks} ticks are missing from the tasks' ranges.")
    if not analysis.data.scores:
        found.append(
            "No survey answers: usability and workload are not reported. If surveys were given, export the data again "
            "when they are in; the study file's “surveys” turns them on."
        )
    for name, count in quality.missing_surveys.items():
        found.append(f"{name} is missing after {count} of {quality.trials} trials.")
    return [f"<p class=note>{escape(text)}</p>" for text in [*found, *quality.notes]]


def _results_table(analysis: Analysis) -> str:
    rows, marked = [], []
    for index, comparison in enumerate(analysis.comparisons):
        decimals = comparison.measure.decimals
        cells = [f"{escape(label_of(comparison))} <span class=unit>({escape(comparison.measure.unit)})</span>"]
        cells += [
            f"{adjusted(comparison, condition)}<br><span class=unit>{mean_sd(found, decimals)}, {found.n}</span>"
            for condition, found in comparison.summaries.items()
        ]
        anova = comparison.anova
        if isinstance(anova, NotFitted):
            cells += ["not fitted", "", ""]
        else:
            cells += [f_test(anova), p_value(anova.p), interval(anova.eta_squared, 2)]
            if anova.p < 0.05:
                marked.append(index)
        rows.append(cells)
    names = [
        f"{escape(name_of(analysis, c))}<br>adjusted mean (SE)<br><span class=unit>M (SD), n</span>"
        for c in analysis.data.conditions
    ]
    header = ["Measure", *names, "Condition", "p", "η²<sub>p</sub> [90 % CI]"]
    return table(header, rows, numbers=len(names) + 3, marked=marked)


def _sentence(analysis: Analysis, comparison: Comparison) -> str:
    """A result as it would stand in a paper."""
    head = f"<b>{escape(label_of(comparison))}.</b> "
    anova = comparison.anova
    if isinstance(anova, NotFitted):
        return head + f"Not tested: {escape(anova.reason)}."
    kind = "repeated measures"
    if not isinstance(comparison.model, RepeatedMeasures):
        kind = f"{' and '.join(anova.covariates) or 'nothing'} as random covariates"
    verdict = "Significant effect" if anova.p < 0.05 else "No significant effect"
    text = (
        f"{verdict} of condition, <i>F</i>{f_test(anova).removeprefix('F')}, "
        f"<i>p</i> {relation(anova.p)}, η²<sub>p</sub> = {interval(anova.eta_squared, 2)} ({kind})"
    )
    if isinstance(comparison.model, RepeatedMeasures):
        text += (
            f"; Greenhouse–Geisser ε = {comparison.model.epsilon:.2f}, corrected <i>p</i> "
            f"{relation(comparison.model.p_corrected)}"
        )
    pairs = [_pair_sentence(analysis, comparison, pair) for pair in comparison.pairs]
    text += ". " + ("Tukey HSD: " + "; ".join(pairs) + "." if pairs else "")
    if comparison.left_out:
        text += " " + escape(comparison.left_out)
    return head + text


def _pair_sentence(analysis: Analysis, comparison: Comparison, pair: Pair) -> str:
    names = name_of(analysis, pair.first), name_of(analysis, pair.second)
    where = "not different from"
    if pair.p < 0.05:
        where = "above" if pair.difference.value > 0 else "below"
    effect = ""
    if isinstance(pair.effect, Interval):
        effect = f", {_effect_name(pair)} = {interval(pair.effect, 2)}"
    return f"{escape(names[0])} {where} {escape(names[1])} (<i>p</i> {relation(pair.p)}{effect})"


def _effect_name(pair: Pair) -> str:
    return {"Hedges' g": "Hedges’ <i>g</i>", "d_z": "<i>d<sub>z</sub></i>"}[pair.effect_name]


def _figure(picture: Picture, index: int) -> str:
    return (
        f"<figure>{inline_svg(picture)}<figcaption><b>Figure {index}. {escape(picture.title)}.</b> "
        f"{escape(picture.caption)} <code>figures/{picture.name}.svg, .png</code></figcaption></figure>"
    )


def _missing_figures(pictures: Sequence[Picture]) -> list[str]:
    if any(picture.name == HEATMAP_NAME for picture in pictures):
        return []
    return [
        "<p class=note>The heatmaps of the paper's Fig. 2 are missing: the parameters logged with the trials are not "
        "those of this lab's arbiter.</p>"
    ]


def inline_svg(picture: Picture) -> str:
    """The drawing as part of a page: no prologue or metadata, ids that do not meet another figure's, a label."""
    svg = picture.svg[picture.svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'id="([A-Za-z0-9_.-]+)"', rf'id="{picture.name}-\1"', svg)
    svg = re.sub(r'="#([A-Za-z0-9_.-]+)"', rf'="#{picture.name}-\1"', svg)
    svg = re.sub(r"url\(#([A-Za-z0-9_.-]+)\)", rf"url(#{picture.name}-\1)", svg)
    # A third larger than in print, and never wider than the page.
    svg = re.sub(r'width="([0-9.]+)pt"', lambda of: f'style="width:{1.33 * float(of[1]):.1f}pt"', svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[0-9.]+pt"', r"\1", svg, count=1)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(picture.title, quote=True)}" ', 1)


def _pairs_table(analysis: Analysis) -> str:
    rows: list[tuple[str, ...]] = []
    marked: list[int] = []
    for comparison in analysis.comparisons:
        for pair in comparison.pairs:
            if pair.p < 0.05:
                marked.append(len(rows))
            effect = interval(pair.effect, 2) if isinstance(pair.effect, Interval) else escape(pair.effect.reason)
            rows.append(
                (
                    escape(label_of(comparison)),
                    f"{escape(name_of(analysis, pair.first))} − {escape(name_of(analysis, pair.second))}",
                    interval(pair.difference, comparison.measure.decimals),
                    p_value(pair.p),
                    f"{_effect_name(pair)} = {effect}",
                )
            )
    if not rows:
        return "<p>No comparison could be fitted.</p>"
    header = ("Measure", "Conditions", "Adjusted difference [95 % CI]", "p (Tukey)", "Effect size [95 % CI]")
    return table([escape(cell) for cell in header], rows, numbers=3, marked=marked)


def _trend_table(analysis: Analysis) -> str:
    counts = sorted({goals for trend in analysis.trends for goals in trend.by_goals})
    rows = []
    for trend in analysis.trends:
        cells = [escape(name_of(analysis, trend.condition))]
        for goals in counts:
            found = trend.by_goals.get(goals)
            cells.append(f"{mean_sd(found, 4)}, {found.n}" if found else "none")
        slope = trend.slope
        if isinstance(slope, NotFitted):
            cells += [escape(slope.reason), ""]
        else:
            cells += [interval(slope.per_unit, 4), p_value(slope.p)]
        rows.append(cells)
    header = ["Condition", *(f"{goals} goals<br>M (SD), n" for goals in counts), "Slope per goal [95 % CI]", "p"]
    return table(header, rows, numbers=len(header) - 1)


def _counts_table(analysis: Analysis) -> str:
    rows = []
    found = analysis.summarised
    for condition, of in found.items():
        for kind, title in KIND_TITLES.items():
            counts = of["tasks"][kind]["counts"]
            names: tuple[str, ...] = ("successes", "failures", "not_run", "analysed", "never_converged", "windows")
            names += ("windows_ended_by_user", "windows_above_entropy")
            rows.append((escape(name_of(analysis, condition)), title, *(str(counts[name]) for name in names)))
    header: tuple[str, ...] = (
        "Condition",
        "Tasks",
        "Successes",
        "Failures",
        "Not run",
        "Analysed",
        "Never converged",
        "Windows",
    )
    header += ("ended by user", f"of these H &gt; {GAIN_ENTROPY}")
    reasons = [
        f"{item.tasks} × {item.kind} under {name_of(analysis, item.condition)}: {item.reason.replace('_', ' ')}"
        for item in analysis.data.quality.failures
    ]
    text = "; ".join(reasons) if reasons else "none"
    return table(header, rows, numbers=8) + f"<p>Failures: {escape(text)}.</p>"


def _quality(analysis: Analysis) -> list[str]:
    quality = analysis.data.quality
    facts = [
        ("Participants", f"{quality.participants}, of whom {quality.complete_participants} completed every condition"),
        ("Participants left out", _counts(quality.left_out_participants)),
        ("Completed trials", str(quality.trials)),
        ("Trials left out", _counts(quality.trials_left_out)),
        ("Ticks of tasks", f"{quality.ticks:,}; {quality.missing_ticks} missing"),
        ("Pauses and lost connections", str(quality.pauses)),
        ("Ticks that started more than 50 ms late", str(quality.overruns)),
    ]
    positions = sorted({place for of in quality.position_counts.values() for place in of})
    order = [
        (escape(name_of(analysis, condition)), *(str(of.get(place, 0)) for place in positions))
        for condition, of in quality.position_counts.items()
    ]
    alerts = [
        (
            escape(name_of(analysis, item.condition)),
            str(item.raised),
            str(item.answered),
            str(item.correct),
            number(item.median_answer_s, 1) if item.median_answer_s is not None else "none",
        )
        for item in quality.alerts
    ]
    variances = [
        (escape(label_of(item)), p_value(item.equal_variance_p))
        for item in analysis.comparisons
        if item.equal_variance_p is not None
    ]
    return [
        table(("", ""), [(escape(name), escape(value)) for name, value in facts]),
        "<h3>Trials by place in the order</h3>",
        table(("Condition", *(f"place {place}" for place in positions)), order, numbers=len(positions)),
        "<h3>Distractor</h3>",
        table(("Condition", "Alerts", "Answered", "Correct", "Median answer (s)"), alerts, numbers=4),
        "<h3>Equal variances between conditions (Brown–Forsythe)</h3>",
        table(("Measure", "p"), variances, numbers=1) if variances else "<p>Could not be tested.</p>",
    ]


def _counts(found: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in found.items()) or "none"


def _parameters(analysis: Analysis) -> list[str]:
    parts = ["<h3>Arbiter, as logged with the trials</h3>"]
    sets: list[tuple[str, Mapping[str, Any]]] = [
        (name_of(analysis, condition) + (f" ({index})" if len(of) > 1 else ""), dict(settings(parameters)))
        for condition, of in analysis.data.parameters.items()
        for index, parameters in enumerate(of, 1)
    ]
    names = list(dict.fromkeys(name for _, of in sets for name in of))
    rows = [(f"<code>{escape(name)}</code>", *(escape(str(of.get(name, ""))) for _, of in sets)) for name in names]
    parts.append(table(("Parameter", *(escape(title) for title, _ in sets)), rows))
    for name, study in analysis.data.studies.items():
        kept = [
            (f"<code>{escape(key)}</code>", escape(value))
            for key, value in settings(study)
            if not key.startswith(("consent", "instructions", "texts", "demographics"))
        ]
        parts += [f"<h3>Study file {escape(name)}</h3>", table(("Setting", "Value"), kept)]
    parts.append(
        f"<p>Windows: at least {WINDOW_TICKS} ticks; entropy above {GAIN_ENTROPY} for belief gain; significance level "
        ".05.</p>"
    )
    return parts
