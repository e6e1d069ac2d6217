"""The layouts and objects that ship, as the robots take them."""

from __future__ import annotations

from app.trial.world import shipped_layout
from study.definition.layouts import shipped_layouts

LAYOUTS = {name: shipped_layout(name) for name in shipped_layouts()}
ARC, ROWS = LAYOUTS["arc"], LAYOUTS["rows"]
STUDY_OBJECTS = {spec.id: spec for spec in ARC.objects}
PRACTICE_OBJECT = ARC.practice_object
OBJECTS = {**STUDY_OBJECTS, PRACTICE_OBJECT.id: PRACTICE_OBJECT}
"""Every object, by id."""
