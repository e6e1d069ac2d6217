"""Parts by their names: those that ship with the lab, and those that another installed package brings.

A package registers a part under an entry point of the registry's group, so that nothing of the lab is edited:

    [project.entry-points."salab.robots"]
    two_finger = "my_robots.two_finger:TwoFingerRobot"

Names are looked up without importing what they name: the process that serves pages must never load physics.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, reduce
from typing import TYPE_CHECKING, Any

from study.parts.errors import PartError, one_line

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


@dataclass(frozen=True)
class Registered:
    """A part that an installed package brings: where it is, and which package and version that is."""

    place: str
    package: str
    version: str


@dataclass(frozen=True)
class Library:
    """An outside library that a shipped part needs and an installation may lack: its module, and what to do then."""

    module: str
    remedy: str

    @property
    def is_installed(self) -> bool:
        """Whether it could be imported; it is not."""
        return importlib.util.find_spec(self.module) is not None


@dataclass(frozen=True)
class Registry:
    """One kind of part.

    `noun` is what errors call it, `group` the group of entry points, `shipped` maps a name to `module:Class`, `methods`
    are what a class must have to be one, and `base` the class it must be derived from, if any (`module:Class`).
    `libraries` are what some of the shipped ones need.
    """

    noun: str
    group: str
    shipped: Mapping[str, str]
    methods: tuple[str, ...]
    base: str | None = None
    libraries: Mapping[str, Library] = field(default_factory=dict)

    @cached_property
    def registered(self) -> Mapping[str, Registered]:
        """The parts of other packages, by name.

        Raises `PartError` when a package registers a name that is taken: nobody could say which one ran; and when what
        a package registers cannot be read.
        """
        found: dict[str, Registered] = {}
        for point in sorted(_entry_points(self.group), key=lambda point: point.name):
            taken = self.shipped.get(point.name) or (point.name in found and found[point.name].place)
            if taken:
                source = _package_of(point)[0] or point.value
                raise PartError(
                    f"{source} registers {self.noun} {point.name!r}, which is {taken} already; "
                    "rename it there, or uninstall one of the two"
                )
            found[point.name] = Registered(_place(point), *_package_of(point))
        return found

    @cached_property
    def places(self) -> Mapping[str, str]:
        """Name to `module:Class`: the shipped ones first, then the others by name. Raises as `registered`."""
        return {**self.shipped, **{name: found.place for name, found in self.registered.items()}}

    @property
    def names(self) -> tuple[str, ...]:
        """Every name there is."""
        return tuple(self.places)

    def place_of(self, name: str) -> str:
        """Where a name leads, as `module:Class`. Raises `PartError` that names the ones there are."""
        found = self.shipped.get(name) or self.places.get(name)
        if found is None:
            raise PartError(f"no {self.noun} {name!r}; {self.noun}s are {', '.join(self.names)}")
        return found

    def lacking(self, name: str) -> str | None:
        """What keeps a part of that name from being loaded here, in one line: a library that is not installed."""
        library = self.libraries.get(name)
        if library is None or library.is_installed:
            return None
        return f"{self.noun} {name!r} needs {library.module}, which is not installed: {library.remedy}"

    def require(self, name: str) -> None:
        """Raises `PartError` as `place_of`, and for a part whose library is not installed."""
        self.place_of(name)
        if lacking := self.lacking(name):
            raise PartError(lacking)

    def module_of(self, name: str) -> str:
        """The module a name leads to. Raises `PartError` as `place_of`."""
        return self.place_of(name).partition(":")[0]

    def load(self, name: str) -> Any:
        """The class of that name, imported now.

        Raises `PartError` with one line: for an unknown name, a library that is not installed, a module that cannot be
        imported, a class that is not there or lacks a method.
        """
        self.require(name)
        place = self.place_of(name)
        module, _, attribute = place.partition(":")
        called = f"{self.noun} {name!r} ({place})"
        try:
            loaded = reduce(getattr, attribute.split("."), importlib.import_module(module))
        except (Exception, SystemExit) as error:  # somebody else's code may raise whatever it likes
            told = f"{called} cannot be loaded: {type(error).__name__}: {one_line(error)}"
            library = self.libraries.get(name)
            raise PartError(f"{told}; {library.remedy}" if library else told) from error
        self.check(loaded, called)
        return loaded

    def check(self, loaded: Any, called: str) -> None:
        """Raises `PartError` unless this class can be a part of this kind; `called` is what the error calls it."""
        try:
            self._check(loaded, called)
        except PartError:
            raise
        except (Exception, SystemExit) as error:  # even looking at somebody else's class may raise
            told = f"{type(error).__name__}: {one_line(error)}"
            raise PartError(f"{called} cannot be looked at: {told}") from error

    def _check(self, loaded: Any, called: str) -> None:
        if not self.methods:
            return
        # What a base class declares but nobody has written is not there.
        open_ends: frozenset[str] = getattr(loaded, "__abstractmethods__", frozenset())
        lacking = [
            method for method in self.methods if method in open_ends or not callable(getattr(loaded, method, None))
        ]
        if lacking:
            raise PartError(f"{called} lacks {', '.join(lacking)}; it must have {', '.join(self.methods)}")
        if self.base is not None:
            module, _, attribute = self.base.partition(":")
            base = getattr(importlib.import_module(module), attribute)
            if not (inspect.isclass(loaded) and issubclass(loaded, base)):
                raise PartError(f"{called} must be a class derived from {module}.{attribute}")


def _entry_points(group: str) -> Iterable[EntryPoint]:
    from importlib.metadata import distributions, entry_points  # takes a while, and most names are shipped ones

    try:
        return entry_points(group=group)
    except Exception:  # one file that cannot be read hides those of all packages
        broken = []
        for package in distributions():
            try:
                _ = package.entry_points
            except Exception as error:
                broken.append(
                    f"{package.name or 'a package without a name'} ({type(error).__name__}: {one_line(error)})"
                )
        raise PartError(
            f"what is installed cannot be read: entry_points.txt of {', '.join(broken)}; mend or uninstall it"
        ) from None


def _place(point: EntryPoint) -> str:
    """`module:Class`, without the extras that an entry point may name behind it; what is none, as it stands."""
    try:
        return f"{point.module}:{point.attr}" if point.attr else point.value
    except AttributeError:
        return point.value


def _package_of(point: EntryPoint) -> tuple[str, str]:
    """Name and version of the package that registers it, "" for what its metadata do not say."""
    if point.dist is None:
        return "", ""
    told = point.dist.metadata.json  # of what is not there it says nothing, where looking it up warns
    return str(told.get("name", "")), str(told.get("version", ""))
