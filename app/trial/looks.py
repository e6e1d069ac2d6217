"""How the participant's page draws the objects and bins of a layout of the study's own; those that ship it knows."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from sim.interface import Rgb
from sim.view.wavefront import read_obj, silhouette
from study.definition.study import Study


def looks_of(study: Study) -> Mapping[str, Mapping[str, Any]]:
    """The looks by id of object or bin, as JSON (`static/participant/picture.js` draws them); none for a layout that
    ships."""
    if study.own_layout is None:
        return {}
    meshes = study.layout_in_use.meshes
    objects = {
        item.id: {
            "shape": item.shape,
            "size_m": list(item.size_m),
            "color": item.color,
            "drawing": item.drawing,
            "outline": _outline(meshes[item.mesh]) if item.mesh else "",
        }
        for item in study.own_layout.objects
    }
    bins = {item.id: {"shape": "bin", "color": item.color, "letter": item.sign} for item in study.own_layout.bins}
    return {**objects, **bins}


@lru_cache(maxsize=32)
def _outline(mesh_obj: str) -> str:
    black: Rgb = (0, 0, 0)
    return silhouette(read_obj(mesh_obj, black))
