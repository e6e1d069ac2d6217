"""A part's dataclass becomes the fields of its table: strict, bounded, and told with the file's own words."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

import pytest
from annotated_types import Ge
from pydantic import Field, ValidationError

from study.definition.field_types import Part
from study.definition.part_fields import WrongParameter, made, model_of, parameter_problems
from study.records import StudyError


@dataclass(frozen=True)
class Parameters:
    """What a part takes."""

    weight: Annotated[float, Field(ge=0.0, le=2.0)]
    count: Annotated[int, Field(ge=1, lt=6)] = 2
    loud: bool = True
    word: Annotated[str, Field(min_length=1)] = "go"
    mode: Literal["slow", "fast"] = "slow"
    goals: tuple[float, ...] = (0.5,)
    names: tuple[str, ...] = field(default_factory=tuple)
    limit: float | None = None

    def __post_init__(self) -> None:
        if self.word == "stop":
            raise ValueError("word is 'stop'; it must be another one")
        if self.word == "end":
            raise RuntimeError("cannot go on")
        if self.word == "exit":
            raise SystemExit(3)
        if self.word == "lines":
            raise ValueError("not\n  this\x1b[31m\nway" + " and on" * 100)
        if self.count > 4 and self.mode == "slow":
            raise WrongParameter("count", f"must be at most 4 with mode {self.mode!r}")


class Common(Part):
    """What the table has besides."""

    kind: str = "a"


def sentences(data: dict[str, object], base: type[Part] = Part) -> dict[str, str]:
    return {".".join(map(str, each.path)): each.sentence for each in parameter_problems(Parameters, data, base)}


def test_right_values_make_the_dataclass_and_a_whole_number_is_a_number() -> None:
    values = made(Parameters, {"weight": 1, "count": 3, "goals": [1, 2.5], "names": ["x"], "limit": 2})
    assert values == Parameters(1.0, 3, goals=(1.0, 2.5), names=("x",), limit=2.0)
    assert [type(value) for value in (values.weight, *values.goals, values.limit)] == [float] * 4
    assert parameter_problems(Parameters, {"weight": 1}) == ()


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("weight", True, "must be a number at least 0.0 and at most 2.0, not true or false"),
        ("weight", "1", "must be a number at least 0.0 and at most 2.0, not a text"),
        ("weight", math.nan, "must be a number at least 0.0 and at most 2.0"),
        ("weight", math.inf, "must be a number at least 0.0 and at most 2.0"),
        ("weight", -0.1, "must be a number at least 0.0 and at most 2.0"),
        ("count", 2.0, "must be a whole number at least 1 and below 6, not a number"),
        ("count", True, "must be a whole number at least 1 and below 6, not true or false"),
        ("count", 6, "must be a whole number at least 1 and below 6"),
        ("loud", 1, "must be true or false, not a whole number"),
        ("word", 5, "must be a text, not a whole number"),
        ("word", "", "must not be empty"),
        ("mode", "fats", "not known; did you mean 'fast'? allowed: slow, fast"),
        ("goals", 3.0, "must be a list, not a number"),
        ("zzz", "red", "unknown field; fields here: weight, count, loud, word, mode, goals, names, limit"),
    ],
)
def test_wrong_values_are_told_with_their_bounds(name: str, value: object, sentence: str) -> None:
    assert sentences({"weight": 1.0, name: value}) == {name: sentence}


def test_lists_hold_strict_numbers_too() -> None:
    assert list(sentences({"weight": 1.0, "goals": [1.0, math.nan, True, "2"]})) == ["goals.1", "goals.2", "goals.3"]


def test_what_is_missing_and_what_clashes_is_said_at_its_field() -> None:
    assert sentences({}) == {"weight": "missing; must be a number at least 0.0 and at most 2.0"}
    assert sentences({"weight": 1.0, "count": 5}) == {"count": "must be at most 4 with mode 'slow'"}
    assert sentences({"weight": 1.0, "count": 5, "mode": "fast"}) == {}
    assert sentences({"weight": 1.0, "word": "stop"}) == {"word": "must be another one"}
    assert sentences({"weight": 1.0, "word": "end"}) == {"": "cannot go on"}
    assert sentences({"weight": 1.0, "word": "exit"}) == {"": "raises SystemExit: 3"}
    (told,) = sentences({"weight": 1.0, "word": "lines"}).values()
    assert told.startswith("not this?[31m way and on") and told.endswith("…") and len(told) == 300


def test_the_table_may_have_fields_of_its_own_beside_them() -> None:
    assert sentences({"kind": "b", "weight": 1.0}, Common) == {}
    assert sentences({"kind": "b", "wieght": 1.0}, Common)["wieght"].startswith("unknown field; did you mean 'weight'?")
    assert list(sentences({"kind": 5, "weight": 1.0, "count": 5}, Common)) == ["kind", "count"]
    assert made(Parameters, {"kind": "b", "weight": 1.0}) == Parameters(1.0)


def test_a_model_is_made_once_and_changes_no_more() -> None:
    assert model_of(Parameters) is model_of(Parameters)
    with pytest.raises(ValidationError):
        model_of(Parameters).model_validate({"weight": 1.0}).weight = 2.0  # type: ignore[attr-defined]


@dataclass
class Thawed:
    weight: float = 1.0


@dataclass(frozen=True)
class Odd:
    place: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Taken:
    kind: str = "x"


@dataclass(frozen=True)
class Unreadable:
    weight: Nowhere = 1.0  # type: ignore[name-defined] # noqa: F821


@dataclass(frozen=True)
class OutOfBounds:
    weight: Annotated[float, Field(ge=0.0)] = -1.0


@dataclass(frozen=True)
class OfAnotherType:
    weight: float = "heavy"  # type: ignore[assignment]


@dataclass(frozen=True)
class NotFinite:
    weights: tuple[float, ...] = (1.0, math.nan)


@dataclass(frozen=True)
class NoFactory:
    names: tuple[str, ...] = field(default_factory=lambda: 1 / 0)  # type: ignore[arg-type, return-value]


@dataclass(frozen=True)
class Aliased:
    weight: Annotated[float, Field(alias="mass")] = 1.0


@dataclass(frozen=True)
class OfTheLibrary:
    model_config: int = 1


@dataclass(frozen=True)
class Hidden:
    _weight: int = 1


@dataclass(frozen=True)
class NoBound:
    weight: Annotated[float, Ge("a")] = 1.0


@dataclass(frozen=True)
class NoPattern:
    word: Annotated[str, Field(pattern="(")] = "a"


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        (
            OutOfBounds,
            r"OutOfBounds: the default -1.0 of weight must be a number at least 0.0: change it, or the bound",
        ),
        (OfAnotherType, "OfAnotherType: the default 'heavy' of weight must be a number, not a text: change it"),
        (NotFinite, r"NotFinite: the default \(1.0, nan\) of weights must be "),
        (NoFactory, "NoFactory cannot be made into keys of a study file: .*division by zero"),
        (Aliased, "field 'weight' of .*Aliased has an alias; a key of a study file has the field's own name"),
        (OfTheLibrary, "field 'model_config' of .*OfTheLibrary cannot be a key of a study file"),
        (Hidden, "field '_weight' of .*Hidden cannot be a key of a study file"),
        (NoBound, "NoBound cannot be made into keys of a study file: TypeError: must be real number, not str"),
        (NoPattern, "NoPattern cannot be made into keys of a study file: .*unclosed group"),
        (Thawed, "Thawed must be a frozen dataclass"),
        (int, "int must be a frozen dataclass"),
        (Odd, "Odd.place has type dict.* a study file holds bool, int, float"),
        (Taken, "field 'kind' of .*Taken is taken; others are kind"),
        (Unreadable, "the types of .*Unreadable cannot be read: NameError"),
    ],
)
def test_a_class_that_cannot_be_a_table_is_refused_in_one_line(parameters: type, sentence: str) -> None:
    with pytest.raises(StudyError, match=sentence) as caught:
        model_of(parameters, Common)
    assert "\n" not in str(caught.value)


@dataclass(frozen=True)
class OftenTaken:
    """Methods of the library's models are called so as well."""

    copy: int = 1
    json: int = 2
    schema: int = 3


def test_names_that_the_library_uses_too_are_taken_without_a_word(recwarn: pytest.WarningsRecorder) -> None:
    assert made(OftenTaken, {"copy": 5, "json": 6, "schema": 7}) == OftenTaken(5, 6, 7)
    assert list(recwarn) == []
