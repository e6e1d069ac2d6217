"""What is wrong with the layouts of a study file beyond single fields, and what the file may choose of them.

Like `checks`, which calls it, this reads unchecked data.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from study.definition.layouts import (
    LayoutFile,
    WorldCheck,
    all_shipped_objects,
    in_use,
    mesh_names,
    own_layouts,
    shipped_layouts,
    shipped_objects,
)
from study.definition.toml_reader import FieldPath, Problem, tables


def layout_problems(data: Mapping[str, Any], world: WorldCheck | None) -> Iterator[Problem]:
    """What is wrong with the `layouts` of a study file's unchecked data beyond single fields."""
    own = own_layouts(data)
    chosen = data.get("layout")
    meshes = _mesh_files(data)
    for name, (position, entry) in own.items():
        place: FieldPath = ("layouts", position)
        if name in shipped_layouts():
            yield Problem((*place, "id"), "is a layout that ships; choose another id")
        elif isinstance(chosen, str) and name != chosen:
            yield Problem((*place, "id"), "is never used; name it in layout, or leave the layout out")
        for key in ("objects", "bins"):
            yield from _repeated((*place, key), entry.get(key))
        for number, item in tables(entry.get("objects")):
            if isinstance(item.get("id"), str) and item["id"] in all_shipped_objects():
                yield Problem((*place, "objects", number, "id"), "is an object that ships; choose another id")
            if item.get("mesh") and item.get("drawing"):
                yield Problem((*place, "objects", number, "drawing"), "must be left out with a mesh")
        objects = {*all_shipped_objects(), *_ids(entry, "objects")}
        for number, item in tables(entry.get("bins")):
            if isinstance(item.get("id"), str) and item["id"] in objects:
                yield Problem((*place, "bins", number, "id"), "is the id of an object; choose another id")
        for mesh, where in mesh_names(entry).items():
            if mesh not in meshes:
                yield Problem((*place, *where), "no such file beside this file")
    named = {mesh for _, entry in own.values() for mesh in mesh_names(entry)}
    for number, item in tables(data.get("meshes")):
        if isinstance(item.get("file"), str) and item["file"] not in named:
            yield Problem(("meshes", number, "file"), "is the mesh of no object; leave it out")
    yield from _repeated(("meshes",), data.get("meshes"), "file")
    using = in_use(data) if world is not None else None
    if world is None or using is None:
        return
    own_place: FieldPath = ("layouts", own[using.layout.id][0]) if using.layout.id in own else ("layout",)
    for problem in world(using):
        yield Problem((*own_place, *problem.path) if own_place[0] == "layouts" else own_place, problem.sentence)


def known_places(data: Mapping[str, Any]) -> dict[str, int | None]:
    """Every layout that a study file's unchecked data may choose, and its number of places, if it can be told."""
    counts: dict[str, int | None] = {name: len(layout.places_m) for name, layout in shipped_layouts().items()}
    for name, (_, entry) in own_layouts(data).items():
        places = entry.get("places_m")
        counts[name] = len(places) if isinstance(places, list) else None
    return counts


def known_objects(data: Mapping[str, Any]) -> tuple[str, ...]:
    """Ids of the objects that a study file's unchecked data may choose."""
    return (*shipped_objects(), *_ids(_chosen(data), "objects"))


def known_bins(data: Mapping[str, Any]) -> tuple[str, ...]:
    """Ids of the bins of the layout that a study file's unchecked data chooses."""
    name = data.get("layout")
    if (entry := _chosen(data)) is not None and "bins" in entry:
        return _ids(entry, "bins")
    shipped = shipped_layouts()
    bins = shipped[name].bins if isinstance(name, str) and name in shipped else LayoutFile.model_fields["bins"].default
    return tuple(item.id for item in bins)


def _chosen(data: Mapping[str, Any]) -> Mapping[str, Any] | None:
    name = data.get("layout")
    return own_layouts(data).get(name, (0, None))[1] if isinstance(name, str) else None


def _ids(entry: Mapping[str, Any] | None, key: str) -> tuple[str, ...]:
    return tuple(item["id"] for _, item in tables((entry or {}).get(key)) if isinstance(item.get("id"), str))


def _mesh_files(data: Mapping[str, Any]) -> set[str]:
    return {str(item.get("file")) for _, item in tables(data.get("meshes"))}


def _repeated(place: FieldPath, entries: object, key: str = "id") -> Iterator[Problem]:
    first: dict[str, int] = {}
    for position, item in tables(entries):
        name = item.get(key)
        if isinstance(name, str) and first.setdefault(name, position) != position:
            yield Problem((*place, position, key), f"repeats entry {first[name] + 1}; {key}s must be different")
