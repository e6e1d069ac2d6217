"""Reading a TOML file into a checked model, and saying everything that is wrong with it in our own words.

A researcher edits a study file by hand. So a problem is one line with the file, the line, the field, the value that
stands there and what may stand there instead, and all problems are told at once.
"""

from __future__ import annotations

import difflib
import re
import sys
import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union, get_args, get_origin

import annotated_types
import pydantic
from pydantic.fields import FieldInfo

from study.records import StudyError
from study.text_file import text_of

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

FieldPath = tuple[Union[str, int], ...]  # noqa: UP007 - evaluated at run time on 3.10 as well

_HEADER = re.compile(r"^\s*(\[\[?)([A-Za-z0-9_.\"' \t-]+)(\]\]?)\s*(#.*)?$")
_KEY = re.compile(r"^\s*([A-Za-z0-9_-]+|\"[^\"]*\"|'[^']*')\s*=\s*(.*)$")
_LONGEST_VALUE_SHOWN = 60
_LONGEST_PROBLEM = 1_000
_MOST_DEPTH = 50
"""Of tables and lists in one another; a study has four."""
_KEY_PARTS = re.compile(rf"(?<![\w\"'-])(?:(?:[\w-]+|\"[^\"\n]*\"|'[^'\n]*')[ \t]*\.[ \t]*){{{_MOST_DEPTH}}}", re.ASCII)
"""The beginning of a key of more parts than that, which the library takes a time for that grows with their square."""
_LONG_NUMBER = re.compile(r"\d[\d_]{1000}")
_MOST_WHOLE = 2**63 - 1
"""The largest whole number that TOML has, and that a database holds."""


class StudyFileError(StudyError):
    """A study file that cannot be used. `problems` holds one line for each thing that is wrong."""

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(in_one_line(problem) for problem in problems)
        super().__init__("\n".join(self.problems))


def in_one_line(text: str) -> str:
    """A sentence with what would break or steer its line as escapes, whatever stands in the file that it is about."""
    plain = "".join(sign if sign.isprintable() or sign == "\u00a0" else repr(sign)[1:-1] for sign in text)
    return plain if len(plain) <= _LONGEST_PROBLEM else f"{plain[: _LONGEST_PROBLEM - 1]}…"


@dataclass(frozen=True)
class Problem:
    """Something wrong at a place in the file; `sentence` starts in lower case and has no full stop."""

    path: FieldPath
    sentence: str


def parse_toml(source: bytes, name: str) -> tuple[dict[str, Any], str]:
    """The data and the text of a TOML file; raises `StudyFileError` with the line where reading stopped."""
    try:
        text = text_of(source)
    except ValueError as error:
        raise StudyFileError([f"{name}: {error}"]) from None
    deep = _KEY_PARTS.search(text)
    if deep:
        raise StudyFileError([f"{name}:{_line(text, deep.start())}: nested too deeply"])
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        found = re.search(r" \(at line (\d+), column (\d+)\)", message)
        line = found.group(1) if found else str(text.count("\n") + 1)
        sentence = re.sub(r" \(at .*\)$", "", message)
        raise StudyFileError([f"{name}:{line}: not valid TOML: {sentence}"]) from None
    except RecursionError:
        raise StudyFileError([f"{name}: nested too deeply"]) from None
    except ValueError:  # the library's own are all of the kind above; this is Python's, of a number it will not read
        long = _LONG_NUMBER.search(text)
        raise StudyFileError([f"{name}:{_line(text, long.start() if long else 0)}: a number is too long"]) from None
    problems = [report(name, text, data, [problem]).problems[0] for problem in _beyond(data)]
    if problems:
        raise StudyFileError(problems)
    return data, text


def _line(text: str, position: int) -> int:
    return text.count("\n", 0, position) + 1


def _beyond(data: Mapping[str, Any]) -> Iterator[Problem]:
    """What TOML's grammar lets pass and no database takes: the first of each kind."""
    waiting: list[tuple[FieldPath, Any]] = [((), data)]
    told: set[str] = set()
    while waiting:
        path, value = waiting.pop()
        sentence = ""
        if len(path) > _MOST_DEPTH:
            sentence = "nested too deeply"
        elif isinstance(value, Mapping):
            waiting += [((*path, key), inner) for key, inner in value.items()]
            if any("\x00" in key for key in value):
                sentence = "a name has the character U+0000 in it"
        elif isinstance(value, list):
            waiting += [((*path, number), inner) for number, inner in enumerate(value)]
        elif isinstance(value, str):
            sentence = "the character U+0000 is no text" if "\x00" in value else ""
        elif isinstance(value, int) and not -_MOST_WHOLE - 1 <= value <= _MOST_WHOLE:
            sentence = "a whole number must fit into 64 bits"
        if sentence and sentence not in told:
            told.add(sentence)
            yield Problem(path, sentence)


@dataclass(frozen=True)
class FileBeside:
    """A file beside the study file whose data stand at a path of the study's: problems there are told of the file."""

    path: FieldPath
    name: str
    text: str
    data: Mapping[str, Any]


def report(
    name: str, text: str, data: Mapping[str, Any], problems: Iterable[Problem], beside: Sequence[FileBeside] = ()
) -> StudyFileError:
    """The error for these problems: `file:line: field = value: sentence`, in the order of the file.

    Those of a file beside it come after its own, with that file's lines.
    """
    found = list(problems)
    told: list[str] = []
    for file in beside:
        depth = len(file.path)
        inside = [problem for problem in found if problem.path[:depth] == file.path]
        found = [problem for problem in found if problem not in inside]
        moved = [Problem(problem.path[depth:], problem.sentence) for problem in inside]
        told += _sentences(file.name, file.text, file.data, moved)
    return StudyFileError([*_sentences(name, text, data, found), *told])


def _sentences(name: str, text: str, data: Mapping[str, Any], problems: Iterable[Problem]) -> list[str]:
    lines = line_numbers(text)
    told: dict[tuple[int, str], None] = {}
    for problem in problems:
        line = _line_of(problem.path, lines)
        place = f"{name}:{line}" if line else name
        label = spell(problem.path) or "(the whole file)"
        present, value = look_up(data, problem.path)
        shown = f" = {show(value)}" if present and not isinstance(value, dict) else ""
        told[(line, f"{place}: {label}{shown}: {problem.sentence}")] = None
    return [sentence for _, sentence in sorted(told, key=lambda item: item[0])]


def closest(word: str, choices: Iterable[str]) -> str:
    """`; did you mean 'x'?` when a choice is close to the word, else nothing."""
    matches = difflib.get_close_matches(word, list(choices), n=1, cutoff=0.6)
    return f"; did you mean {matches[0]!r}?" if matches else ""


def choices_sentence(value: object, choices: Iterable[str], what: str = "allowed") -> str:
    """`not one of the choices; did you mean …? allowed: …`."""
    listed = list(choices)
    hint = closest(value, listed) if isinstance(value, str) else ""
    return f"not known{hint or ';'} {what}: {', '.join(listed) or 'none'}"


def spell(path: FieldPath) -> str:
    """`conditions[2].alpha` for ("conditions", 1, "alpha"): entries are counted from 1, as a reader counts."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            text += f".{part}" if text else part
    return text


def show(value: object) -> str:
    """A value as it may stand in the file, shortened."""
    if isinstance(value, bool):
        return "true" if value else "false"
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= _LONGEST_VALUE_SHOWN else text[: _LONGEST_VALUE_SHOWN - 1] + "…"


def look_up(data: object, path: FieldPath) -> tuple[bool, Any]:
    """Whether there is a value at the path, and the value."""
    for part in path:
        is_entry = isinstance(data, list) and isinstance(part, int) and 0 <= part < len(data)
        if not is_entry and not (isinstance(data, Mapping) and part in data):
            return False, None
        data = data[part]  # type: ignore[index]
    return True, data


def tables(value: object) -> list[tuple[int, Mapping[str, Any]]]:
    """The tables of a list of unchecked data, each with its position."""
    entries = value if isinstance(value, list) else []
    return [(position, entry) for position, entry in enumerate(entries) if isinstance(entry, dict)]


def line_numbers(text: str) -> dict[FieldPath, int]:
    """The line of every table header, of every key that starts a line, and of every entry of its list, by path."""
    found: dict[FieldPath, int] = {}
    counts: dict[FieldPath, int] = {}
    table: FieldPath = ()
    place: FieldPath = ()
    depth, closing = 0, ""  # inside a value that goes on over lines: open brackets, or a multi-line string
    entries = _Entries()
    for number, line in enumerate(text.split("\n"), start=1):  # U+2028 and the like end no line of TOML
        if closing:
            if closing in line:
                closing = ""
            continue
        rest = line
        if depth == 0:
            header, key = _HEADER.match(line), _KEY.match(line)
            if header and len(header.group(1)) == len(header.group(3)):
                table = _table_path(header.group(2), counts, header.group(1) == "[[")
                found.setdefault(table, number)
                continue
            if not key:
                continue
            place = (*table, key.group(1).strip("\"'"))
            found.setdefault(place, number)
            rest = key.group(2)
            entries = _Entries()
        for quotes in ('"""', "'''"):
            if rest.count(quotes) % 2:
                closing = quotes
        if not closing:
            bare = _COMMENT_OR_TEXT.sub(_bare, rest)
            for entry in entries.begun(bare):
                found.setdefault((*place, entry), number)
            depth = max(0, depth + bare.count("[") + bare.count("{") - bare.count("]") - bare.count("}"))
    return found


_COMMENT_OR_TEXT = re.compile(r"\"(?:\\.|[^\"\\])*\"|'[^']*'|#.*")


def _bare(found: re.Match[str]) -> str:
    return "" if found[0].startswith("#") else "s"


class _Entries:
    """Counts the entries of a list that goes on over lines, whose texts have been taken out."""

    def __init__(self) -> None:
        self._depth, self._count, self._between = 0, 0, False

    def begun(self, bare: str) -> list[int]:
        """Positions of the entries that begin on this line."""
        begun = []
        for sign in bare:
            if self._between and self._depth == 1 and not sign.isspace() and sign not in ",]":
                begun.append(self._count)
                self._count += 1
                self._between = False
            if sign in "[{":
                self._depth += 1
                self._between = self._between or (self._depth == 1 and sign == "[")
            elif sign in "]}":
                self._depth -= 1
            elif sign == "," and self._depth == 1:
                self._between = True
        return begun


def _table_path(header: str, counts: dict[FieldPath, int], is_array: bool) -> FieldPath:
    path: FieldPath = ()
    names = [name.strip(" \"'") for name in header.split(".")]
    for position, name in enumerate(names):
        path = (*path, name)
        if is_array and position == len(names) - 1:
            counts[path] = counts.get(path, -1) + 1
        if path in counts:
            path = (*path, counts[path])
    return path


def _line_of(path: FieldPath, lines: Mapping[FieldPath, int]) -> int:
    """The line of the path or of the nearest thing around it; 0 when the file has no such place."""
    while path and path not in lines:
        path = path[:-1]
    return lines.get(path, 0)


def model_problems(model: type[pydantic.BaseModel], data: Mapping[str, Any]) -> tuple[Problem, ...]:
    """Everything the model's types and bounds find wrong with the data; empty when `model_validate` takes it."""
    try:
        model.model_validate(data)
    except pydantic.ValidationError as error:
        found = [_with_all_entries(item) for item in error.errors(include_url=False)]
        return tuple(_translate(model, data, item) for item in found if item is not None)
    return ()


def _with_all_entries(error: Any) -> Any:
    """Of a list that is too short: the validator has left its wrong entries out, which are told by themselves. None if
    it is long enough with them."""
    context, given = error.get("ctx", {}), error["input"]
    if error["type"] != "too_short" or not isinstance(given, (list, tuple)):
        return error
    return None if len(given) >= context["min_length"] else {**error, "ctx": {**context, "actual_length": len(given)}}


def _translate(model: type[pydantic.BaseModel], data: Mapping[str, Any], error: Any) -> Problem:
    path: FieldPath = tuple(error["loc"])
    kind: str = error["type"]
    context: Mapping[str, Any] = error.get("ctx", {})
    if kind == "extra_forbidden":
        owner = _model_at(model, path[:-1])
        names = [name for name in owner.model_fields if name not in getattr(owner, "NOT_IN_FILE", ())]
        return Problem(path, f"unknown field{closest(str(path[-1]), names) or ';'} fields here: {', '.join(names)}")
    if kind == "missing":
        return Problem(path, f"missing; {_expected(model, path)}")
    if kind == "literal_error":
        sentence = choices_sentence(error["input"], _literals(model, path))
        return Problem(path, sentence)
    if kind in {"too_short", "too_long"}:
        limit = context.get("min_length", context.get("max_length"))
        side = "at least" if kind == "too_short" else "at most"
        return Problem(path, f"has {context['actual_length']} entries, must have {side} {limit}")
    if kind == "string_too_short":
        least = context["min_length"]
        return Problem(path, "must not be empty" if least == 1 else f"must have at least {least} characters")
    if kind == "string_too_long":
        return Problem(path, f"must have at most {context['max_length']} characters")
    if kind == "string_pattern_mismatch":
        if ":" in context["pattern"].replace("?:", ""):
            return Problem(path, "must be a name, or file.py:Class for one in a file beside this one")
        has_capitals = "A-Z" in context["pattern"]
        return Problem(path, f"must be {'' if has_capitals else 'lower-case '}letters, digits and '_'")
    if kind == "finite_number" or kind.startswith(("greater_than", "less_than")):
        return Problem(path, _expected(model, path))
    if kind.endswith(("_type", "_parsing", "_from_float")):
        return Problem(path, f"{_expected(model, path)}, not {_noun(error['input'])}")
    return Problem(path, str(error["msg"]))


def _expected(model: type[pydantic.BaseModel], path: FieldPath) -> str:
    """`must be a number above 0 and at most 0.2`, from the model's own field."""
    field = _field_at(model, path)
    if field is None:
        return "must be a text" if path and isinstance(path[-1], int) else "must be given"
    extra = field.json_schema_extra
    if isinstance(extra, dict) and "expected" in extra:
        return f"must be {extra['expected']}"
    literals = _literals(model, path)
    if literals:
        return f"must be one of: {', '.join(literals)}"
    nouns = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}
    annotation = field.annotation
    if isinstance(path[-1], int) and get_args(annotation):
        annotation = get_args(annotation)[0]
    if isinstance(annotation, type) and issubclass(annotation, pydantic.BaseModel):
        noun = "a table"
    elif get_origin(annotation) is tuple:
        noun = "a list"
    elif isinstance(annotation, type) and annotation in nouns:
        noun = nouns[annotation]
    else:
        noun = "a text or a list of texts" if annotation is None else "of the right type"
    bounds = []
    for item in field.metadata:
        if isinstance(item, annotated_types.Gt):
            bounds.append(f"above {_bound(item.gt, annotation)}")
        elif isinstance(item, annotated_types.Ge):
            bounds.append(f"at least {_bound(item.ge, annotation)}")
        elif isinstance(item, annotated_types.Lt):
            bounds.append(f"below {_bound(item.lt, annotation)}")
        elif isinstance(item, annotated_types.Le):
            bounds.append(f"at most {_bound(item.le, annotation)}")
    return f"must be {noun} {' and '.join(bounds)}".rstrip()


def _bound(bound: Any, annotation: Any) -> Any:
    """0.0 for a number's bound of 0: `typing` keeps one of `Annotated[float, Ge(0)]` and `Annotated[float, Ge(0.0)]`,
    whichever came first."""
    return float(bound) if annotation is float and isinstance(bound, int) else bound


def _literals(model: type[pydantic.BaseModel], path: FieldPath) -> list[str]:
    field = _field_at(model, path)
    annotation: Any = field.annotation if field else None
    while annotation is not None and get_origin(annotation) not in (None, typing.Literal):
        arguments = get_args(annotation)
        annotation = arguments[0] if arguments else None
    return [str(choice) for choice in get_args(annotation)] if get_origin(annotation) is typing.Literal else []


def _field_at(model: type[pydantic.BaseModel], path: FieldPath) -> FieldInfo | None:
    while path and isinstance(path[-1], int):
        path = path[:-1]
    return _model_at(model, path[:-1]).model_fields.get(str(path[-1])) if path else None


def _model_at(model: type[pydantic.BaseModel], path: FieldPath) -> type[pydantic.BaseModel]:
    """The model that describes the table at the path."""
    for part in path:
        if isinstance(part, int) or part not in model.model_fields:
            continue
        annotation: Any = model.model_fields[part].annotation
        for candidate in (annotation, *get_args(annotation)):
            if isinstance(candidate, type) and issubclass(candidate, pydantic.BaseModel):
                model = candidate
                break
    return model


def _noun(value: object) -> str:
    nouns: tuple[tuple[type, str], ...] = (
        (bool, "true or false"),
        (int, "a whole number"),
        (float, "a number"),
        (str, "a text"),
        (list, "a list"),
        (dict, "a table"),
    )
    return next((noun for kind, noun in nouns if isinstance(value, kind)), type(value).__name__)
