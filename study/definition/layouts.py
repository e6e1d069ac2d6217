"""Layouts and objects: the shipped ones, and a study's own.

A name in `layout` that does not ship stands for a layout of the study's own: a file `NAME.toml` beside the study file,
or a table `[[layouts]]` in it. The file, and the mesh files that its objects name, are copied into the study's text
when the study is loaded, so that the text and its hash hold everything: stored, exported and run again, a study needs
no other file.

What is known here is what a file says. Whether the robot can reach and hold it, the simulated world knows: it answers
for a `LayoutInUse` (`study.load_study` takes the question along).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, Union

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from study.definition.field_types import Identifier, Label, Part, Text, number
from study.definition.toml_reader import FieldPath, Problem, model_problems, parse_toml, report, tables
from study.text_file import read_text

HERE = Path(__file__).parent
PRACTICE_OBJECT = "practice_block"
PRACTICE_AHEAD_M, PRACTICE_ASIDE_M = (0.82, 0.0), (0.80, 0.20)
PRACTICE_EDGE_M = 0.05
"""What anything's middle keeps from the table's edge: where a table begins farther out, so does practice."""
MOST_MESH_BYTES = 1_000_000
STEEL = "#969ea6"
FRICTION = 0.65
"""Of an object's surface; physics multiplies it by the finger's 1.0 and the table's 0.8."""
RELEASE_Z_M = 0.90


def _numbers(names: str, low: float, high: float) -> BeforeValidator:
    """So many finite numbers within the bounds, in metres."""
    words = f"must be a list of {len(names)} numbers, [{', '.join(names)}] in metres, each from {low:g} to {high:g}"

    def checked(value: object) -> object:
        entries = value if isinstance(value, (list, tuple)) else ()
        fine = [
            isinstance(entry, (int, float)) and not isinstance(entry, bool) and low <= entry <= high
            for entry in entries
        ]
        if len(entries) == len(names) and all(fine):
            return value
        raise PydanticCustomError("numbers", "{words}", {"words": words})

    return BeforeValidator(checked)


PointXY = Annotated[tuple[float, float], _numbers("xy", -2.0, 2.0)]
PointXYZ = Annotated[tuple[float, float, float], _numbers("xyz", -2.0, 2.0)]
SizeXY = Annotated[tuple[float, float], _numbers("xy", 0.01, 1.0)]
SizeXYZ = Annotated[tuple[float, float, float], _numbers("xyz", 0.01, 2.0)]
ObjectSize = Annotated[tuple[float, float, float], _numbers("xyz", 0.02, 0.3)]


def _color(value: object) -> object:
    if isinstance(value, str) and re.match(r"#[0-9a-fA-F]{6}\Z", value):
        return value
    raise PydanticCustomError("color", 'must be a colour such as "#0072b2"')


def _mesh_name(value: object) -> object:
    if isinstance(value, str) and (value == "" or re.match(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,60}\.obj\Z", value)):
        return value
    raise PydanticCustomError("mesh", 'must be the name of an OBJ file beside this file, such as "mug.obj"')


def _letter(value: object) -> object:
    if isinstance(value, str) and re.match(r"[A-Z0-9]?\Z", value):
        return value
    raise PydanticCustomError("letter", 'must be one of A to Z or 0 to 9, or "" for none')


Color = Annotated[str, BeforeValidator(_color)]
MeshName = Annotated[str, BeforeValidator(_mesh_name)]
Letter = Annotated[str, BeforeValidator(_letter)]


class LayoutTable(Part):
    """The table: a box whose top face is the work surface. `arc`'s when left out."""

    center_m: PointXYZ = (0.90, 0.0, 0.71)
    """Its middle: x forward from the robot's base, y to its left, z up."""
    size_m: SizeXYZ = (0.40, 1.16, 0.04)
    """Its length along x, y and z."""


class LayoutBin(Part):
    """An open box on the floor. `arc`'s two when none is given."""

    id: Identifier
    """Its name in `bins` and in the data."""
    label: Label
    """What the participant reads, such as "left bin"."""
    center_m: PointXY
    """The middle of its floor, x and y."""
    inner_size_m: SizeXY = (0.30, 0.30)
    """Its opening along x and y."""
    height_m: float = number(default=0.45, ge=0.05, le=1.0)
    """Of its rim, above the floor."""
    release_m: Union[PointXYZ, None] = None  # noqa: UP007
    """Where the gripper lets go; 0.90 m above the middle of the bin's floor when left out."""
    color: Color = STEEL
    """What it is painted with."""
    letter: Union[Letter, None] = None  # noqa: UP007
    """What is written on it: A to Z or 0 to 9; the label's first when left out."""

    @property
    def release_xyz_m(self) -> tuple[float, float, float]:
        """Where the gripper lets go."""
        return (*self.center_m, RELEASE_Z_M) if self.release_m is None else self.release_m

    @property
    def sign(self) -> str:
        """What is written on it."""
        first = self.label[0].upper()
        return self.letter if self.letter is not None else first if re.match(r"[A-Z0-9]", first) else ""


class LayoutObject(Part):
    """An object of the layout's own; `objects` of the study names it, beside those that ship. It has to be one that the
    robot can pick up."""

    id: Identifier
    """Its name in `objects` and in the data."""
    label: Label
    """What the participant reads, such as "spray bottle"."""
    shape: Literal["cylinder", "box"]
    """What physics takes it for; it stands upright."""
    size_m: ObjectSize
    """Its length along x, y and z; a cylinder is as long as it is wide."""
    mass_kg: float = number(ge=0.05, le=3.0)
    """What it weighs."""
    friction: float = number(default=FRICTION, ge=0.1, le=1.0)
    """Of its surface; the fingers' own is 1."""
    grasp_height_m: Union[float, None] = number(default=None, ge=0.0, le=0.3)  # noqa: UP007
    """Height above its base at which the fingers close; 0.11 m, or 2 cm below a lower top, when left out."""
    color: Color = STEEL
    """What it is drawn in."""
    mesh: MeshName = ""
    """A Wavefront OBJ file beside this file, z up, that is drawn in the object's place, stretched to its size. Physics
    keeps the shape."""
    drawing: Annotated[str, Field(strict=True)] = ""
    """Draws it as one of the objects that ship, by that one's id, in its colours."""

    @property
    def grasp_m(self) -> float:
        """Height above its base at which the fingers close."""
        return round(min(0.11, self.size_m[2] - 0.02), 6) if self.grasp_height_m is None else self.grasp_height_m


class LayoutFile(Part):
    """A layout as its own file holds it; its id is the file's name."""

    places_m: Annotated[tuple[PointXY, ...], Field(min_length=1, max_length=40)]
    """Where objects may stand on the table, x and y of each; any object on any of them."""
    practice_place_m: PointXY | None = None
    """Where the practice object stands; left out = ahead of the arm, or to the side with `practice_task = "round"`."""
    aisle_x_m: float = number(default=0.67, ge=0.0, le=2.0)
    """Where an object is carried sideways, in front of all that stands."""
    start_m: PointXYZ = (0.70, 0.0, 0.88)
    """Where the gripper begins."""
    table: LayoutTable = LayoutTable()
    bins: Annotated[tuple[LayoutBin, ...], Field(min_length=2)] = (
        LayoutBin(id="left_bin", label="left bin", center_m=(0.52, 0.48), color="#0072b2"),
        LayoutBin(id="right_bin", label="right bin", center_m=(0.52, -0.48), color="#e68c00"),
    )
    objects: tuple[LayoutObject, ...] = ()


class LayoutSection(LayoutFile):
    """A layout of the study's own. `kitchen.toml` beside the study file has the same keys but for `id`, and its tables
    are called `[table]`, `[[bins]]` and `[[objects]]` there. Lengths are metres: x forward from the robot's base, y to
    its left, z up from the floor."""

    id: Identifier
    """Its name in `layout`."""


class MeshFile(Part):
    """A mesh file that stood beside the study file when it was loaded. Nobody writes this by hand."""

    file: MeshName
    """The name that an object's `mesh` gives."""
    text: Text
    """What stood in it."""


class _ShippedObjects(Part):
    objects: tuple[LayoutObject, ...]


@dataclass(frozen=True)
class LayoutInUse:
    """A layout with everything that stands on it: what the simulated world is made from, and asked about."""

    layout: LayoutSection
    objects: tuple[LayoutObject, ...]
    """The study's, in its order."""
    meshes: Mapping[str, str] = field(default_factory=dict)
    """Text of each mesh file, by name."""
    practice_object: LayoutObject = field(default_factory=lambda: practice_object())
    practised_aside: bool = False
    """Whether practice asks for a way to the side, as the rounds do."""

    @property
    def practice_place_m(self) -> tuple[float, float]:
        """Where the practice object stands, x and y."""
        if self.layout.practice_place_m is not None:
            return self.layout.practice_place_m
        x_m, y_m = PRACTICE_ASIDE_M if self.practised_aside else PRACTICE_AHEAD_M
        front_m = self.layout.table.center_m[0] - self.layout.table.size_m[0] / 2.0
        least_m = front_m + PRACTICE_EDGE_M
        return (x_m if x_m >= least_m - 1e-9 else round(least_m + 0.001, 6)), y_m


WorldCheck = Callable[[LayoutInUse], Iterable[Problem]]
"""Tells what is wrong with a layout in the robot's world; paths begin inside the layout's table."""


@cache
def shipped_layouts() -> Mapping[str, LayoutSection]:
    """The layouts there are, by name."""
    found = {}
    for file in sorted((HERE / "shipped_layouts").glob("*.toml")):
        data = _shipped(file, LayoutFile)
        found[file.stem] = LayoutSection.model_validate({"id": file.stem, **data})
    return MappingProxyType(found)


@cache
def shipped_objects() -> Mapping[str, LayoutObject]:
    """The objects there are, by id, without the one to practise with."""
    return MappingProxyType({name: item for name, item in all_shipped_objects().items() if name != PRACTICE_OBJECT})


def practice_object() -> LayoutObject:
    """What participants practise with."""
    return all_shipped_objects()[PRACTICE_OBJECT]


@cache
def all_shipped_objects() -> Mapping[str, LayoutObject]:
    """The objects there are and the one to practise with, by id."""
    data = _shipped(HERE / "shipped_objects.toml", _ShippedObjects)
    return MappingProxyType({item.id: item for item in _ShippedObjects.model_validate(data).objects})


def _shipped(file: Path, model: type[Part]) -> dict[str, Any]:
    data, text = parse_toml(file.read_bytes(), file.name)
    problems = model_problems(model, data)
    if problems:
        raise report(file.name, text, data, problems)
    return data


def own_layouts(data: Mapping[str, Any]) -> dict[str, tuple[int, Mapping[str, Any]]]:
    """The layouts that stand in a study file's unchecked data, by id: where, and their own unchecked data."""
    entries = data.get("layouts")
    found: dict[str, tuple[int, Mapping[str, Any]]] = {}
    for position, entry in enumerate(entries if isinstance(entries, list) else ()):
        if isinstance(entry, dict) and isinstance(entry.get("id"), str):
            found.setdefault(entry["id"], (position, entry))
    return found


def in_use(data: Mapping[str, Any]) -> LayoutInUse | None:
    """The layout that a study file's unchecked data chooses, with its objects; None when the layout cannot be read.

    Objects that are not known, or that the file does not name, are left out; without any, all that ship stand there.
    """
    name = data.get("layout")
    _, entry = own_layouts(data).get(str(name), (0, None))
    if entry is not None and model_problems(LayoutSection, entry):
        return None
    layout = shipped_layouts().get(str(name)) if entry is None else LayoutSection.model_validate(entry)
    if layout is None:
        return None
    known = known_to(layout)
    names = data.get("objects")
    chosen = [item for item in names if isinstance(item, str) and item in known] if isinstance(names, list) else []
    meshes = {str(item.get("file")): str(item.get("text")) for _, item in tables(data.get("meshes"))}
    objects = tuple(known[item] for item in dict.fromkeys(chosen)) or tuple(shipped_objects().values())
    return LayoutInUse(layout, objects, meshes, practised_aside=data.get("practice_task") == "round")


def known_to(layout: LayoutSection) -> dict[str, LayoutObject]:
    """What may stand on a layout, by id: what ships, and its own."""
    return {**shipped_objects(), **{item.id: item for item in layout.objects}}


def mesh_names(layout: Mapping[str, Any]) -> dict[str, FieldPath]:
    """Mesh files that the objects of a layout's unchecked data name, and where; only what may be a file's name."""
    found: dict[str, FieldPath] = {}
    objects = layout.get("objects")
    for position, entry in enumerate(objects if isinstance(objects, list) else ()):
        name = entry.get("mesh") if isinstance(entry, dict) else None
        if isinstance(name, str) and name and not model_problems(_MeshName, {"name": name}):
            found.setdefault(name, ("objects", position, "mesh"))
    return found


class _MeshName(Part):
    name: MeshName


def read_mesh(file: Path) -> str:
    """The text of a mesh file. Raises `FileProblem` for one that cannot be embedded."""
    text = read_text(file, MOST_MESH_BYTES, within=file.parent)
    return text.replace("\r\n", "\n").replace("\r", "\n")
