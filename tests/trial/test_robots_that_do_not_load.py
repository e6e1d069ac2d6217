"""A library that is installed and does not load is one line that says what else there is."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from types import ModuleType

import pytest

from app.trial.robots import ROBOTS, make_robot
from study.parts.errors import PartError


@pytest.mark.parametrize(("name", "instead"), [("bullet", "--robot mujoco"), ("mujoco", "--robot bullet")])
def test_a_physics_that_cannot_be_loaded_names_the_others(
    monkeypatch: pytest.MonkeyPatch, name: str, instead: str
) -> None:
    import_module: Callable[[str], ModuleType] = importlib.import_module

    def broken(module: str) -> ModuleType:
        if module == ROBOTS.module_of(name):
            raise ImportError("libGL.so.1: cannot open shared object file")
        return import_module(module)

    monkeypatch.setattr(importlib, "import_module", broken)
    monkeypatch.setattr(type(ROBOTS), "lacking", lambda self, name: None)  # as far as can be seen it is there
    with pytest.raises(PartError) as caught:
        make_robot(name)
    said = str(caught.value)
    assert "libGL.so.1" in said and instead in said and "--robot kinematic" in said and "\n" not in said
