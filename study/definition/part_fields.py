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
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

import pydantic
from pydantic import Field

from study.definition.field_types import Part
from study.definition.toml_reader import Problem, model_problems
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
    `StudyError` when the class is no frozen dataclass, a field has a type no study file can hold, or a name is taken.
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
    except Exception as error:  # an annotation may be any expression of its author's
        raise StudyError(f"the types of {name} cannot be read: {type(error).__name__}: {error}") from error
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(parameters):
        if field.name in base.model_fields:
            raise StudyError(f"field {field.name!r} of {name} is taken; others are {', '.join(base.model_fields)}")
        if field.init:
            fields[field.name] = (_strict(hints[field.name], f"{name}.{field.name}"), _default(field))
    model: type[pydantic.BaseModel] = pydantic.create_model(
        parameters.__name__, __base__=base, __module__=parameters.__module__, __doc__=parameters.__doc__, **fields
    )
    return model


def parameter_problems(parameters: type, data: Mapping[str, Any], base: type[Part] = Part) -> tuple[Problem, ...]:
    """Everything that is wrong with a table of these parameters; empty when `made` takes it. Raises as `model_of`."""
    found = model_problems(model_of(parameters, base), data)
    if any(problem.path[0] not in base.model_fields for problem in found):
        return found  # what its fields have to do with one another can only be said of right ones
    try:
        made(parameters, data)
    except WrongParameter as wrong:
        return (*found, Problem((wrong.field,), wrong.sentence))
    except Exception as error:  # somebody else's code may raise whatever it likes
        # "alpha is 3.0; it must be 0": the field comes first, if it is about one
        field, _, rest = str(error).partition(" is ")
        about = field in {item.name for item in dataclasses.fields(parameters)}
        return (*found, Problem((field,), rest.partition("; it ")[2] or rest) if about else Problem((), str(error)))
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
