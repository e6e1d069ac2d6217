"""Parts by their names: those that ship with the lab, and those that another installed package brings.

A package registers a part under an entry point of the registry's group, so that nothing of the lab is edited:

    [project.entry-points."salab.robots"]
    two_finger = "my_robots.two_finger:TwoFingerRobot"

Names are looked up without importing what they name: the process that serves pages must never load physics.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from app.errors import LabError


@dataclass(frozen=True)
class Registry:
    """One kind of part.

    `noun` is what errors call it, `group` the group of entry points, `shipped` maps a name to `module:Class`, `methods`
    are what a class must have to be one.
    """

    noun: str
    group: str
    shipped: Mapping[str, str]
    methods: tuple[str, ...]

    @cached_property
    def places(self) -> Mapping[str, str]:
        """Name to `module:Class`: the shipped ones first, then the others by name.

        Raises `LabError` when a package registers a name that is taken: nobody could say which one ran.
        """
        from importlib.metadata import entry_points  # takes a while, and most names are shipped ones

        found = dict(self.shipped)
        for point in sorted(entry_points(group=self.group), key=lambda point: point.name):
            if point.name in found:
                source = point.dist.name if point.dist else point.value
                raise LabError(
                    f"{source} registers {self.noun} {point.name!r}, which is {found[point.name]} already; "
                    "rename it there, or uninstall one of the two"
                )
            found[point.name] = point.value
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """Every name there is."""
        return tuple(self.places)

    def place_of(self, name: str) -> str:
        """Where a name leads, as `module:Class`. Raises `LabError` that names the ones there are."""
        found = self.shipped.get(name) or self.places.get(name)
        if found is None:
            raise LabError(f"no {self.noun} {name!r}; {self.noun}s are {', '.join(self.names)}")
        return found

    def module_of(self, name: str) -> str:
        """The module a name leads to. Raises `LabError` as `place_of`."""
        return self.place_of(name).partition(":")[0]

    def load(self, name: str) -> Any:
        """The class of that name, imported now.

        Raises `LabError` with one line: for an unknown name, a module that cannot be imported, a class that is not
        there or lacks a method.
        """
        place = self.place_of(name)
        module, _, attribute = place.partition(":")
        try:
            loaded = getattr(importlib.import_module(module), attribute)
        except Exception as error:  # somebody else's code may raise whatever it likes
            raise LabError(
                f"{self.noun} {name!r} ({place}) cannot be loaded: {type(error).__name__}: {error}"
            ) from error
        lacking = [method for method in self.methods if not callable(getattr(loaded, method, None))]
        if lacking:
            raise LabError(
                f"{self.noun} {name!r} ({place}) lacks {', '.join(lacking)}; it must have {', '.join(self.methods)}"
            )
        return loaded
