"""The rooms and their arrows: imports run downward only, never in a circle, and each outside library has one door.

A room is a package (`app.session`) or a module that stands by itself (`app.wire`). FLOORS is the house from its roof to
its cellar: a room imports rooms on floors below its own, and nothing beside it or above it. `sim`, `study` and
`app.autonomy` are houses of their own: none of them imports another, and none imports the rest of `app`.
"""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("app", "sim", "study")
NO_PRODUCT = ("docs", "tests")
"""Packages of the checkout that no product code may need: an installed lab has neither."""

FLOORS: tuple[tuple[str, ...], ...] = (
    # the edge: what people and programs talk to
    ("app.__main__",),
    ("app.commands",),
    ("app.web",),
    # the engine: running sessions, their workers, the trial, and people of our making
    ("app.lab",),
    ("app.report",),
    ("app.jobs", "app.physics_comparison", "app.sizing"),
    ("app.session", "app.replication", "app.replay", "app.contracts"),
    ("app.worker", "app.simulated"),
    ("app.trial",),
    ("app.wire", "app.config", "app.clock"),
    ("app.monitoring",),
    ("app.texts",),
    ("app.limits",),
    ("app.errors", "app.processes", "app.static_folder"),
    ("app.container",),
    # the study: what is asked, recorded, kept and analysed
    ("study.analysis",),
    ("study.export",),
    ("study.store",),
    ("study.flow",),
    ("study.definition",),
    ("study.parts", "study.language"),
    ("study.integrity",),
    ("study.text_file", "study.disk"),
    ("study.records", "study.json_text", "study.extras"),
    # the mathematics, and the robots
    ("app.autonomy", "sim"),
)
FLOOR_OF = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}  # 0 is the roof

HOUSES = ("app.autonomy", "sim", "study")
"""None imports anything of the project but itself."""

CLOSED = ("study.store",)
"""Rooms with one door: the rest of the project imports the package, and no module in it."""

ONLY_IN: Mapping[str, tuple[str, ...]] = {
    "fastapi": ("app.web",),
    "starlette": ("app.web",),
    "fastapi_offline": ("app.web",),
    "uvicorn": ("app.web", "app.commands"),
    "typer": ("app.commands",),
    "tqdm": ("app.simulated.progress",),
    "prometheus_client": ("app.monitoring.metrics",),
    "rich": (),
    "pytest": ("app.contracts.verdict", "app.contracts.plugin"),
    "httpx": ("app.simulated.connection",),
    "websockets": ("app.web", "app.simulated.connection"),
    "pybullet": ("sim.bullet",),
    "pybullet_data": (),
    "pybullet_utils": (),
    "mujoco": ("sim.mujoco",),
    "viser": ("sim.view.nodes",),
    "cryptography": ("study.integrity.signing",),
    "portalocker": ("study.disk.locks",),
    "psutil": ("app.processes",),
    "sqlalchemy": ("study.store",),
    "sqlite3": ("study.store",),
    "psycopg": ("study.store",),
    "aiosqlite": (),
    "alembic": ("study.store",),
    "pyarrow": ("study.export.parquet",),
    "babel": ("study.language", "app.texts"),
    "matplotlib": (
        "study.analysis.figures",
        "app.report.layout_picture",
        "app.physics_comparison.figure",
        "app.sizing.picture",
    ),
    "scipy": ("study.analysis", "app.replication.comparisons", "app.physics_comparison.equivalence"),
    "pandas": (),
    "statsmodels": (),
}
"""Outside library to the rooms or modules that may import it."""

PURE = (
    *(
        "app.autonomy",
        "app.wire",
        "app.errors",
        "study.records",
        "app.limits",
        "study.parts",
        "study.definition",
        "study.flow",
    ),
    *("study.language.words", "study.integrity.chain", "study.integrity.content", "study.integrity.findings"),
    *("study.analysis.measures", "study.analysis.summaries", "study.analysis.observations"),
    *("sim.interface", "sim.fetch", "sim.ik", "sim.objects", "sim.layouts", "sim.clearance", "sim.view.viewpoints"),
)
"""Rooms and modules of values and rules: no clock, no socket, no randomness of their own, few libraries."""
CLOCKLESS = (*PURE, "app.trial")
"""Those, and what may use the robots' libraries but has no clock, no socket and no randomness of its own either."""
STDLIB = sys.stdlib_module_names | {"tomllib"}  # since 3.11
PURE_LIBRARIES = frozenset({"numpy", "pydantic", "pydantic_core", "annotated_types", "tomli", "typing_extensions"})
IMPURE_STDLIB = frozenset(
    {"asyncio", "http", "multiprocessing", "random", "secrets", "select", "socket", "sqlite3", "subprocess"}
    | {"tempfile", "threading", "time", "urllib"}
)
"""What clockless code is given (`now_s`, `rng`, text) instead of fetching it."""


# --- reading imports ---------------------------------------------------------------------------------------------


def module_name(path: Path) -> str:
    """`ROOT/sim/ik.py` -> `sim.ik`; a package's `__init__.py` -> the package."""
    parts = list(path.relative_to(ROOT).with_suffix("").parts)
    if parts[-1] == "__init__":
        parts.pop()
    return ".".join(parts)


def project_sources() -> dict[str, str]:
    """Every module of the project and its text."""
    paths = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    return {module_name(path): path.read_text(encoding="utf-8") for path in paths}


def imported_names(source: str, module: str, is_package: bool) -> Iterator[tuple[int, str]]:
    """Line and dotted name of everything imported, wherever it stands: in functions and under TYPE_CHECKING too.

    `from a import b` yields `a.b`, since b may be a module; whoever reads it takes the longest known prefix.
    """
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module.split(".")
                parts = parts[: len(parts) - node.level + (1 if is_package else 0)]
                base = ".".join([*parts, base] if base else parts)
            for alias in node.names:
                yield node.lineno, base if alias.name == "*" else f"{base}.{alias.name}"
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in {"import_module", "__import__"} and isinstance(node.args[0].value, str):
                yield node.lineno, node.args[0].value


def is_in(name: str, places: Iterable[str]) -> bool:
    """Whether a dotted name is one of these rooms or modules, or lies in one."""
    return any(name == place or name.startswith(place + ".") for place in places)


def room_of(name: str) -> str | None:
    """The room that a dotted name leads to: `app.session.pages.page` -> `app.session`; None outside all of them."""
    return next((room for room in FLOOR_OF if is_in(name, (room,))), None)


def house_of(name: str) -> str | None:
    """The house of its own that a dotted name leads into, if any."""
    return next((house for house in HOUSES if is_in(name, (house,))), None)


# --- the rules ---------------------------------------------------------------------------------------------------


def violations(sources: Mapping[str, str]) -> list[str]:
    """One sentence for each import that breaks a rule, and for each module that stands in no room."""
    found = []
    packages = {name.rpartition(".")[0] for name in sources} | set(PACKAGES)
    for module, source in sources.items():
        if module in PACKAGES:
            found += [f"{module}:{line} imports {name}: a house's own text is a docstring" for line, name in
                      imported_names(source, module, True) if is_in(name, (*PACKAGES, *NO_PRODUCT))]  # fmt: skip
            continue
        if room_of(module) is None:
            found.append(
                f"{module} stands in no room: put it into the package whose README says what it is, "
                "or give it a floor in FLOORS in tests/house/test_architecture.py."
            )
            continue
        for line, name in imported_names(source, module, module in packages):
            where = f"{module}:{line}"
            if name.split(".")[0] in PACKAGES:
                found.extend(_project_import(where, module, name))
            else:
                found.extend(_outside_import(where, module, name.split(".")[0]))
    return list(dict.fromkeys(found))  # `from a import b, c` says it once


def _project_import(where: str, module: str, name: str) -> Iterator[str]:
    room, target = room_of(module), room_of(name)
    assert room is not None
    if target is None:
        if name not in PACKAGES:
            yield f"{where} imports {name}, which stands in no room of FLOORS in tests/house/test_architecture.py."
        return
    house = house_of(module)
    if target != room and FLOOR_OF[target] <= FLOOR_OF[room]:
        side = "beside" if FLOOR_OF[target] == FLOOR_OF[room] else "above"
        yield f"{where} imports {target}, which stands {side} {room}: imports run downward only."
    if house is not None and house_of(name) != house:
        yield f"{where} imports {name}: {house} is a house of its own and imports nothing else of the project."
    for closed in CLOSED:
        inside = name.removeprefix(closed + ".").split(".")[0] if is_in(name, (closed,)) else ""
        if inside in modules_of(closed) and not is_in(module, (closed,)):
            yield f"{where} imports {closed}.{inside}: what others may use of {closed} stands in {closed} itself."


def modules_of(package: str) -> frozenset[str]:
    """Names of the modules and packages that stand in a package."""
    folder = ROOT / package.replace(".", "/")
    return frozenset(path.stem for path in folder.iterdir() if path.suffix == ".py" or (path / "__init__.py").is_file())


def _outside_import(where: str, module: str, library: str) -> Iterator[str]:
    if library in NO_PRODUCT:
        yield f"{where} imports {library}, which is no part of the product: move what it needs into the product."
    doors = ONLY_IN.get(library)
    if doors is not None and not is_in(module, doors):
        allowed = f"only {', '.join(sorted(doors))}" if doors else "nobody"
        yield f"{where} imports {library}: {allowed} may."
    if library in IMPURE_STDLIB and is_in(module, CLOCKLESS):
        yield f"{where} (clockless) imports {library}: it is given now_s, rng and text, it does not fetch them."
    if is_in(module, PURE) and library not in STDLIB | PURE_LIBRARIES:
        yield f"{where} (pure) imports {library}: pure code has only {', '.join(sorted(PURE_LIBRARIES))}."


def circles(sources: Mapping[str, str]) -> list[str]:
    """Each circle of modules that import one another, as `a -> b -> a`; imports in functions and for types count."""
    arrows: dict[str, set[str]] = {}
    packages = {name.rpartition(".")[0] for name in sources}
    for module, source in sources.items():
        targets = set()
        for _, name in imported_names(source, module, module in packages):
            parts = name.split(".")
            known = next(
                (".".join(parts[:n]) for n in range(len(parts), 0, -1) if ".".join(parts[:n]) in sources), None
            )
            if known is not None and known != module:
                targets.add(known)
        arrows[module] = targets
    found, done = [], set[str]()

    def follow(module: str, way: list[str]) -> None:
        if module in way:
            found.append(" -> ".join([*way[way.index(module) :], module]))
        elif module not in done:
            for target in sorted(arrows[module]):
                follow(target, [*way, module])
            done.add(module)

    for module in sorted(arrows):
        follow(module, [])
    return found


def test_imports_run_downward_only() -> None:
    sources = project_sources()
    assert len(sources) > len(PACKAGES), "found no modules: is the test reading the right folder?"
    assert not (found := violations(sources)), "\n" + "\n".join(found)


def test_no_modules_import_one_another_in_a_circle() -> None:
    assert not (found := circles(project_sources())), "\n" + "\n".join(found)


@pytest.mark.parametrize(
    ("module", "source", "complaint"),
    [
        ("sim.ik", "from scipy.optimize import minimize", "(pure) imports scipy"),
        ("app.trial.engine", "import app.web.server", "imports app.web, which stands above app.trial"),
        ("app.trial.engine", "def f():\n    from app.web import server", "app.trial.engine:2 imports app.web, which"),
        ("app.session.session", "from app.replication.paper import ROWS", "app.replication, which stands beside"),
        ("app.worker.worker", "import app.simulated.pilot", "app.simulated, which stands beside app.worker"),
        ("study.store.rows", "from app.lab.lab import Lab", "imports app.lab, which stands above study.store"),
        ("study.store.rows", "from study.export.export import export", "study.export, which stands above study.store"),
        ("study.records", "from study.definition.study import Study", "which stands above study.records"),
        ("study.flow.protocol", "from study.store import Store", "imports study.store, which stands above study.flow"),
        ("app.lab.lab", "import importlib\nimportlib.import_module('app.web.access')", "app.lab.lab:2 imports app.web"),
        (
            "app.trial.values",
            "if TYPE_CHECKING:\n    from app.lab.lab import Lab",
            "imports app.lab, which stands above",
        ),
        ("study.flow.distractors.state", "from sim.interface import TICK_S", "study is a house of its own"),
        ("sim.kinematic", "from study import records", "sim is a house of its own"),
        ("app.autonomy.belief", "from sim.interface import TICK_S", "app.autonomy is a house of its own"),
        ("app.autonomy.belief", "from app.errors import LabError", "app.autonomy is a house of its own"),
        ("sim.view.scene", "from app.wire import Hello", "sim is a house of its own"),
        ("app.lab.lab", "import fastapi", "app.lab.lab:1 imports fastapi: only app.web may"),
        ("app.session.pages", "from starlette.requests import Request", "imports starlette: only app.web may"),
        ("app.worker.worker", "import pybullet as p", "only sim.bullet may"),
        ("sim.kinematic", "import pybullet as p", "only sim.bullet may"),
        ("sim.physical", "import mujoco", "only sim.mujoco may"),
        ("app.web.scene_proxy", "from viser import ViserServer", "only sim.view.nodes may"),
        ("study.export.export", "from sqlalchemy import select", "imports sqlalchemy: only study.store may"),
        (
            "study.export.export",
            "from study.store.tables import RECORDS",
            "imports study.store.tables: what others may",
        ),
        ("app.lab.lab", "from study.store import database", "imports study.store.database: what others may use"),
        ("app.web.scene_proxy", "import pybullet_utils.bullet_client", "imports pybullet_utils: nobody may"),
        ("sim.bullet", "import pybullet_utils", "imports pybullet_utils: nobody may"),
        (
            "app.session.connections",
            "from websockets.asyncio.client import connect",
            "only app.simulated.connection, app.w",
        ),
        ("app.commands.program", "from rich.console import Console", "imports rich: nobody may"),
        ("study.store.database", "import aiosqlite", "imports aiosqlite: nobody may"),
        ("app.web.server", "import httpx", "imports httpx: only app.simulated.connection may"),
        ("study.flow.protocol", "import time", "(clockless) imports time: it is given now_s, rng and text"),
        ("app.wire", "import asyncio", "app.wire:1 (clockless) imports asyncio"),
        ("app.trial.engine", "import time", "app.trial.engine:1 (clockless) imports time"),
        ("app.trial.world", "def f():\n    import random", "app.trial.world:2 (clockless) imports random"),
        ("app.lab.lab", "from tests.support.fake_lab import Lab", "imports tests, which is no part of the product"),
        ("sim.ik", "import docs.words", "imports docs, which is no part of the product"),
        ("app", "import tests", "a house's own text is a docstring"),
        ("app.surprise", "", "app.surprise stands in no room"),
        ("app.trial.engine", "from app.surprise import Box", "app.surprise.Box, which stands in no room"),
        ("app", "from app.trial.engine import TrialEngine", "a house's own text is a docstring"),
    ],
)
def test_a_forbidden_import_is_reported(module: str, source: str, complaint: str) -> None:
    assert any(complaint in line for line in violations({module: source})), violations({module: source})


def test_a_relative_import_is_followed() -> None:
    assert violations({"app.trial.engine": "from ..web import server"}) == [
        "app.trial.engine:1 imports app.web, which stands above app.trial: imports run downward only."
    ]
    assert violations({"app.autonomy.belief": "from .arrays import frozen"}) == []


def test_allowed_imports_are_silent() -> None:
    served = (
        "import fastapi\nfrom app.lab.lab import Lab\nfrom study.records import TickRow\nfrom study.store import Store"
    )
    assert violations({"app.web.server": served}) == []
    assert violations({"sim.bullet": "import time\nimport pybullet\nfrom sim.interface import Robot"}) == []
    assert violations({"app.trial.engine": "import numpy\nfrom sim.interface import Robot"}) == []
    assert violations({"app.simulated.connection": "import httpx\nfrom websockets.asyncio.client import connect"}) == []


def test_a_circle_is_reported_by_its_way() -> None:
    made = {
        "sim.a": "from sim.b import x",
        "sim.b": "def f():\n    from sim import c",
        "sim.c": "import sim.a",
        "sim.d": "import sim.a",
    }
    assert circles(made) == ["sim.a -> sim.b -> sim.c -> sim.a"]
    assert circles({"sim.a": "from sim.b import x", "sim.b": "import math"}) == []


def test_every_room_is_there_and_says_what_it_is() -> None:
    gone = [room for room in FLOOR_OF if not list(ROOT.glob(room.replace(".", "/") + "*"))]
    assert not gone, f"remove from FLOORS in tests/house/test_architecture.py: {', '.join(gone)}"
    for room in FLOOR_OF:
        folder = ROOT / room.replace(".", "/")
        if folder.is_dir():
            text = (folder / "README.md").read_text(encoding="utf-8")
            assert 5 <= len(text.splitlines()) <= 30, f"{room}: a README of about ten lines"
            for word in ("import", "Begin"):
                assert word in text, f"{room}/README.md does not say what it may import and where to begin reading"


def test_every_module_a_readme_names_is_there() -> None:
    for path in sorted(path for package in (*PACKAGES, "tests") for path in (ROOT / package).rglob("README.md")):
        for name in re.findall(r"`([\w/]+\.(?:py|toml|json))`", path.read_text(encoding="utf-8")):
            assert (path.parent / name).exists() or (ROOT / name).exists(), f"{path.relative_to(ROOT)} names {name}"


WEB_PROCESS = ("app.web", "app.lab", "app.commands", "app.__main__")
NATIVE = ("pybullet", "mujoco", "viser", "trimesh", "scipy", "matplotlib", "pyarrow")
"""And what an installation that only serves lacks."""

LOADS = """
import importlib, json, sys
native, *modules = map(str.split, sys.stdin)
found = {}
for (module,) in modules:
    importlib.import_module(module)
    new = sorted(set(native) & set(sys.modules) - {name for names in found.values() for name in names})
    if new:
        found[module] = new
print(json.dumps(found))
"""


def native_code_of(modules: Sequence[str]) -> dict[str, list[str]]:
    """What of NATIVE comes along when a fresh interpreter imports these one after another, with the first to ask."""
    asked = "\n".join([" ".join(NATIVE), *modules])
    command = [sys.executable, "-c", LOADS]
    done = subprocess.run(command, cwd=ROOT, input=asked, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


def test_the_web_process_loads_neither_physics_nor_scene() -> None:
    """Native code that crashes must be able to take a worker with it, never the server."""
    modules = sorted(name for name in project_sources() if is_in(name, WEB_PROCESS)) + ["app.worker.process"]
    assert len(modules) > len(WEB_PROCESS)
    assert native_code_of(modules) == {}


def test_native_code_that_comes_along_is_reported() -> None:
    assert native_code_of(["sim.interface", "sim.bullet"]) == {"sim.bullet": ["pybullet"]}
