"""A layout of one's own, docs/examples/05_layout: checked, drawn, simulated, seen, and live in lockstep."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.__main__ import main
from app.report.figure2 import fig2_heatmap
from app.simulated.participant import Case, Record, simulate_participant, simulate_trial
from app.simulated.traits import OFF, Population
from app.trial.robots import make_robot
from app.trial.setup import StudySetup, study_setup
from app.trial.world import open_study
from sim.interface import Pose
from sim.layouts import scene
from sim.view import props
from sim.view.looks import own_look
from sim.view.meshes import to_glb
from sim.view.scene import SceneView
from study.definition.toml_reader import parse_toml
from study.export.export import read_table
from tests.sim.view.test_meshes import box_of
from tests.support.lab_server import LabServer
from tests.support.wire_client import invite

STUDY = Path(__file__).resolve().parents[2] / "docs" / "examples" / "05_layout" / "study.toml"
OBJECTS = ("mug", "cereal", "milk", "soup", "jam", "pepper", "tea", "detergent")
ORDER = ("goal_oriented", "teleoperation")


@cache
def setup() -> StudySetup:
    return study_setup(open_study(STUDY))


def case(seed: int) -> Case:
    return Case(setup(), 0, seed, ORDER)


def test_check_finds_it_fine_and_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("study.toml", "kitchen.toml", "mug.obj"):
        (tmp_path / name).write_bytes(STUDY.with_name(name).read_bytes())
    assert main(["check", str(tmp_path / "study.toml")]) == 0
    fine, _, drawn = capsys.readouterr().out.splitlines()
    assert fine.startswith(f"{tmp_path / 'study.toml'}: fine. 2 conditions in 2 orders; 2 trials with 6 tasks each")
    assert drawn == f"layout 'kitchen' is drawn in {tmp_path / 'study.layout.png'}"
    with Image.open(tmp_path / "study.layout.png") as picture:
        colors = {rgb for _, rgb in picture.convert("RGB").getcolors(maxcolors=1 << 24) or ()}
    in_use = setup().layout
    assert {spec.look.color_rgb for spec in in_use.objects} <= colors


def test_a_layout_with_a_mistake_is_drawn_as_well_where_one_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("study.toml", "kitchen.toml", "mug.obj"):
        text = STUDY.with_name(name).read_text(encoding="utf-8").replace("[0.875, 0.326]", "[0.9, 0.42]")
        (tmp_path / name).write_text(text, encoding="utf-8")
    picture = tmp_path / "somewhere.svg"
    assert main(["check", str(tmp_path / "study.toml"), "--picture", str(picture)]) == 1
    said = capsys.readouterr()
    assert said.out == f"layout 'kitchen' is drawn in {picture}\n"
    assert "place 2 is out of the arm's reach" in said.err
    assert "#c22727" in picture.read_text(encoding="utf-8"), "the place with a problem is red"
    assert main(["check", str(STUDY), "--picture", "kitchen.jpg"]) == 1
    assert "a picture's name ends in .png, .svg, .pdf" in capsys.readouterr().err
    assert main(["check", str(STUDY), "--picture", str(tmp_path / "no" / "kitchen.png")]) == 1
    assert "kitchen.png: cannot be written: No such file or directory" in capsys.readouterr().err


@cache
def simulated() -> Record:
    return simulate_participant(case(3), partial(make_robot, "kinematic"))


def test_a_simulated_person_moves_its_objects_into_its_bins() -> None:
    tasks = simulated()["tasks"]
    assert [row.outcome for row in tasks] == ["success"] * 12
    assert {row.goal for row in tasks if row.kind == "dropoff"} == {"cupboard", "recycling"}
    assert {row.goal for row in tasks if row.kind == "pickup"} <= set(OBJECTS)
    beliefs = [set(json.loads(row.belief)) for row in simulated()["ticks"] if row.belief]
    assert set(OBJECTS) in beliefs and {"cupboard", "recycling"} in beliefs
    assert {row.layout for row in simulated()["trials"]} == {"kitchen"}
    assert all(sorted(json.loads(row.placement)) == sorted(OBJECTS) for row in simulated()["trials"])


@pytest.mark.bullet
@pytest.mark.slow
def test_with_physics_it_holds_carries_and_drops_them() -> None:
    steady = replace(case(3), population=Population(OFF))  # who drops or knocks over nothing by mistake
    tasks = simulate_trial(steady, 1, partial(make_robot, "bullet"))["tasks"]
    assert [row.outcome for row in tasks] == ["success"] * 6


def test_its_objects_are_drawn_at_their_size_and_stay_in_the_bins() -> None:
    layout = setup().layout
    for spec in layout.objects:
        np.testing.assert_allclose(box_of(props.object_mesh(spec)), spec.size_m, atol=1e-9)
        assert len(to_glb(props.object_mesh(spec))) < 150_000, "what eight of them cost a browser"
    for item in layout.bins:
        blank = replace(item, letter="")
        assert len(props.bin_mesh(item).faces) > len(props.bin_mesh(blank).faces), "its letter is on it"
    with SceneView(look=own_look()) as view:
        view.open()
        view.show(scene(layout, OBJECTS, OBJECTS[1:]), {"mug": Pose((0.51, 0.48, 0.05))})
        assert {f"/object/{name}" for name in OBJECTS} <= set(view.server.nodes)


def test_the_papers_heatmap_has_its_objects() -> None:
    settings, _ = parse_toml(setup().study.source_text.encode(), "study.toml")
    figure = fig2_heatmap(settings, {})
    assert len(figure.goals) == 8
    assert "Layout “kitchen”" in figure.caption
    assert (figure.goals[0].x_m, figure.goals[0].y_m) == setup().layout.places[0]


@pytest.mark.slow
def test_it_runs_live_in_lockstep(start_lab: Callable[..., LabServer], tmp_path: Path) -> None:
    text = setup().study.source_text.replace("pickups_per_trial = 3", "pickups_per_trial = 1", 1)
    (tmp_path / "alone.toml").write_text(text, encoding="utf-8")  # as it is stored: no other file is needed
    lab = start_lab("--robot", "kinematic", "--pace", "lockstep", "--no-scene", "--study", str(tmp_path / "alone.toml"))
    assert main(["bot", "--url", invite(lab)["link"], "--quiet"]) == 0
    out = tmp_path / "out"
    assert main(["export", "--data", str(lab.data_dir), "--out", str(out)]) == 0
    tasks = read_table(out, "tasks")
    assert [row.outcome for row in tasks] == ["success"] * 4
    assert {row.layout for row in read_table(out, "trials")} == {"kitchen"}
    assert (out / "study.toml").read_text(encoding="utf-8") == text


@pytest.mark.slow
def test_the_export_and_the_report_need_no_other_file(tmp_path: Path) -> None:
    people = ["--participants", "2", "--seed", "1"]
    assert main(["simulate", "--study", str(STUDY), *people, "--out", str(tmp_path / "out")]) == 0
    assert main(["analyze", str(tmp_path / "out"), "--out", str(tmp_path / "report")]) == 0
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert re.search(r"Layout “kitchen”", page)
