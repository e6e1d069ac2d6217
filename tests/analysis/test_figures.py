"""The figures: everything that should be seen is in them, in any data set, the same bytes each time."""

from __future__ import annotations

import re
import struct
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest

from app.report.figure2 import fig2_heatmap, heatmap_of
from study.analysis.analysis import Analysis, analyse
from study.analysis.dataset import load
from study.analysis.figures import Picture, draw_all, looks, objective_figure, stars
from tests.support.analysis_samples import Wanted, data_set

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def analysis(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    return analyse(load(data_set(6).write(tmp_path_factory.mktemp("export"))))


@pytest.fixture(scope="module")
def pictures(analysis: Analysis) -> dict[str, Picture]:
    return {picture.name: picture for picture in draw_all(analysis, heatmap_of(analysis.data))}


def texts(picture: Picture) -> list[str]:
    return [element.text or "" for element in ET.fromstring(picture.svg).iter("{http://www.w3.org/2000/svg}text")]


def size_mm(picture: Picture) -> tuple[float, float]:
    root = ET.fromstring(picture.svg)
    width, height = (float(root.attrib[name].removesuffix("pt")) / 72.0 * 25.4 for name in ("width", "height"))
    return width, height


def test_every_figure_of_the_report_is_there(pictures: dict[str, Picture]) -> None:
    assert list(pictures) == [
        "fig3_objective_measures", "fig4_gain_by_goals", "fig5_surveys", "fig6_window_rate", "fig2_heatmaps",
    ]  # fmt: skip
    assert all(picture.caption.endswith(".") for picture in pictures.values())


def test_the_objective_figure_names_conditions_by_letter_and_marks_what_differs(pictures: dict[str, Picture]) -> None:
    found = texts(pictures["fig3_objective_measures"])
    assert [text for text in found if text.startswith("(")] == [
        "(A) Belief accuracy gain after windows", "(B) Belief convergence speed", "(C) Total task efficiency",
    ]  # fmt: skip
    assert [found.count(letter) for letter in "TGB"] == [6, 6, 6]  # three panels, pickups and all tasks
    assert {"T  pure teleoperation", "G  goal-oriented", "B  balanced"} <= set(found)
    assert "****" in found
    assert {"gain in b(instructed goal)", "user actions", "task length (ticks of 0.5 s)"} <= set(found)


def test_individual_participants_are_visible(pictures: dict[str, Picture]) -> None:
    # Six participants, each with an open mark in 3 panels x 2 groups x 3 conditions, and nobody hides behind a mean.
    marks = re.findall(r"<use [^>]*stroke-opacity: 0.8", pictures["fig3_objective_measures"].svg)
    assert len(marks) == 6 * 18


def test_trend_panels_count_their_windows(pictures: dict[str, Picture]) -> None:
    found = texts(pictures["fig4_gain_by_goals"])
    assert found.count("n = 36") == 3 and found.count("n = 12") == 9
    assert found.count("candidate goals") == 3


def test_figures_fit_a_page_and_their_text_is_text(pictures: dict[str, Picture]) -> None:
    for picture in pictures.values():
        width, height = size_mm(picture)
        assert 60.0 <= width <= 180.5
        assert 40.0 <= height <= 120.0
        assert len(texts(picture)) > 5
        sizes = [float(size) for size in re.findall(r"font(?:-size)?: ([0-9.]+)px", picture.svg)]
        assert sizes and min(sizes) >= 5.5


def test_pngs_have_300_dots_an_inch(pictures: dict[str, Picture]) -> None:
    for picture in pictures.values():
        assert picture.png.startswith(b"\x89PNG")
        width = struct.unpack(">I", picture.png[16:20])[0]
        assert width == pytest.approx(size_mm(picture)[0] / 25.4 * 300, abs=2)


def test_the_same_data_give_the_same_bytes(analysis: Analysis, pictures: dict[str, Picture]) -> None:
    again = objective_figure(analysis)
    assert again == pictures["fig3_objective_measures"]
    assert "<dc:date>" not in again.svg


def test_nothing_in_a_figure_is_loaded_from_elsewhere(pictures: dict[str, Picture]) -> None:
    for picture in pictures.values():
        for reference in re.findall(r'(?:href|src)="([^"]*)"', picture.svg):
            assert reference.startswith(("#", "data:image/png;base64,")), reference


def test_conditions_differ_in_more_than_colour() -> None:
    found = looks(["teleoperation", "goal_oriented", "balanced", "goal_blended", "brisk", "17"])
    for attribute in ("colour", "marker", "letter"):
        values = [getattr(look, attribute) for look in found.values()]
        assert len(set(values)) == len(values), attribute


def test_stars_are_the_papers() -> None:
    assert [stars(p) for p in (0.05, 0.049, 0.0099, 0.00099, 0.000099)] == ["", "*", "**", "***", "****"]


def test_data_without_values_or_differences_still_make_figures(tmp_path: Path) -> None:
    """No window, no convergence, no survey, all tasks equally long."""
    data = data_set(2, wanted=lambda *_: Wanted(12, None), surveys=False)
    found = draw_all(analyse(load(data.write(tmp_path / "export"))), None)
    assert [picture.name for picture in found] == ["fig3_objective_measures", "fig4_gain_by_goals", "fig6_window_rate"]
    assert texts(found[0]).count("no values") == 4  # gain and convergence, pickups and all tasks


# ---- Fig. 2 ---------------------------------------------------------------------------------------------------------


def test_the_heatmap_states_what_it_was_computed_with() -> None:
    transition = {"kind": "replan", "step_m": 0.03, "planning_delay": 0.8}
    heatmap = fig2_heatmap({"layout": "rows"}, {"rationality_per_m": 8.0, "transition": transition})
    for stated in ("“rows”", "κ = 8 per metre", "step 0.03 m", "“replan”", "delay 0.8"):
        assert stated in heatmap.caption


def test_no_heatmap_of_parameters_that_are_not_ours(analysis: Analysis) -> None:
    odd = replace(analysis.data, parameters={"balanced": ({"transition": {"kind": "teleport"}},)})
    assert heatmap_of(odd) is None
