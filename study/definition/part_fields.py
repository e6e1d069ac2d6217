"""Parameters of an exchangeable part, as fields of the study file.

The author of a part writes one frozen dataclass; its fields are the fields of the part's table:

    @dataclass(frozen=True)
    class Parameters:
        n: Annotated[int, Field(ge=1, le=5)] = 2
        \"\"\"How far back.\"\"\"

`model_of` makes the model that a table is checked with, so that a mistake in it is told as any other of the study
file: with its line, its value and its bound. What no single field can know is said by `__post_init__`, which raises
`WrongParameter`.
"""

from __future__ import annotations

import dataclasses
import types
import typing
import warnings
from collections.abc import Collection, Mapping
from functools import lru_cache
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

import pydantic
from pydantic import Field

from study.definition.field_types import Part
from study.definition.toml_reader import Problem, model_problems
from study.parts.errors import one_line
from study.records import StudyError

Parameters = TypeVar("Parameters")

_SCALARS = {
    float: Field(strict=True, allow_inf_nan=False),
    int: Field(strict=True),
    bool: Field(strict=True),
    str: Field(strict=True),
}
_ANNOTATED: Any = Annotated
_TUPLE: Any = tuple
_ALLOWED = "bool, int, float, str, a Literal, a tuple of those, each in Annotated[..., Field(...)] for its bounds"


class WrongParameter(ValueError):
    """Raised by a parameters' `__post_init__`: `field` clashes with another one; `sentence` has no full stop."""

    def __init__(self, field: str, sentence: str) -> None:
        super().__init__(f"{field}: {sentence}")
        self.field = field
        self.sentence = sentence


def model_of(parameters: type, base: type[Part] = Part) -> type[pydantic.BaseModel]:
    """The model of a table with these parameters, beside the fields of `base` when the table has others too.

    Numbers are strict: true and false are none, nor are texts, NaN and infinity; a whole number is a number. Raises
    `StudyError` when the class is no frozen dataclass, a field has a type no study file can hold, a name is taken, or a
    default is none that a study file could give.
    """
    return _model_of(parameters, base)


@lru_cache(maxsize=256)
def _model_of(parameters: Any, base: Any) -> type[pydantic.BaseModel]:
    name = f"{parameters.__module__}.{parameters.__qualname__}" if isinstance(parameters, type) else repr(parameters)
    settings = getattr(parameters, "__dataclass_params__", None)
    if not isinstance(parameters, type) or settings is None or not settings.frozen:
        raise StudyError(f"parameters {name} must be a frozen dataclass")
    try:
        hints = typing.get_type_hints(parameters, include_extras=True)
    except (Exception, SystemExit) as error:  # an annotation may be any expression of its author's
        raise StudyError(f"the types of {name} cannot be read: {type(error).__name__}: {one_line(error)}") from error
    taken = (*base.model_fields, *getattr(base, "TAKEN", ()))
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(parameters):
        if field.name in taken:
            raise StudyError(f"field {field.name!r} of {name} is taken; others are {', '.join(taken)}")
        if field.name.startswith("_") or (field.name.startswith("model_") and hasattr(Part, field.name)):
            raise StudyError(f"field {field.name!r} of {name} cannot be a key of a study file; call it something else")
        if field.init:
            fields[field.name] = (_strict(hints[field.name], f"{name}.{field.name}"), _default(field))
    try:
        with warnings.catch_warnings():  # a field may well be called copy or json, though the library has such methods
            warnings.simplefilter("ignore", UserWarning)
            model: type[pydantic.BaseModel] = pydantic.create_model(
                parameters.__name__,
                __base__=base,
                __module__=parameters.__module__,
                __doc__=parameters.__doc__,
                **fields,
            )
        _check_fields(model, fields, name)
    except StudyError:
        raise
    except (Exception, SystemExit) as error:  # bounds, patterns and default factories are its author's as well
        *_, innermost = str(error).strip().splitlines() or [type(error).__name__]
        told = one_line(ValueError(innermost))
        raise StudyError(f"{name} cannot be made into keys of a study file: {told}") from error
    return model


def _check_fields(model: type[pydantic.BaseModel], own: Collection[str], name: str) -> None:
    """Raises `StudyError` for a field with another name in the file than in the class, and for a default that the
    file could not give."""
    defaults = {}
    for field in own:
        about = model.model_fields[field]
        if about.alias is not None or about.validation_alias is not None:
            raise StudyError(f"field {field!r} of {name} has an alias; a key of a study file has the field's own name")
        if not about.is_required():
            defaults[field] = about.get_default(call_default_factory=True)
    for problem in model_problems(model, defaults):
        field = str(problem.path[0])
        if field in defaults:
            shown = one_line(ValueError(repr(defaults[field])))
            raise StudyError(f"{name}: the default {shown} of {field} {problem.sentence}: change it, or the bound")


def parameter_problems(parameters: type, data: Mapping[str, Any], base: type[Part] = Part) -> tuple[Problem, ...]:
    """Everything that is wrong with a table of these parameters; empty when `made` takes it. Raises as `model_of`."""
    found = model_problems(model_of(parameters, base), data)
    if any(problem.path[0] not in base.model_fields for problem in found):
        return found  # what its fields have to do with one another can only be said of right ones
    try:
        made(parameters, data)
    except WrongParameter as wrong:
        return (*found, Problem((wrong.field,), one_line(wrong).removeprefix(f"{wrong.field}: ")))
    except Exception as error:  # somebody else's code may raise whatever it likes
        # "alpha is 3.0; it must be 0": the field comes first, if it is about one
        told = one_line(error) or type(error).__name__
        field, _, rest = told.partition(" is ")
        about = field in {item.name for item in dataclasses.fields(parameters)}
        return (*found, Problem((field,), rest.partition("; it ")[2] or rest) if about else Problem((), told))
    except SystemExit as error:
        return (*found, Problem((), f"raises SystemExit: {one_line(error)}"))
    return found


def made(parameters: type[Parameters], data: Mapping[str, Any]) -> Parameters:
    """The parameters in a table that `parameter_problems` found nothing wrong with; what else is in it is left out."""
    own = [field.name for field in dataclasses.fields(parameters) if field.init]  # type: ignore[arg-type]
    checked = model_of(parameters).model_validate({name: data[name] for name in own if name in data})
    return parameters(**{name: getattr(checked, name) for name in own})


def field_names(parameters: type) -> tuple[str, ...]:
    """What these parameters are called in a study file, in the order of the class. Raises as `model_of`."""
    return tuple(model_of(parameters).model_fields)


def _default(field: dataclasses.Field[Any]) -> Any:
    if field.default is not dataclasses.MISSING:
        return field.default
    if field.default_factory is not dataclasses.MISSING:
        return Field(default_factory=field.default_factory)
    return ...


def _strict(annotation: Any, place: str) -> Any:
    """The type, with every number and text in it strict."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        parts = (_strict(arguments[0], place), *annotation.__metadata__)
        return _ANNOTATED[parts]
    if annotation in _SCALARS:
        return Annotated[annotation, _SCALARS[annotation]]
    if origin is tuple:
        items = tuple(item if item is ... else _strict(item, place) for item in arguments)
        return _TUPLE[items]
    if origin in (Union, types.UnionType):
        return Union[tuple(item if item is type(None) else _strict(item, place) for item in arguments)]  # noqa: UP007
    if origin is typing.Literal:
        return annotation
    raise StudyError(f"{place} has type {annotation!r}; a study file holds {_ALLOWED}")
