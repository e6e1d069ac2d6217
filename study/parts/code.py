"""The source of a part that does not ship with the lab: what a study carries of it, and how it runs.

A study's text holds the source of every such part it names, so that the text alone says what ran: it is hashed, stored
and exported with the rest. Code in a file beside the study file runs from that text and from nothing else. A part of an
installed package runs from the package, and only as long as its source is the one in the text.
"""

from __future__ import annotations

import hashlib
import importlib.util
import io
import json
import linecache
import sys
import types
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.parts.errors import PartError, one_line
from study.parts.registry import Registered, Registry
from study.text_file import FileProblem, read_text

MAX_SOURCE_BYTES = 1_000_000
"""Of one part's source that a study's text holds; a package that is larger is known by its hash alone."""


@dataclass(frozen=True)
class Code:
    """One part's source. `name` is what the study file calls it: `blend.py:Blend`, or the name a package registers.

    `files` are texts by file name, `sha256` is of all of them, `package` and `version` are empty for a file beside the
    study file.
    """

    kind: str
    name: str
    sha256: str
    files: Mapping[str, str]
    package: str = ""
    version: str = ""

    @property
    def is_beside(self) -> bool:
        """Whether it came from a file beside the study file, and so from whoever sent that file."""
        return is_file(self.name)

    @property
    def from_package(self) -> str:
        """The package it came with, and its version, in one line: what a study file says there may be anything."""
        return one_line(ValueError(f"{self.package} {self.version}")) or "a package without a name"


def is_file(name: str) -> bool:
    """Whether a part is named as `file.py:Class`."""
    return file_of(name).endswith(".py")


def file_of(name: str) -> str:
    """`blend.py` of `blend.py:Blend`."""
    return name.partition(":")[0]


def code_beside(kind: str, name: str, folder: Path) -> Code:
    """The code of `blend.py:Blend` in a folder. Raises `PartError`.

    A study file is a stranger's: a link could take any file of this machine into the study's text, and a pipe would
    never end.
    """
    file, _, attribute = name.partition(":")
    if not attribute.isidentifier() or Path(file).name != file or not Path(file).stem.isidentifier():
        raise PartError(f"{kind} {name!r}; a file beside the study file is named as blend.py:Blend")
    try:
        text = read_text(folder / file, MAX_SOURCE_BYTES, within=folder)
    except FileProblem as problem:
        raise PartError(f"{kind} {name!r}: {file} {problem.reason}") from None
    files = {file: text.replace("\r\n", "\n")}
    return Code(kind, name, sha256_of(files), files)


def code_of_package(kind: str, name: str, found: Registered) -> Code:
    """The code of a part that an installed package registers: every Python file of the package it is in."""
    files = _package_files(kind, name, found.place.partition(":")[0])
    kept = files if sum(len(text) for text in files.values()) <= MAX_SOURCE_BYTES else {}
    return Code(kind, name, sha256_of(files), kept, found.package, found.version)


def load(code: Code, registry: Registry) -> Any:
    """The class, from the text it was named with or from the package, whose source must still be the same.

    Raises `PartError` with one line.
    """
    called = f"{code.kind} {code.name!r}"
    if code.is_beside:
        if sha256_of(code.files) != code.sha256:
            raise PartError(f"{called}: its source is not the one its SHA-256 {code.sha256[:12]} stands for")
        if tuple(code.files) != (file_of(code.name),):
            raise PartError(f"{called}: its source must be one file, {file_of(code.name)}")
        return _class_in_text(code, registry, called)
    now = current_code(code.kind, code.name, registry)
    if now is None or now.sha256 != code.sha256:
        was = f"{code.from_package}, source {code.sha256[:12]}"
        have = "it is not installed" if now is None else f"here it is {now.from_package}, {now.sha256[:12]}"
        raise PartError(f"{called} was {was} when the study was made; {have}. Install that version to go on")
    return registry.load(code.name)


def current_code(kind: str, name: str, registry: Registry) -> Code | None:
    """The code of a registered part as it is installed now; None where no package brings it."""
    found = registry.registered.get(name)
    return None if found is None else code_of_package(kind, name, found)


def sha256_of(files: Mapping[str, str]) -> str:
    """One hash of all of them, whatever their order."""
    text = json.dumps(sorted(files.items()), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _class_in_text(code: Code, registry: Registry, called: str) -> Any:
    (file, text), attribute = next(iter(code.files.items())), code.name.partition(":")[2]
    module_name = f"salab_{Path(file).stem}_{code.sha256[:16]}"
    shown = f"{file} ({code.sha256[:8]})"
    linecache.cache[shown] = (len(text), None, io.StringIO(text).readlines(), shown)  # tracebacks show its lines
    module = sys.modules.get(module_name)
    try:
        if module is None:
            module = types.ModuleType(module_name)
            module.__dict__["__file__"] = file
            sys.modules[module_name] = module  # dataclasses and type hints look their module up by its name
            try:
                exec(compile(text, shown, "exec"), module.__dict__)
            except BaseException:
                del sys.modules[module_name]
                raise
        loaded = getattr(module, attribute)
    except AttributeError:
        raise PartError(f"{called} cannot be loaded: {file} has no {attribute}") from None
    except (Exception, SystemExit) as error:  # somebody else's code may raise whatever it likes
        raise PartError(f"{called} cannot be loaded: {type(error).__name__}: {one_line(error)}") from error
    registry.check(loaded, called)
    return loaded


def _package_files(kind: str, name: str, module: str) -> dict[str, str]:
    top = module.partition(".")[0]
    try:
        spec = importlib.util.find_spec(top)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        raise PartError(f"{kind} {name!r} cannot be loaded: there is no module {top}")
    if spec.submodule_search_locations:
        folders = [Path(place) for place in spec.submodule_search_locations]
        paths = {
            f"{top}/{path.relative_to(folder).as_posix()}": path for folder in folders for path in folder.rglob("*.py")
        }
    else:
        paths = {Path(spec.origin).name: Path(spec.origin)} if spec.origin and spec.origin.endswith(".py") else {}
    if not paths:
        raise PartError(f"{kind} {name!r} ({module}) has no Python source to record")
    return {said: paths[said].read_text(encoding="utf-8", errors="replace") for said in sorted(paths)}
