"""Writes the types of what the lab and the pages say to each other, for the type checker of the pages' modules.

`python -m tests.javascript.message_types` writes `wire.d.ts` (the WebSocket of a participant's page and of the second
device) and `api.d.ts` (the HTTP API and the dashboard's socket) beside this file, from the models that the lab itself
checks with. A test fails when they are behind.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from app import wire
from app.session import explanation
from app.web import export_api, health_api, join_api, live_api, results_api, roster_api, sessions_api
from study import records

FOLDER = Path(__file__).resolve().parent
WIDTH = 120
NOTE = "// Written by tests/javascript/message_types.py from the lab's own models: change those, then run it again.\n"
SIMPLE = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}

Schema = Mapping[str, Any]


def type_of(schema: Schema) -> str:
    """A JSON schema as a TypeScript type."""
    if "$ref" in schema:
        return str(schema["$ref"]).rpartition("/")[2]
    if "const" in schema:
        return _literal(schema["const"])
    if "enum" in schema:
        return " | ".join(_literal(value) for value in schema["enum"])
    for choice in ("anyOf", "oneOf"):
        if choice in schema:
            return " | ".join(dict.fromkeys(type_of(one) for one in schema[choice]))
    if schema.get("type") == "array":
        if "prefixItems" in schema:
            return f"[{', '.join(type_of(one) for one in schema['prefixItems'])}]"
        return f"Array<{type_of(schema.get('items', {}))}>"
    if schema.get("type") == "object":
        values = schema.get("additionalProperties", {})
        return f"Record<string, {type_of(values) if isinstance(values, dict) else 'unknown'}>"
    return SIMPLE[schema["type"]] if "type" in schema else "unknown"


def _literal(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value).lower()


def _comment(text: str | None, indent: str = "") -> Iterator[str]:
    if text is None:
        return
    lines = text.strip().splitlines()
    if len(lines) == 1:
        yield f"{indent}/** {lines[0]} */"
        return
    yield f"{indent}/**"
    yield from (f"{indent} * {line}".rstrip() for line in lines)
    yield f"{indent} */"


def interface(name: str, schema: Schema, is_sent: bool) -> Iterator[str]:
    """An object's schema as an interface. What the lab sends is always whole; what it takes may leave defaults out."""
    yield from _comment(schema.get("description"))
    yield f"export interface {name} {{"
    required = schema["properties"] if is_sent else schema.get("required", ())
    for field, its in schema["properties"].items():
        is_there = field in required or "const" in its
        line = f"  {field}{'' if is_there else '?'}: {type_of(its)};"
        yield line if len(line) <= WIDTH else line.replace(": ", ":\n    | ", 1).replace(" | ", "\n    | ")
    yield "}"


def declarations(models: Mapping[str, Any], is_sent: bool) -> dict[str, str]:
    """Each type that the models need, by its name. A union gets the name it has in `models`."""
    found: dict[str, str] = {}
    for name, model in models.items():
        schema = TypeAdapter(model).json_schema(mode="serialization" if is_sent else "validation")
        for part, its in schema.pop("$defs", {}).items():
            found[part] = "\n".join(interface(part, its, is_sent))
        if "properties" in schema:
            found[name] = "\n".join(interface(name, schema, is_sent))
        else:
            members = type_of(schema).replace(" | ", "\n  | ")
            found[name] = f"export type {name} =\n  | {members};"
    return found


WIRE_SENT = {"ServerMessage": wire.ServerMessage}
WIRE_TAKEN = {"ClientMessage": wire.ClientMessage}
API_SENT: Mapping[str, Any] = {
    "InviteReply": sessions_api.InviteReply,
    "SessionReply": sessions_api.SessionReply,
    "LiveReply": live_api.LiveReply,
    "TickExplanation": explanation.TickExplanation,
    "Plane": explanation.Plane,
    "RosterReply": roster_api.RosterReply,
    "EraseReply": roster_api.EraseReply,
    "LinkReply": roster_api.LinkReply,
    "CrowdingReply": live_api.CrowdingReply,
    "TroubleReply": live_api.TroubleReply,
    "HealthReply": health_api.HealthReply,
    "EventRow": records.EventRow,
    "SummaryReply": results_api.SummaryReply,
    "QualityReply": results_api.QualityReply,
    "ReportReply": results_api.ReportReply,
    "ExportReply": export_api.ExportReply,
    "JoinReply": join_api.JoinReply,
}
API_TAKEN: Mapping[str, Any] = {"InviteRequest": sessions_api.InviteRequest}


def files() -> dict[str, str]:
    """What should stand in each generated file, by its name."""
    texts = {}
    for name, sent, taken in (("wire.d.ts", WIRE_SENT, WIRE_TAKEN), ("api.d.ts", API_SENT, API_TAKEN)):
        parts = declarations(taken, is_sent=False) | declarations(sent, is_sent=True)
        texts[name] = NOTE + "\n" + "\n\n".join(parts.values()) + "\n"
    return texts


if __name__ == "__main__":
    for name, text in files().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
