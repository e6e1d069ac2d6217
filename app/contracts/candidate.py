"""The part under test: found by the name a study file would call it, with what it takes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from app.contracts.asking import Transcript, ask
from app.contracts.situations import CYCLES, cycles
from app.trial.parts import REGISTRIES
from app.trial.robots import ROBOTS
from study.definition.part_fields import made, model_of, parameter_problems
from study.definition.toml_reader import spell
from study.parts.errors import PartError
from study.parts.shelf import Named, Shelf

SHELF = Shelf({**REGISTRIES, "robot": ROBOTS}, trust=True)
"""Whoever names code to be tested has it run."""


@dataclass(frozen=True)
class Candidate:
    """`name` is `blend.py:Blend`, a file in `folder`, or the name of a shipped or registered part."""

    kind: str
    name: str
    folder: Path
    given: Mapping[str, Any]

    def __str__(self) -> str:
        return f"{self.kind} {self.name!r}"

    @cached_property
    def loaded(self) -> Any:
        """The class. Raises `PartError` with one line."""
        return SHELF.load(self.kind, self.name, SHELF.code_of(self.kind, self.name, self.folder))

    @cached_property
    def named(self) -> Named:
        """As a study would name it, with values for everything it takes: what was given, its defaults, and for the rest
        something within the bounds. Raises `PartError` and `StudyError`."""
        parameters = self.loaded.Parameters
        chosen = {**_required(parameters), **self.given}
        for problem in parameter_problems(parameters, chosen):
            raise PartError(
                f"{self} takes {spell(problem.path)}, which {problem.sentence}; say what it takes: "
                f"""--parameters '{{"name": value}}', or `parameters = {{"name": value}}` in the test's class"""
            )
        code = SHELF.code_of(self.kind, self.name, self.folder)
        return Named(self.kind, self.name, asdict(made(parameters, chosen)), code)

    @cached_property
    def transcript(self) -> Transcript:
        """Its answers to everything, asked once."""
        return ask(self.named, cycles(CYCLES))

    @cached_property
    def again(self) -> Transcript:
        """Its answers to the same, asked once more."""
        return ask(self.named, cycles(CYCLES))


@lru_cache(maxsize=16)
def candidate(kind: str, name: str, folder: Path, parameters: str) -> Candidate:
    """The same one for all its checks, which share its answers. Raises `PartError` for parameters that are no JSON."""
    return Candidate(kind, name, folder, given_parameters(parameters))


def given_parameters(text: str) -> dict[str, Any]:
    """The parameters of a command line. Raises `PartError`."""
    try:
        found = json.loads(text)
    except ValueError as error:
        raise PartError(f"--parameters {text!r} is not JSON: {error}") from None
    if not isinstance(found, dict):
        raise PartError(f'--parameters {text!r}; it must be an object, such as {{"confidence": 0.4}}')
    return found


def _required(parameters: type) -> dict[str, Any]:
    """A value for everything that has no default."""
    schema = model_of(parameters).model_json_schema()["properties"]
    wanted = [
        field.name
        for field in fields(parameters)
        if field.init and field.default is MISSING and field.default_factory is MISSING
    ]
    return {name: _within(schema[name]) for name in wanted}


def _within(schema: Mapping[str, Any]) -> Any:
    """A value that a field of this JSON schema takes, as far as its schema says what it takes."""
    for several in ("anyOf", "oneOf"):
        if schema.get(several):
            return _within(schema[several][0])
    for one in ("enum", "examples"):
        if schema.get(one):
            return schema[one][0]
    if "const" in schema:
        return schema["const"]
    kind = schema.get("type")
    if kind in ("number", "integer"):
        low = schema.get("minimum", schema.get("exclusiveMinimum"))
        high = schema.get("maximum", schema.get("exclusiveMaximum"))
        if low is not None and high is not None:
            value = (low + high) / 2.0
        else:
            value = low + 1.0 if low is not None else high - 1.0 if high is not None else 1.0
        return int(value) if kind == "integer" else value
    return {"boolean": False, "array": (), "string": "text"}.get(str(kind))
