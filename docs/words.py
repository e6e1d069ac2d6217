"""What the reference pages are written with: Markdown, and types of the code in words."""

from __future__ import annotations

import ast
import inspect
import json
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING
from typing import Any

from pydantic import BaseModel

Schema = Mapping[str, Any]

# ---- Markdown ---------------------------------------------------------------------------------------------------


def cell(text: str) -> str:
    """Text as a cell of a table takes it: one line, no column of its own, no HTML."""
    line = re.sub(r"\s+", " ", text).strip().replace("|", r"\|")
    return "".join(part if part.startswith("`") else part.replace("<", "&lt;") for part in re.split(r"(`[^`]+`)", line))


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of Markdown; nothing if it has no rows."""
    lines = [f"| {' | '.join(cell(text) for text in row)} |" for row in rows]
    return "\n".join([f"| {' | '.join(head)} |", "|---" * len(head) + "|", *lines]) if lines else ""


def joined(*parts: str) -> str:
    """Parts with a blank line between them; those without text are left out."""
    return "\n\n".join(part.strip("\n") for part in parts if part.strip()) + "\n"


def code(value: object) -> str:
    """A value as it is typed."""
    return f"`{json.dumps(value, ensure_ascii=False)}`"


def sentence(text: str) -> str:
    """Text with a capital and a full stop."""
    line = " ".join(text.split())
    return line[:1].upper() + line[1:] + ("" if line[-1:] in ("", ".", "?", "!", ":") else ".")


# ---- what a value may be, in words ------------------------------------------------------------------------------


def kind(schema: Schema, defs: Mapping[str, Schema]) -> str:
    """Type and bounds of a JSON schema in words."""
    if "$ref" in schema:
        target = defs[schema["$ref"].rpartition("/")[2]]
        return kind(target, defs) if target.get("type") != "object" else f"object, {link(schema, defs)}"
    if "const" in schema:
        return code(schema["const"])
    if "enum" in schema:
        return " or ".join(code(value) for value in schema["enum"])
    for union in ("anyOf", "oneOf"):
        if union in schema:
            options = list(dict.fromkeys(kind(option, defs) for option in schema[union]))
            return ("; or " if any(" or " in option for option in options) else " or ").join(options)
    return _SIMPLE.get(schema.get("type", ""), _anything)(schema, defs)


def _anything(schema: Schema, defs: Mapping[str, Schema]) -> str:
    return "anything"


def _number(schema: Schema, defs: Mapping[str, Schema]) -> str:
    noun = "whole number" if schema["type"] == "integer" else "number"
    bounds = [
        f"{words} {_plain(schema[name])}"
        for name, words in (
            ("minimum", "at least"),
            ("exclusiveMinimum", "more than"),
            ("maximum", "at most"),
            ("exclusiveMaximum", "less than"),
        )
        if name in schema
    ]
    return ", ".join([noun, *bounds])


def _plain(value: float) -> str:
    return str(int(value)) if value == int(value) else f"{value:g}"


_PATTERNS: Mapping[str, str] = {
    "^[a-z0-9][a-z0-9_]*$": "an id of small letters, digits and `_`",
    "^[A-Za-z][A-Za-z0-9_-]*$": "a name of letters, digits, `_` and `-`",
    "^[A-Za-z0-9._:-]+$": "an id of letters, digits and `.` `_` `:` `-`",
}
"""What the patterns ask for, in words."""


def _text(schema: Schema, defs: Mapping[str, Schema]) -> str:
    pattern = schema.get("pattern")
    bounds = [_PATTERNS.get(pattern, f"text like `{pattern}`") if pattern else "text"]
    if schema.get("minLength") and not pattern:
        bounds.append("not empty" if schema["minLength"] == 1 else f"at least {schema['minLength']} characters")
    if "maxLength" in schema:
        bounds.append(f"at most {schema['maxLength']} characters")
    return ", ".join(bounds)


def _list(schema: Schema, defs: Mapping[str, Schema]) -> str:
    if "prefixItems" in schema:
        parts = [kind(part, defs) for part in schema["prefixItems"]]
        return f"list of {len(parts)}, each {parts[0]}" if len(set(parts)) == 1 else f"list of {'; '.join(parts)}"
    bounds = [f"list of: {kind(schema.get('items', {}), defs)}"]
    if schema.get("minItems"):
        bounds.append(f"{schema['minItems']} or more")
    if "maxItems" in schema:
        bounds.append(f"at most {schema['maxItems']}")
    return "; ".join(bounds)


def _object(schema: Schema, defs: Mapping[str, Schema]) -> str:
    values = schema.get("additionalProperties")
    return f"object of: {kind(values, defs)}" if isinstance(values, Mapping) and values else "object"


_SIMPLE: Mapping[str, Callable[[Schema, Mapping[str, Schema]], str]] = {
    "integer": _number,
    "number": _number,
    "string": _text,
    "array": _list,
    "object": _object,
    "boolean": lambda schema, defs: "`true` or `false`",
    "null": lambda schema, defs: "`null`",
}


def default(name: str, schema: Schema) -> str:
    """The default of a field of an object's schema."""
    if name in schema.get("required", ()):
        return "must be given"
    value = schema["properties"][name].get("default", MISSING)
    return "" if value is MISSING else code(value)


def link(schema: Schema, defs: Mapping[str, Schema]) -> str:
    """A JSON schema in words, with a link where it is described by itself; nothing for none."""
    if not schema:
        return ""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2].lstrip("_")
        return f"[{name}](#{name.lower()})"
    if schema.get("type") == "array" and "$ref" in schema.get("items", {}):
        return f"a list of {link(schema['items'], defs)}"
    return kind(schema, defs)


def attribute_texts(owner: type) -> dict[str, str]:
    """The string below each field of a class and of what it is made from: what the field means."""
    texts: dict[str, str] = {}
    for cls in reversed(owner.__mro__):
        if cls.__module__.split(".")[0] not in ("app", "study"):
            continue
        (definition,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
        assert isinstance(definition, ast.ClassDef)
        for field, below in zip(definition.body, definition.body[1:], strict=False):
            if not (isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)):
                continue
            if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
                texts[field.target.id] = " ".join(str(below.value.value).split())
    return texts


def field_rows(
    model: type[BaseModel], schema: Schema, defs: Mapping[str, Schema], skip: Iterable[str] = ()
) -> Iterator[tuple[str, str, str, str]]:
    """Name, kind, default and meaning of each field."""
    texts = attribute_texts(model)
    for name, field in schema.get("properties", {}).items():
        if name not in skip:
            yield f"`{name}`", kind(field, defs), default(name, schema), texts.get(name) or field.get("description", "")
