"""All parts a study file may name, by kind, and what may run of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from study.parts.code import Code, code_beside, current_code, is_file, load
from study.parts.errors import PartError
from study.parts.registry import Registry


@dataclass(frozen=True)
class Named:
    """A part as a study names it, with what it takes: enough to make it in any process.

    `code` is its source, None for one that ships with the lab. `parameters` are values of JSON by name.
    """

    kind: str
    name: str
    parameters: Mapping[str, Any]
    code: Code | None = None


@dataclass(frozen=True)
class Shelf:
    """The registries by kind.

    `trust`: whether code from files beside a study file may run. `trials` tell, by kind, in one line what is wrong with
    what a class makes of a table; they raise `PartError` where it makes nothing.
    """

    registries: Mapping[str, Registry]
    trust: bool = False
    trials: Mapping[str, Callable[[Any, Mapping[str, Any]], str | None]] = field(default_factory=dict)

    def code_of(self, kind: str, name: str, folder: Path) -> Code | None:
        """The source of a part that a study file in this folder names; None for one that ships, or that is unknown.

        Nothing of it runs. Raises `PartError` for a file that cannot be read.
        """
        if is_file(name):
            return code_beside(kind, name, folder)
        registry = self.registries[kind]
        return None if name in registry.shipped else current_code(kind, name, registry)

    def may_run(self, code: Code | None) -> bool:
        """Whether that code may run: it ships, is installed, or is trusted."""
        return code is None or not code.is_beside or self.trust

    def load(self, kind: str, name: str, code: Code | None) -> Any:
        """The class of a part. Raises `PartError` with one line: unknown (with the ones there are), not trusted, not
        the source it was, broken."""
        registry = self.registries[kind]
        if code is None:
            if is_file(name):
                raise PartError(f"{kind} {name!r}: the study does not hold its source")
            return registry.load(name)
        if not self.may_run(code):
            raise PartError(f"{kind} {name!r} is code from a file beside the study file; it runs only with --trust")
        return _loaded(_Source(code.kind, code.name, code.sha256, code, registry))


@dataclass(frozen=True)
class _Source:
    """A source and where it is loaded: kind, name and hash say which it is."""

    kind: str
    name: str
    sha256: str
    code: Code = field(compare=False)
    registry: Registry = field(compare=False)


@lru_cache(maxsize=64)
def _loaded(source: _Source) -> Any:
    """Once a process: every trial asks again, and a package's source takes a while to read."""
    return load(source.code, source.registry)


def code_among(codes: Iterable[Code], kind: str, name: str) -> Code | None:
    """The source of a part among a study's."""
    return next((code for code in codes if (code.kind, code.name) == (kind, name)), None)
