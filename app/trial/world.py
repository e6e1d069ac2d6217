"""A study held against this lab's world: its layout and objects as the robot takes them, and what it cannot reach.

The study file's layouts (`study.definition.layouts`) and the robot's (`sim.layouts`) meet here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from app.trial.parts import shelf
from sim.interface import Bin, Look, ObjectSpec, Rgb, SimError, Table
from sim.layouts import Layout, layout_problems
from sim.objects import WorldProblem, object_problems
from sim.view import wavefront
from sim.view.props import DRAWINGS
from study.definition.layouts import (
    LayoutInUse,
    LayoutObject,
    in_use,
    shipped_layouts,
    shipped_objects,
)
from study.definition.study import Study, drafted, load_study, parse_study
from study.definition.toml_reader import FieldPath, Problem, choices_sentence

FIELDS: Mapping[str, str] = {
    "places": "places_m",
    "practice_place": "practice_place_m",
    "start_world_m": "start_m",
    "center_xy_m": "center_m",
    "release_world_m": "release_m",
}
"""What a field of a robot's layout is called in the study file, where the names differ."""


def open_study(path: Path | None, trust: bool = False) -> Study:
    """The study file, or the paper's study, checked against this lab's world and its parts.

    `trust`: code in files beside it may run; else it becomes a part of the study all the same, but is not looked at.
    """
    return load_study(path, world=world_problems, shelf=shelf(trust))


def parse_text(text: str, name: str, trust: bool = False) -> Study:
    """The study of a file's text; `name` is what errors call it. Raises `StudyFileError`."""
    return parse_study(text, name=name, world=world_problems, shelf=shelf(trust))


def parse_stored(text: str, name: str) -> Study:
    """The study of a stored text, whose parts were looked at when it was stored: they may be gone by now, and whoever
    only reads what people agreed to needs none of them. Raises `StudyFileError`."""
    return parse_study(text, name=name, world=world_problems)


def layout_of(study: Study) -> Layout:
    """The layout of a checked study, with its objects."""
    return robot_layout(study.layout_in_use)


def drafted_layout(path: Path) -> Layout | None:
    """The layout of a study file that may have problems, for a picture of them; None when it cannot be read."""
    using = drafted(path)
    return None if using is None else robot_layout(using)


def layout_in(settings: Mapping[str, Any]) -> Layout:
    """The layout of a study file's unchecked data; the shipped `arc` with all objects that ship if it has none."""
    using = in_use(settings)
    return shipped_layout("arc") if using is None else robot_layout(using)


def shipped_layout(name: str) -> Layout:
    """A layout that ships, with every object that ships."""
    layout = shipped_layouts()[name]
    return robot_layout(LayoutInUse(layout, tuple(shipped_objects().values())))


def robot_layout(using: LayoutInUse) -> Layout:
    """The layout as the robot takes it."""
    layout = using.layout
    return Layout(
        name=layout.id,
        table=Table(layout.table.center_m, layout.table.size_m),
        places=layout.places_m,
        practice_place=using.practice_place_m,
        bins=tuple(
            Bin(
                id=item.id,
                label=item.label,
                center_xy_m=item.center_m,
                inner_size_m=item.inner_size_m,
                height_m=item.height_m,
                release_world_m=item.release_xyz_m,
                color_rgb=_rgb(item.color),
                letter=item.sign,
            )
            for item in layout.bins
        ),
        aisle_x_m=layout.aisle_x_m,
        objects=tuple(_spec(item, using.meshes) for item in using.objects),
        practice_object=_spec(using.practice_object, using.meshes),
        start_world_m=layout.start_m,
    )


def world_problems(using: LayoutInUse) -> Iterator[Problem]:
    """What the robot cannot reach or hold, and what cannot be drawn, in a layout of the study file."""
    own = {item.id: number for number, item in enumerate(using.layout.objects)}
    for problem in _problems(robot_layout(using)):
        if problem.place[-1:] == ("id",):
            continue  # ids that repeat are told already
        yield Problem(_path(problem, using, own), problem.sentence)
    chosen = {item.id for item in using.objects}
    for number, item in enumerate(using.layout.objects):
        place: FieldPath = ("objects", number)
        for found in object_problems(_spec(item, using.meshes)) if item.id not in chosen else ():
            yield Problem((*place, *found.place), found.sentence)
        if item.drawing and item.drawing not in DRAWINGS:
            yield Problem((*place, "drawing"), choices_sentence(item.drawing, DRAWINGS, "drawings"))
        if item.mesh in using.meshes:
            try:
                wavefront.read_obj(using.meshes[item.mesh], _rgb(item.color))
            except SimError as error:
                yield Problem((*place, "mesh"), str(error))


@lru_cache(maxsize=32)
def _problems(layout: Layout) -> tuple[WorldProblem, ...]:
    return layout_problems(layout)


def _path(problem: WorldProblem, using: LayoutInUse, own: Mapping[str, int]) -> FieldPath:
    """Where in the layout's table the problem stands."""
    if problem.place[:1] == ("objects",):
        _, number, *field = problem.place
        return ("objects", own[using.objects[int(number)].id], *field)
    path = tuple(FIELDS.get(part, part) if isinstance(part, str) else part for part in problem.place)
    if path[-1:] == ("release_m",) and using.layout.bins[int(path[1])].release_m is None:
        return (*path[:-1], "center_m")  # it follows from there
    return path


def _spec(item: LayoutObject, meshes: Mapping[str, str]) -> ObjectSpec:
    return ObjectSpec(
        id=item.id,
        label=item.label,
        shape=item.shape,
        size_m=item.size_m,
        mass_kg=item.mass_kg,
        friction=item.friction,
        grasp_height_m=item.grasp_m,
        look=Look(_rgb(item.color), item.drawing, meshes.get(item.mesh, "")),
    )


def _rgb(color: str) -> Rgb:
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)
