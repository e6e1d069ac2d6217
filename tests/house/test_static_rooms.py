"""The rooms of static/: what may import what, that nothing goes in a circle, and that the generated types are fresh."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from tests.javascript import message_types

ROOT = Path(__file__).resolve().parents[2]
FLOORS = (("common",), ("wire",), ("hands", "readings"), ("participant", "panel", "join", "dashboard"))
"""A room imports from itself and from the floors before its own; rooms of one floor do not know each other."""
FLOOR_OF = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
TYPES = "../tests/javascript/"

COMMENT = re.compile(r"/\*.*?\*/|^\s*//[^\n]*", re.DOTALL | re.MULTILINE)
LOADED = re.compile(
    r"""\b(?:import|export)\b[^;'"()]*?\bfrom\s*["']([^"']+)["']"""
    r"""|\bimport\s*\(?\s*["']([^"']+)["']"""
    r"""|\bnew\s+URL\(\s*["'](\.[^"']+\.js)["']"""
)
NAMED_TYPE = re.compile(r"""@import\b[^"']*["']([^"']+)["']|\bimport\(\s*["']([^"']+)["']""")


def found(pattern: re.Pattern[str], text: str, path: str) -> Iterator[str]:
    """The modules that a text names, as paths from static/."""
    for groups in pattern.findall(text):
        named = next(group for group in groups if group)
        if named.startswith("."):
            yield posixpath.normpath(posixpath.join(posixpath.dirname(path), named))
        else:
            yield named.removeprefix("/static/")


def loads(path: str, text: str) -> list[str]:
    return list(found(LOADED, COMMENT.sub("", text), path))


def types(path: str, text: str) -> list[str]:
    return [name for comment in COMMENT.findall(text) for name in found(NAMED_TYPE, comment, path)]


def complaints(modules: Mapping[str, str]) -> list[str]:
    """What breaks the order, in modules by their path from static/."""
    lines = []
    for path, text in modules.items():
        room = path.split("/")[0]
        if room not in FLOOR_OF or "/" not in path:
            lines.append(f"{path}: stands in no room; the rooms are {', '.join(FLOOR_OF)}")
            continue
        for target in loads(path, text) + [name for name in types(path, text) if not name.startswith(TYPES)]:
            other = target.split("/")[0]
            if other == room:
                continue
            if other not in FLOOR_OF:
                lines.append(f"{path}: imports {target}, which is no room of static/")
            elif FLOOR_OF[other] >= FLOOR_OF[room]:
                lines.append(f"{path}: {room} may not import {other}")
    return lines + [f"a circle: {' > '.join(circle)}" for circle in circles(modules)]


def circles(modules: Mapping[str, str]) -> list[list[str]]:
    """Modules that load themselves by way of others, each circle once. Types alone make none: nothing is loaded."""
    graph = {path: [target for target in loads(path, text) if target in modules] for path, text in modules.items()}
    done: set[str] = set()
    rings = []

    def walk(path: str, way: list[str]) -> None:
        if path in way:
            rings.append([*way[way.index(path) :], path])
        elif path not in done:
            for target in graph[path]:
                walk(target, [*way, path])
            done.add(path)

    for path in graph:
        walk(path, [])
    return rings


def test_static_keeps_its_order() -> None:
    static = ROOT / "static"
    modules = {str(path.relative_to(static)): path.read_text(encoding="utf-8") for path in static.rglob("*.js")}
    assert len(modules) > 40
    assert not complaints(modules), "\n" + "\n".join(complaints(modules))


@pytest.mark.parametrize(
    ("modules", "complaint"),
    [
        ({"common/a.js": 'import { b } from "../wire/b.js";'}, "common may not import wire"),
        ({"common/a.js": 'import {\n  b,\n} from "../wire/b.js";'}, "common may not import wire"),
        ({"common/a.js": '/** @import { B } from "../wire/b.js" */'}, "common may not import wire"),
        ({"common/a.js": '/** @type {import("../wire/b.js").B} */'}, "common may not import wire"),
        ({"hands/a.js": 'import "../readings/b.js";'}, "hands may not import readings"),
        ({"hands/a.js": 'export { b } from "../panel/b.js";'}, "hands may not import panel"),
        ({"wire/a.js": 'new Worker(new URL("../hands/b.js", import.meta.url));'}, "wire may not import hands"),
        ({"panel/a.js": 'await import("../participant/b.js");'}, "panel may not import participant"),
        ({"join/a.js": 'import { b } from "/static/dashboard/b.js";'}, "join may not import dashboard"),
        ({"join/a.js": 'import { b } from "../../tests/javascript/b.js";'}, "is no room"),
        ({"a.js": ""}, "stands in no room"),
        ({"utils/a.js": ""}, "stands in no room"),
        ({"wire/a.js": 'import "./b.js";', "wire/b.js": 'import "./a.js";'}, "wire/a.js > wire/b.js > wire/a.js"),
        ({"wire/a.js": 'import { a } from "./a.js";'}, "wire/a.js > wire/a.js"),
    ],
)
def test_what_breaks_the_order_is_reported(modules: dict[str, str], complaint: str) -> None:
    lines = complaints(modules)
    assert len(lines) == 1
    assert complaint in lines[0]


def test_what_keeps_the_order_is_not_reported() -> None:
    modules = {
        "common/a.js": "export const a = 1;",
        "wire/b.js": 'import "../common/a.js";\n/** @import { B } from "../../tests/javascript/wire.d.ts" */',
        "join/c.js": '// import "../panel/d.js"\nimport "../common/a.js";\nimport { b } from "../wire/b.js";',
        "join/e.js": '/** @import { F } from "./f.js" */',
        "join/f.js": 'import { e } from "./e.js";',
    }
    assert complaints(modules) == []


def test_every_room_says_what_it_is() -> None:
    for room in FLOOR_OF:
        text = (ROOT / "static" / room / "README.md").read_text(encoding="utf-8")
        assert text.startswith(f"# static/{room}\n")
        assert len(text.splitlines()) <= 15
        named = set(re.findall(r"`(\w+\.js)`", text))
        assert named
        assert named <= {path.name for path in (ROOT / "static" / room).iterdir()}


@pytest.mark.parametrize("name", sorted(message_types.files()))
def test_the_types_of_messages_are_those_of_the_models(name: str) -> None:
    there = (message_types.FOLDER / name).read_text(encoding="utf-8")
    assert there == message_types.files()[name], "behind its models: run python -m tests.javascript.message_types"
