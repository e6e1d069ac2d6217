"""The report: one page that stands alone, numbers that agree with each other, and a command line that explains."""

from __future__ import annotations

import csv
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from app.__main__ import main
from study.analysis.method_text import degrees, mean_sd, number, p_value
from study.analysis.summaries import Summary
from tests.support.analysis_samples import Wanted, data_set

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return data_set(6).write(tmp_path_factory.mktemp("export"))


@pytest.fixture(scope="module")
def report(export: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out") / "report"
    assert main(["analyze", str(export), "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def report_of_nothing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of simulated people in whose data nothing differs."""
    folder = tmp_path_factory.mktemp("nothing")
    data_set(2, wanted=lambda *_: Wanted(12, None), surveys=False).write(folder / "export")
    meta = folder / "export" / "meta.json"
    told = {**json.loads(meta.read_text()), "simulated": {"seed": 7, "robot": "kinematic"}}
    meta.write_text(json.dumps(told))
    assert main(["analyze", str(folder / "export"), "--out", str(folder / "report"), "--changed"]) == 0
    return folder / "report"


class _Page(HTMLParser):
    """Collects text, ids, references and whether tags are balanced."""

    VOID = frozenset({"meta", "br", "img", "link", "input", "hr"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.headings: list[str] = []
        self.parts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in {"src", "href", "xlink:href"}:
                self.references.append(value or "")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.parts.append(data)
        if self.open and self.open[-1] in {"h1", "h2", "h3"}:
            self.headings.append(data)


def read_page(folder: Path) -> tuple[_Page, str]:
    page = _Page()
    page.feed((folder / "report.html").read_text(encoding="utf-8"))
    assert page.open == []
    return page, re.sub(r"\s+", " ", "".join(page.parts))


def rows(folder: Path, table: str) -> list[dict[str, str]]:
    with (folder / "tables" / f"{table}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_page_stands_alone(report: Path) -> None:
    page, _ = read_page(report)
    text = (report / "report.html").read_text(encoding="utf-8")
    assert all(reference.startswith(("#", "data:")) for reference in page.references)
    assert "<script" not in text and "@import" not in text
    assert not re.findall(r"url\((?!#)", text)
    assert len(page.ids) == len(set(page.ids)), "two figures share an id"
    assert {reference[1:] for reference in page.references if reference.startswith("#")} <= set(page.ids)
    assert text.count("<figure>") == 5 and text.count("<svg ") == 5


def test_the_page_has_every_section(report: Path) -> None:
    page, text = read_page(report)
    assert page.headings[0] == "Moving objects with a robot arm: analysis"
    for heading in ("Results", "Figures", "Pairwise comparisons", "Models", "Tasks and windows", "Data quality"):
        assert heading in page.headings
    assert "6 participants, 18 completed trials, 108 tasks analysed" in text
    assert "nan" not in re.findall(r"\b\w+\b", text.lower())


def test_the_methods_state_every_parameter(report: Path) -> None:
    _, text = read_page(report)
    numbers = ("alpha = 250", "rationality_per_m = 5", "transition.step_m = 0.05", "robot.speed_m_s = 0.03425")
    rules = ("distractor.every_s = 20", "at least 5 consecutive ticks", "above 0.7", "Brooke", "Hart")
    for parameter in (*numbers, *rules):
        assert parameter in text


def test_measures_json_is_the_summary_of_the_rows(report: Path) -> None:
    content = json.loads((report / "measures.json").read_text())
    assert set(content["conditions"]) == {"teleoperation", "goal_oriented", "balanced"}
    for condition, found in content["conditions"].items():
        for kind in ("pickup", "dropoff"):
            ticks = [
                float(row["efficiency_ticks"])
                for row in rows(report, "tasks")
                if (row["condition"], row["kind"]) == (condition, kind)
            ]
            assert found["tasks"][kind]["efficiency_ticks"]["n"] == len(ticks) == 18
            assert found["tasks"][kind]["efficiency_ticks"]["mean"] == pytest.approx(sum(ticks) / 18)
        assert found["surveys"]["tlx_raw"]["n"] == 6


def test_page_tables_and_json_agree(report: Path) -> None:
    _, text = read_page(report)
    content = json.loads((report / "measures.json").read_text())["conditions"]
    for row in rows(report, "descriptives"):
        if row["measure"] == "efficiency_ticks":
            found = content[row["condition"]]["tasks"][row["tasks"]]["efficiency_ticks"]
            assert float(row["mean"]) == found["mean"]
            assert f"{found['mean']:.1f} ({found['sd']:.1f}), {found['n']}" in text
    tested = rows(report, "anova")
    for row in tested:
        assert f"F({row['df_effect']}, {degrees(float(row['df_error']))}) = {float(row['F']):.2f}" in text
    assert len(rows(report, "pairwise")) == 3 * sum(row["reported"] == "1" for row in tested)
    assert {row["model"] for row in tested if row["reported"] == "1"} == {"random covariates", "repeated measures"}
    for row in rows(report, "adjusted_means"):
        if row["measure"] == "belief_gain" and row["reported"] == "1":
            assert f"{number(float(row['adjusted_mean']), 4)} ({float(row['se']):.4f})" in text
    listed = json.loads((report / "measures.json").read_text())["comparisons"]
    assert sum(item["table"] == "adjusted_means" for item in listed) == 3 * 10


def test_every_column_of_a_result_is_described(report: Path) -> None:
    described = {(row["table"], row["column"]) for row in rows(report, "columns") if row["description"]}
    for table in ("descriptives", "anova", "adjusted_means", "pairwise"):
        assert {(table, column) for column in rows(report, table)[0]} <= described


def test_the_page_says_which_model_is_the_papers(report: Path) -> None:
    _, text = read_page(report)
    assert "condition order and task goal as random covariates" in text
    assert "fixed categories, which is not what the paper states" in text
    assert "follow the paper" not in text


def test_figures_and_tables_are_files_too(report: Path) -> None:
    figures = {path.name for path in (report / "figures").iterdir()}
    names = ("fig2_heatmaps", "fig3_objective_measures", "fig4_gain_by_goals", "fig5_surveys", "fig6_window_rate")
    drawn = {f"{name}.{ending}" for name in names for ending in ("svg", "png")}
    assert figures == drawn | {"fig2_heatmaps.csv"}, "a map's values are in no table"
    tables = {path.stem for path in (report / "tables").iterdir()}
    assert {"tasks", "windows", "window_rates", "survey_scores", "anova", "pairwise", "adjusted_means"} <= tables


def test_an_earlier_report_is_replaced_by_the_same_bytes(export: Path, report: Path) -> None:
    before = {path: path.read_bytes() for path in sorted(report.rglob("*")) if path.is_file()}
    (report / "figures" / "fig9_old.svg").write_text("old")
    assert main(["analyze", str(export), "--out", str(report)]) == 0
    assert {path: path.read_bytes() for path in sorted(report.rglob("*")) if path.is_file()} == before


def test_models_that_cannot_be_fitted_are_reported(report_of_nothing: Path) -> None:
    _, text = read_page(report_of_nothing)
    assert "Not tested: all 36 values are equal (12): there is no variance to analyse." in text
    assert "Not tested: there are no values." in text
    assert "No survey answers" in text
    assert "not counterbalanced" in text
    content = json.loads((report_of_nothing / "measures.json").read_text())
    assert content["conditions"]["balanced"]["tasks"]["all"]["belief_gain"] == {"n": 0, "mean": None, "sd": None}
    assert all(row["not_fitted_because"] for row in rows(report_of_nothing, "anova"))


def test_simulated_data_are_called_simulated(report: Path, report_of_nothing: Path) -> None:
    assert "Simulated participants" not in read_page(report)[1]
    _, text = read_page(report_of_nothing)
    assert "Simulated participants" in text and "seed = 7" in text


@pytest.mark.parametrize("out", ["full", "file"])
def test_a_folder_that_holds_something_else_is_left_alone(
    export: Path, tmp_path: Path, out: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    (tmp_path / "file").write_text("mine")
    assert main(["analyze", str(export), "--out", str(tmp_path / out)]) == 1
    error = capsys.readouterr().err
    assert error.startswith("salab: ") and error.count("\n") == 1
    assert (tmp_path / "full" / "thesis.txt").read_text() == "mine"


def test_bad_data_are_one_line_and_leave_no_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["analyze", str(tmp_path / "nowhere"), "--out", str(tmp_path / "report")]) == 1
    assert capsys.readouterr().err.startswith("salab: ")
    assert not (tmp_path / "report").exists()


def test_numbers_are_written_as_in_a_paper() -> None:
    assert [p_value(p) for p in (0.00001, 0.0004, 0.0412, 0.5, 0.99999)] == [
        "<\N{NO-BREAK SPACE}.0001", "<\N{NO-BREAK SPACE}.001", ".041", ".500", "1.000",
    ]  # fmt: skip
    assert (number(-0.04, 2), number(-0.0004, 2)) == ("−0.04", "0.00")
    assert mean_sd(Summary(1, 2.0, None), 1) == "2.0 (one value)"
    assert mean_sd(Summary(0, None, None), 1) == "no values"
