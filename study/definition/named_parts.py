"""The exchangeable parts a study file names: arbiters, inferences, distractors. Which they are, what they take, and the
source of those that do not ship with the lab."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from study.definition.field_types import PART_NAME, Part
from study.definition.part_fields import field_names, parameter_problems
from study.definition.sections import (
    MODEL_FIELDS,
    SAID_FIELDS,
    ArbiterSettings,
    CodeText,
    Condition,
    DistractorSettings,
    InferenceSettings,
)
from study.definition.toml_reader import FieldPath, Problem, choices_sentence, model_problems, tables
from study.definition.toml_writer import long_text, toml
from study.parts.code import Code, file_of, is_file, sha256_of
from study.parts.errors import PartError, one_line
from study.parts.shelf import Shelf, code_among
from study.records import StudyError

_NAMED: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("inference", ("inference", "kind")),
    ("distractor", ("distractor", "kind")),
)


def named_parts(data: Mapping[str, Any]) -> Iterator[tuple[str, str, FieldPath]]:
    """(kind, name, place in the file) of every part that the unchecked data of a study file names. What cannot be a
    name is left out: that is told as of any other field."""
    conditions = data.get("conditions")
    for number, condition in enumerate(conditions if isinstance(conditions, list) else []):
        if isinstance(condition, Mapping):
            place: FieldPath = ("conditions", number)
            yield from _named(condition, ("arbiter",), "arbiter", place)
            yield from _named(condition, ("inference", "kind"), "inference", place)
    for kind, path in _NAMED:
        yield from _named(data, path, kind, ())


def _named(data: Mapping[str, Any], path: tuple[str, ...], kind: str, place: FieldPath) -> Iterator[Any]:
    value: Any = data
    for key in path:
        value = value.get(key) if isinstance(value, Mapping) else None
    if _is_name(value):
        yield kind, value, (*place, *path)


def sources_beside(data: Mapping[str, Any], folder: Path, shelf: Shelf) -> tuple[list[Code], list[Problem]]:
    """The source of every part that does not ship and that the data do not hold yet. Nothing of it runs."""
    held = {(code.kind, code.name) for code in codes_of(data)}
    found: dict[tuple[str, str], Code] = {}
    problems = []
    for kind, name, path in named_parts(data):
        if (kind, name) in held or (kind, name) in found:
            continue
        try:
            code = shelf.code_of(kind, name, folder)
        except PartError as error:
            problems.append(Problem(path, str(error)))
            continue
        if code is not None:
            found[kind, name] = code
    return list(found.values()), problems


def code_table(code: Code) -> str:
    """A source as a table of a study's text, with a blank line before it."""
    said = {"kind": code.kind, "name": code.name, "package": code.package, "version": code.version}
    lines = ["", "[[code]]", *(f"{key} = {toml(value)}" for key, value in said.items() if value)]
    lines.append(f"sha256 = {toml(code.sha256)}")
    for name, text in code.files.items():
        lines += ["", "[[code.files]]", f"name = {toml(name)}", f"text = {long_text(text)}"]
    return "\n".join(lines) + "\n"


def codes_of(data: Mapping[str, Any]) -> tuple[Code, ...]:
    """The sources that the unchecked data hold; what cannot be read is left out."""
    return tuple(text.code for _, text in _code_texts(data))


def _code_texts(data: Mapping[str, Any]) -> Iterator[tuple[int, CodeText]]:
    """The tables of sources that can be read, each with its position."""
    for position, table in tables(data.get("code")):
        if not model_problems(CodeText, table):
            yield position, CodeText.model_validate(table)


def part_problems(data: Mapping[str, Any], shelf: Shelf, told: Collection[FieldPath] = ()) -> Iterator[Problem]:
    """Parts that are unknown or broken, and what they take that they cannot. `told`: places of parts whose source could
    not be read, which is all there is to say about them.

    What may not run (see `Shelf`) is not loaded, and what it takes is not looked at.
    """
    return (problem for problem in _part_problems(data, shelf) if problem.path not in told)


def _part_problems(data: Mapping[str, Any], shelf: Shelf) -> Iterator[Problem]:
    yield from _code_problems(data)
    codes = codes_of(data)
    shared = data.get("arbiter")
    shared = shared if isinstance(shared, Mapping) else {}
    conditions = data.get("conditions")
    for number, condition in enumerate(conditions if isinstance(conditions, list) else []):
        if not isinstance(condition, Mapping):
            continue
        place: FieldPath = ("conditions", number)
        yield from _taken("arbiter", condition.get("arbiter"), condition, place, "arbiter", shelf, codes, shared)
        inference = condition.get("inference")
        if isinstance(inference, Mapping):
            yield from _inference_problems(inference, (*place, "inference"), shelf, codes)
    inference, distractor = data.get("inference"), data.get("distractor")
    if isinstance(inference, Mapping):
        yield from _inference_problems(inference, ("inference",), shelf, codes)
    if isinstance(distractor, Mapping):
        name = distractor.get("kind", DistractorSettings().kind)
        yield from _taken("distractor", name, distractor, ("distractor",), "kind", shelf, codes, {})


def _code_problems(data: Mapping[str, Any]) -> Iterator[Problem]:
    """Sources that nothing runs, or that are not what they seem: whoever reads the file is to see what would run."""
    called = {(kind, name) for kind, name, _ in named_parts(data)}
    first: dict[tuple[str, str], int] = {}
    for position, text in _code_texts(data):
        place: FieldPath = ("code", position)
        which, code = (text.kind, text.name), text.code
        if text.kind not in _BASES:
            yield Problem((*place, "kind"), choices_sentence(text.kind, _BASES, "kinds"))
        elif first.setdefault(which, position) != position:
            yield Problem((*place, "name"), f"repeats entry {first[which] + 1}; a part has one source")
        elif which not in called:
            yield Problem((*place, "name"), f"is the source of no {text.kind} that this study names; leave it out")
        if code.is_beside and [file.name for file in text.files] != [file_of(text.name)]:
            yield Problem((*place, "files"), f"must be one file, called {file_of(text.name)}")
        elif code.is_beside and sha256_of(code.files) != code.sha256:
            yield Problem((*place, "sha256"), "is not the hash of these files")


def _inference_problems(
    table: Mapping[str, Any], place: FieldPath, shelf: Shelf, codes: Sequence[Code]
) -> Iterator[Problem]:
    kind = table.get("kind", InferenceSettings().kind)
    yield from _taken("inference", kind, table, place, "kind", shelf, codes, {})


def _taken(
    kind: str,
    name: object,
    table: Mapping[str, Any],
    place: FieldPath,
    key: str,
    shelf: Shelf,
    codes: Sequence[Code],
    shared: Mapping[str, Any],
) -> Iterator[Problem]:
    """What is wrong with the part that a table names, and with what the table says it takes."""
    if not isinstance(name, str) or not _is_name(name):
        return
    code = code_among(codes, kind, name)
    registry = shelf.registries[kind]
    try:
        # What is installed matters only to who names it: a broken package is in nobody else's way.
        if code is None and not is_file(name) and name not in registry.shipped and name not in registry.names:
            hint = "or your own as file.py:Class in a file beside this one"
            yield Problem((*place, key), f"{choices_sentence(name, registry.names, f'{kind}s')}, {hint}")
            return
        if not shelf.may_run(code):
            return
        part = shelf.load(kind, name, code)
        usual = {field: value for field, value in shared.items() if field in field_names(part.Parameters)}
        whole = {**usual, **table}
        found = parameter_problems(part.Parameters, whole, _BASES[kind])
        tried = shelf.trials.get(kind) if not found else None
        broken = tried(part, whole) if tried is not None else None
    except PartError as error:
        yield Problem((*place, key), str(error))
        return
    except StudyError as error:
        yield Problem((*place, key), f"its parameters cannot be used: {error}")
        return
    except (Exception, SystemExit) as error:  # somebody else's class may raise whatever it likes while it is looked at
        yield Problem((*place, key), f"its parameters cannot be used: {type(error).__name__}: {one_line(error)}")
        return
    if broken is not None:
        yield Problem((*place, key), broken)
    for problem in found:
        if not (problem.path and problem.path[0] in _BASES[kind].model_fields):  # told with the file's own fields
            yield Problem((*place, *problem.path), problem.sentence)


def _is_name(value: object) -> bool:
    return isinstance(value, str) and re.fullmatch(PART_NAME, value) is not None


class _ConditionFields(Condition):
    model_config = Part.model_config

    TAKEN: ClassVar[tuple[str, ...]] = ("condition",)
    """In the record of a trial, the arbiter's name."""


class _InferenceFields(InferenceSettings):
    model_config = Part.model_config


class _DistractorFields(DistractorSettings):
    model_config = Part.model_config


_BASES: Mapping[str, type[Part]] = {
    "arbiter": _ConditionFields,
    "inference": _InferenceFields,
    "distractor": _DistractorFields,
}


def parameters_of(condition: Condition, settings: ArbiterSettings, parameters: type) -> dict[str, Any]:
    """What an arbiter takes under a condition: the condition's own, then those of `[arbiter]` it knows by name."""
    known = field_names(parameters)
    unsaid = {name for name in SAID_FIELDS if name not in settings.model_fields_set}
    usual = settings.model_dump(exclude={*MODEL_FIELDS, *unsaid})
    shared = {name: value for name, value in usual.items() if name in known}
    return {**shared, **condition.parameters}
