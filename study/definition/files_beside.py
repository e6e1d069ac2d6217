"""A study file with what stands in files beside it: questionnaires, a layout, meshes, a translation, sources of parts.

Their text is taken into the study's, so that the text and its hash hold all there is.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from study.definition.builtin_questionnaires import INSTRUMENTS
from study.definition.layouts import mesh_names, own_layouts, read_mesh, shipped_layouts
from study.definition.named_parts import code_table, sources_beside
from study.definition.packaged_questionnaires import packaged_questionnaire
from study.definition.questionnaires import file_problems, own_ids
from study.definition.toml_reader import FieldPath, FileBeside, Problem, StudyFileError, parse_toml, report
from study.definition.toml_writer import as_table, long_text, toml
from study.definition.translations import translation_beside
from study.parts.errors import PartError
from study.parts.shelf import Shelf
from study.text_file import FileProblem, read_text

MOST_STUDY_BYTES = 20_000_000
"""Of a study file: one that holds all its meshes and sources itself has a few millions."""
MOST_BESIDE_BYTES = 1_000_000
"""Of a questionnaire or a layout beside it."""
_IDENTIFIER = re.compile(r"[a-z0-9][a-z0-9_]*\Z")
_PLACEHOLDER = """
[[questionnaires]]
id = "{name}"
title = "-"
intro = "-"
score_means = "-"
items = [{{ id = "item", text = "-", low = "-", high = "-" }}]
"""
"""Stands in for a questionnaire that cannot be used, so that the study file's own problems are told beside it."""
_PLACEHOLDER_MESH = "v 0 0 0\nv 1 0 1\nv 0 1 0\nf 1 2 3\n"
"""The same for a mesh."""


def with_files_beside(file: Path, shelf: Shelf | None) -> tuple[bytes, list[FileBeside], list[str], list[FieldPath]]:
    """A study file's text with that of the files beside it, those files, what keeps one from being read, and the places
    of parts of which that is told."""
    try:
        source = read_text(file, MOST_STUDY_BYTES).encode()
    except FileProblem as problem:
        raise StudyFileError([str(problem)]) from None
    data, text = parse_toml(source, str(file))
    problems: list[str] = []
    added, beside = _layout_beside(file, data, problems)
    unread: list[Problem] = []
    added = [*_questionnaires_beside(file, data, shelf, problems, unread), *added]
    added += translation_beside(file, data, problems)
    if shelf is not None:
        codes, unread_code = sources_beside(data, file.parent, shelf)
        added += [code_table(code) for code in codes]
        unread += unread_code
    problems += report(str(file), text, data, unread).problems if unread else ()
    if added:
        source = b"".join([source.rstrip(b"\n"), b"\n", *(table.encode() for table in added)])
    return source, beside, problems, [problem.path for problem in unread]


def _questionnaires_beside(
    file: Path, data: Mapping[str, Any], shelf: Shelf | None, problems: list[str], unread: list[Problem]
) -> list[str]:
    """What is added to the study's text for the questionnaires in files beside it and of installed packages."""
    named = data.get("surveys")
    names = [name for name in named if isinstance(name, str)] if isinstance(named, list) else []
    added = []
    for name in dict.fromkeys(names):
        if name in own_ids(data) or not _IDENTIFIER.match(name):
            continue
        beside = file.with_name(f"{name}.toml")
        if name in INSTRUMENTS and (data.get("language", "en") == "en" or not os.path.lexists(beside)):
            continue
        try:
            packages = shelf if name not in INSTRUMENTS else None
            brought = packaged_questionnaire(name, packages.registries["questionnaire"]) if packages else None
            if brought is not None and os.path.lexists(beside):
                raise PartError(f"stands in {beside.name} and is brought by {brought[1]} as well; rename the file")
        except PartError as error:
            unread.append(Problem(("surveys", names.index(name)), str(error)))
            added.append(_PLACEHOLDER.format(name=name))
            continue
        if brought is None and not os.path.lexists(beside):
            continue
        origin = f"as {brought[1]} brought it" if brought is not None else "as it stood beside this file"
        text, found = (brought[0], ()) if brought is not None else _read_beside(beside)
        found = found or file_problems(text, str(beside))
        problems += found
        usable = as_table("questionnaires", name, parse_toml(text, str(beside))[0], origin) if not found else None
        added.append(usable or _PLACEHOLDER.format(name=name))
    return added


def _layout_beside(file: Path, data: Mapping[str, Any], problems: list[str]) -> tuple[list[str], list[FileBeside]]:
    """What is added to the study's text for a layout in a file beside it, and for the meshes of its objects."""
    name, entries = data.get("layout"), data.get("layouts", [])
    own = {known: entry for known, (_, entry) in own_layouts(data).items()}
    added: list[str] = []
    beside: list[FileBeside] = []
    candidate = file.with_name(f"{name}.toml") if isinstance(name, str) and _IDENTIFIER.match(name) else None
    is_own = candidate is not None and name not in own and name not in shipped_layouts() and isinstance(entries, list)
    if candidate is not None and is_own and os.path.lexists(candidate):
        source, unread = _read_beside(candidate)
        if unread:
            raise StudyFileError(unread)
        layout, text = parse_toml(source, str(candidate))
        beside.append(FileBeside(("layouts", len(entries)), str(candidate), text, layout))
        added.append(as_table("layouts", str(name), layout))
        own[str(name)] = layout
    meshes = data.get("meshes")
    there = {entry.get("file") for entry in (meshes if isinstance(meshes, list) else ()) if isinstance(entry, dict)}
    for mesh in dict.fromkeys(mesh for layout in own.values() for mesh in mesh_names(layout)):
        if mesh in there or not os.path.lexists(file.with_name(mesh)):
            continue
        try:
            text = read_mesh(file.with_name(mesh))
        except FileProblem as problem:
            problems.append(str(problem))
            text = _PLACEHOLDER_MESH
        lines = ["", f"# {mesh}, as it stood beside this file", "[[meshes]]", f"file = {toml(mesh)}"]
        added.append("\n".join([*lines, f"text = {long_text(text)}"]) + "\n")
    return added, beside


def _read_beside(file: Path) -> tuple[bytes, tuple[str, ...]]:
    """What stands in a file that the study file names, or why that cannot be told."""
    try:
        return read_text(file, MOST_BESIDE_BYTES, within=file.parent).encode(), ()
    except FileProblem as problem:
        return b"", (str(problem),)
