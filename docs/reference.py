"""The reference pages, made from the code when the site is built: nothing in them is written twice.

A page in `reference/` has words of its own and a line `<!-- generated: NAME -->`; the text of `GENERATED[NAME]` takes
the line's place. Each of these functions returns Markdown and can be called without Sphinx.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from app import wire
from app.commands import described
from app.config import LabConfig
from app.lab.lab import Lab
from app.limits import Limits
from app.trial.parts import REGISTRIES
from app.web.access import ErrorReply
from app.web.server import create_app
from docs.words import (
    Schema,
    attribute_texts,
    code,
    default,
    field_rows,
    joined,
    kind,
    link,
    sentence,
    table,
)
from study.definition.builtin_questionnaires import INSTRUMENTS
from study.definition.field_types import Part
from study.definition.layouts import shipped_layouts, shipped_objects
from study.definition.part_fields import model_of
from study.definition.study import DEFAULT_STUDY, Study
from study.flow.notes import NAMESPACE, NOTES, OWN
from study.flow.steps import STEP_DATA
from study.records import DESCRIPTIONS, KEYS, REFERENCES, TABLES, ColumnInfo, columns

# ---- the study file ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StudyTable:
    """One table of the study file: its header as it is written, and the model of what stands in it."""

    header: str
    path: str
    model: type[Part]


def study_tables(model: type[Part] = Study, path: str = "") -> Iterator[StudyTable]:
    """The tables of a study file inside `model`, each followed by those inside it."""
    for name, field in model.model_fields.items():
        part = _part_in(field.annotation)
        if part is not None:
            inside = f"{path}.{name}".lstrip(".")
            is_list = part is not field.annotation
            yield StudyTable(f"[[{inside}]]" if is_list else f"[{inside}]", inside, part)
            yield from study_tables(part, inside)


def _part_in(annotation: Any) -> type[Part] | None:
    if isinstance(annotation, type) and issubclass(annotation, Part):
        return annotation
    return next((part for inner in get_args(annotation) if (part := _part_in(inner))), None)


def own_keys(model: type[Part]) -> tuple[str, ...]:
    """The keys of a table that are no tables themselves."""
    hidden = getattr(model, "NOT_IN_FILE", ())
    return tuple(
        name for name, field in model.model_fields.items() if name not in hidden and _part_in(field.annotation) is None
    )


@dataclass(frozen=True)
class Comments:
    """The comments of the shipped study file: beside a key, by table and key, and above or beside a table's header."""

    of_key: Mapping[tuple[str, str], str]
    of_table: Mapping[str, str]


_COMMENT = re.compile(r"""((?:"[^"]*"|[^"#])*)#\s?(.*)""")


def comments(text: str) -> Comments:
    """Read the comments of a study file."""
    of_key: dict[tuple[str, str], str] = {}
    of_table: dict[str, str] = {}
    here, last, above, is_block_over = "", None, list[str](), False
    for line in text.splitlines():
        found = _COMMENT.match(line)
        before, said = (found[1].strip(), found[2].strip()) if found else (line.strip(), "")
        if not before:
            if not said:
                is_block_over = True
            elif line.startswith(" ") and last is not None:
                of_key[here, last] += f" {said}"
            else:
                above = [said] if is_block_over else [*above, said]
                is_block_over = False
            continue
        if header := re.fullmatch(r"\[+([\w.]+)\]+", before):
            here = header[1]
            told = " ".join(part for part in above if not part.startswith("----"))
            of_table.setdefault(here, f"{told} {said}".strip())
            last = None
        elif key := re.match(r"(\w+)\s*=", before):
            last = key[1] if said else None
            if said:
                of_key.setdefault((here, key[1]), said)
        above = []
    return Comments(of_key, of_table)


def study_file() -> str:
    """Every table and key of the study file: type, bounds, default, meaning."""
    schema = Study.model_json_schema()
    defs: Mapping[str, Schema] = schema["$defs"]
    said = comments(DEFAULT_STUDY.read_text(encoding="utf-8"))
    parts = []
    for item in [StudyTable("Top of the file", "", Study), *study_tables()]:
        inner = schema if item.model is Study else defs[item.model.__name__]
        texts = attribute_texts(item.model)
        rows = [
            (
                f"`{name}`",
                kind(inner["properties"][name], defs).removesuffix(_OR_NULL),
                default(name, inner).replace("`null`", "none"),
                _meaning(item, name, texts, said),
            )
            for name in own_keys(item.model)
        ]
        heading = f"`{item.header}`" if item.path else item.header
        about = "" if item.model is Study else sentence(inspect.getdoc(item.model) or "")
        parts += [
            f"## {heading}",
            about,
            sentence(said.of_table.get(item.path, "")),
            table(("key", "value", "default", "meaning"), rows),
        ]
    return joined(*parts, *_part_sections(), _ids())


_OR_NULL = " or `null`"
"""TOML has no null: such a key is left out, and its meaning says what holds then."""


def _meaning(item: StudyTable, name: str, texts: Mapping[str, str], said: Comments) -> str:
    return sentence(texts.get(name) or said.of_key.get((item.path, name), ""))


@dataclass(frozen=True)
class PartTable:
    """What an exchangeable part takes: the table it stands in, the line that names it, and its parameters."""

    header: str
    line: str
    parameters: type[Any]


def part_tables() -> Iterator[PartTable]:
    """Every part that ships and can be named in a study file."""
    for kind_, header, key in _PART_KEYS:
        registry = REGISTRIES[kind_]
        for name in registry.shipped:
            yield PartTable(header, f'{key} = "{name}"', registry.load(name).Parameters)


_PART_KEYS = (
    ("arbiter", "[[conditions]]", "arbiter"),
    ("inference", "[inference]", "kind"),
    ("distractor", "[distractor]", "kind"),
)


def _part_sections() -> Iterator[str]:
    for item in part_tables():
        taken: Any = item.parameters
        schema = model_of(taken).model_json_schema()
        texts = attribute_texts(item.parameters)
        rows = [
            (f"`{name}`", kind(schema["properties"][name], {}), default(name, schema), sentence(texts.get(name, "")))
            for name in schema.get("properties", {})
        ]
        yield f"## `{item.header}` with `{item.line}`"
        yield joined(
            sentence(inspect.getdoc(item.parameters) or ""), table(("key", "value", "default", "meaning"), rows)
        )


def _ids() -> str:
    layouts = shipped_layouts()
    bins = {item.id: item.label for layout in layouts.values() for item in layout.bins}
    return joined(
        "## Ids that the lab knows",
        table(
            ("key", "id", "what it is"),
            [
                *(
                    ("`layout`", f"`{name}`", f"{len(layout.places_m)} places for objects")
                    for name, layout in layouts.items()
                ),
                *(("`objects`", f"`{name}`", item.label) for name, item in shipped_objects().items()),
                *(("`bins`", f"`{name}`", label) for name, label in bins.items()),
                *(("`surveys`", f"`{name}`", form.title) for name, form in INSTRUMENTS.items()),
            ],
        ),
    )


# ---- the lab's settings and the command line --------------------------------------------------------------------


def command_line() -> str:
    """Every command with its options."""
    parts = []
    group = ""
    for command in described():
        if command.group != group:
            group = command.group
            parts.append(f"## {group}")
        rows = [
            (
                " ".join(f"`{name}`" for name in option.flags or (option.metavar,)),
                f"`{option.metavar}`" if option.metavar and option.flags else "",
                "must be given" if option.required else f"`{option.default}`" if option.default else "",
                sentence(option.help),
            )
            for option in command.options
        ]
        example = f"```sh\n{command.example}\n```" if command.example else ""
        heading = "###" if group else "##"
        parts += [
            f"{heading} `salab {command.name}`",
            joined(*(sentence(part) for part in command.help.split("\n\n"))),
            example,
            table(("option", "value", "default", "what it does"), rows),
        ]
    return joined(*parts)


OPTION_OF_SETTING: Mapping[str, str] = {
    "data_dir": "--data",
    "database_url": "--data",
    "study_file": "--study",
    "scene": "--no-scene",
    "trusted_proxies": "--trusted-proxy",
    "limits": "--limit",
}
"""Options of `salab serve` that are not called as their setting is."""
BESIDE_ANOTHER = frozenset({"--folder"})
"""Options that say `data_dir` where the option that usually does says something else."""


def settings() -> str:
    """Every setting of the lab, with the option of `salab serve` that sets it."""
    (serve,) = (command for command in described() if command.name == "serve")
    options = {flag for option in serve.options for flag in option.flags}
    texts = attribute_texts(LabConfig)
    rows = []
    for field in fields(LabConfig):
        option = OPTION_OF_SETTING.get(field.name, f"--{field.name.replace('_', '-')}")
        value = "" if field.default in (None, (), MISSING) else f"`{field.default}`"
        rows.append((f"`{field.name}`", f"`{option}`" if option in options else "", value, texts[field.name]))
    return joined(table(("setting", "option", "default", "what it is"), rows))


def limits() -> str:
    """Every bound on what a client may cost."""
    texts = attribute_texts(Limits)
    rows = [(f"`{field.name}`", f"`{field.default}`", texts[field.name]) for field in fields(Limits)]
    return table(("limit", "default", "what it is"), rows)


# ---- the export -------------------------------------------------------------------------------------------------


def export_columns() -> str:
    """Every column of every exported table."""
    parts = []
    for name in TABLES:
        key = ", ".join(f"`{column}`" for column in KEYS.get(name, ()))
        facts = [f"A row is found by {key}." if key else "Rows stand in the order they arrived."]
        if name in REFERENCES:
            facts.append(f"Each belongs to a row of [`{REFERENCES[name]}`](#{REFERENCES[name]}).")
        rows = [(f"`{info.name}`", _column_kind(info), info.unit or "", info.description) for info in columns(name)]
        about = f"{sentence(DESCRIPTIONS[name])} {' '.join(facts)}"
        parts += [f"## `{name}`", about, table(("column", "type", "unit", "meaning"), rows)]
    return joined(*parts)


def _column_kind(info: ColumnInfo) -> str:
    noun = {"int": "whole number", "float": "number", "str": "text"}[info.type]
    if info.json:
        noun = f"JSON {info.json}"
    if info.levels:
        noun = " or ".join(f"`{level}`" for level in info.levels)
    bounds = [f"at least {info.least}"] if info.least is not None else []
    bounds += [f"at most {info.most}"] if info.most is not None else []
    return ", ".join([noun, *bounds, *(["may be blank"] if info.optional else [])])


# ---- the API ----------------------------------------------------------------------------------------------------


def openapi() -> dict[str, Any]:
    """What the lab says of its own API."""
    return create_app(Lab(LabConfig(), None)).openapi()


def http_api() -> str:
    """Every route: what it does, what it takes, what it answers; then everything that is sent."""
    described = openapi()
    defs: Mapping[str, Schema] = described["components"]["schemas"]
    models = {model.__name__: model for model in sent_models()}
    parts = []
    for path, methods in described["paths"].items():
        for method, route in methods.items():
            rows = [
                (
                    f"`{item['name']}`",
                    f"in the {item['in']}",
                    kind(item["schema"], defs),
                    _default_of(item["schema"]),
                    item.get("description", ""),
                )
                for item in route.get("parameters", ())
            ]
            body = _content(route.get("requestBody", {}))
            takes = f"Takes {link(body, defs)}." if body else ""
            parts += [
                f"## `{method.upper()} {path}`",
                route.get("description", ""),
                table(("parameter", "where", "value", "default", "meaning"), rows),
                joined(takes, *_answers(route["responses"], defs)),
            ]
    parts.append("## What is sent")
    for name, schema in defs.items():
        rows_of = field_rows(models[name], schema, defs)
        about = schema.get("description", "")
        parts += [f"### {name.lstrip('_')}", about, table(("field", "value", "default", "meaning"), rows_of)]
    return joined(*parts)


def sent_models(base: type[BaseModel] = BaseModel) -> Iterator[type[BaseModel]]:
    """Every model of what the web front takes and sends."""
    for model in base.__subclasses__():
        if model.__module__.startswith("app.web."):
            yield model
        yield from sent_models(model)


def _answers(replies: Schema, defs: Mapping[str, Schema]) -> Iterator[str]:
    """What a route sends back, and how it refuses."""
    sent: list[str] = []
    refused: list[str] = []
    for status, reply in sorted(replies.items()):
        what = link(_content(reply), defs)
        if what == _REFUSAL:
            refused.append(f"{status}, {reply['description']}")
        else:
            sent.append(f"{status}: {what or reply['description'].lower()}")
    yield f"Answers {'; '.join(sent)}."
    if refused:
        yield f"Refuses with {_REFUSAL}: {'; '.join(refused)}."


_REFUSAL = link({"$ref": ErrorReply.__name__}, {})


def _content(holder: Schema) -> Schema:
    found: Schema = holder.get("content", {}).get("application/json", {}).get("schema", {})
    return found


def _default_of(schema: Schema) -> str:
    return code(schema["default"]) if "default" in schema else ""


# ---- the protocol -----------------------------------------------------------------------------------------------


def messages(union: Any) -> tuple[type[BaseModel], ...]:
    """The message types of `ClientMessage` or `ServerMessage`, in order."""
    either, *_ = get_args(union)
    return get_args(either)


def wire_protocol() -> str:
    """Every message on a participant's socket, what is inside some of them, and what each step hands in."""
    parts = []
    inside: dict[str, str] = {}
    for title, union in (
        ("What a page sends", wire.ClientMessage),
        ("What the lab sends", wire.ServerMessage),
    ):
        parts.append(f"## {title}")
        for model in messages(union):
            _, whole = models_json_schema([(model, "validation")], ref_template="{model}")
            defs: Mapping[str, Schema] = whole["$defs"]
            schema = defs[model.__name__]
            rows = field_rows(model, schema, defs, skip=("type",))
            parts += [
                f"### `{schema['properties']['type']['const']}`",
                inspect.getdoc(model) or "",
                table(("field", "value", "default", "meaning"), rows),
            ]
            for name in defs.keys() - {each.__name__ for each in messages(union)}:
                part: type[BaseModel] = getattr(wire, name)
                held = table(("field", "value", "default", "meaning"), field_rows(part, defs[name], defs))
                inside[name] = joined(f"### `{name}`", inspect.getdoc(part) or "", held)
    return joined(
        *parts, "## What stands inside messages", *(inside[name] for name in sorted(inside)), notes(), steps()
    )


def steps() -> str:
    """What `submit.data` holds for each step."""
    parts = ["## What a submit holds", "`data` of a `submit`, by its `step`. A key that is not listed is refused."]
    names: dict[type[BaseModel], list[str]] = {}
    for step, model in STEP_DATA.items():
        names.setdefault(model, []).append(f"`{step}`")
    for model, of_model in names.items():
        _, whole = models_json_schema([(model, "validation")], ref_template="{model}")
        defs: Mapping[str, Schema] = whole["$defs"]
        rows = field_rows(model, defs[model.__name__], defs)
        about = inspect.getdoc(model) or ""
        parts += [f"### {', '.join(of_model)}", about, table(("key", "value", "default", "meaning"), rows)]
    return joined(*parts)


def notes() -> str:
    """What `note.data` holds for each name, and who may say it."""
    rows = []
    for name, note in NOTES.items():
        _, whole = models_json_schema([(note.data, "validation")], ref_template="{model}")
        held = field_rows(note.data, whole["$defs"][note.data.__name__], whole["$defs"])
        rows.append(
            (f"`{name}`", ", ".join(note.roles), "; ".join(f"{row[0]}: {row[1]}" for row in held), note.meaning)
        )
    return joined(
        "## What a note holds",
        f"`data` of a `note`, by its `name`. It is logged as the event `{NAMESPACE}NAME`, with the page's `role`. Any "
        f"other name is refused, and so is a key that is not listed. Pages of your own have notes of their own: "
        f"`{OWN}NAME`.",
        table(("name", "page", "holds", "meaning"), rows),
    )


# ---- the packages -----------------------------------------------------------------------------------------------

ROOT = Path(__file__).resolve().parents[1]
ROOMS = (
    *("app", "app/*", "app/autonomy/*", "study", "study/*", "study/flow/*", "sim", "sim/*"),
    *("static", "static/*", "static/participant/*", "tests"),
)
"""Where a README stands that says what a folder is, in the order told."""


def packages() -> str:
    """What each package says of itself."""
    pages = [page for pattern in ROOMS for page in sorted(ROOT.glob(f"{pattern}/README.md"))]
    return joined(*(re.sub(r"^#", "##", page.read_text(encoding="utf-8"), flags=re.MULTILINE) for page in pages))


# ---- Sphinx -----------------------------------------------------------------------------------------------------

GENERATED: Mapping[str, Callable[[], str]] = {
    "study_file": study_file,
    "settings": settings,
    "limits": limits,
    "command_line": command_line,
    "export_columns": export_columns,
    "http_api": http_api,
    "wire_protocol": wire_protocol,
    "packages": packages,
}
MARK = re.compile(r"^<!-- generated: (\w+) -->$", re.MULTILINE)


def fill(text: str) -> str:
    """A page with what is generated in the place of its marks."""
    return MARK.sub(lambda mark: GENERATED[mark[1]](), text)


def setup(app: Any) -> Mapping[str, bool]:
    """Sphinx asks for this: fill each page as it is read, and read the reference again every time."""

    def read(_: Any, docname: str, source: list[str]) -> None:
        source[0] = fill(source[0])

    def outdated(_: Any, env: Any, *changes: set[str]) -> list[str]:
        return [name for name in env.found_docs if name.startswith("reference/")]

    app.connect("source-read", read)
    app.connect("env-get-outdated", outdated)
    return {"parallel_read_safe": True}
