"""The rooms and their arrows: imports run downward only, and each outside library has one door.

    edge      the command line, routes, sockets, tokens: the web framework lives here and nowhere else
    engine    running sessions, workers, the control loop, the trial
    adapters  what touches the world: physics, scene, files, database
    pure      values and rules: numpy, the validation library, the standard library; no clock, no file, no socket

`sim`, `study` and `app.autonomy` are separate rooms: none imports another, and none imports the rest of `app`.
A file that is not in LAYER_OF fails with what to do about it.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("app", "sim", "study")

LAYERS = ("pure", "adapters", "engine", "edge")  # lowest first
MODULES = {
    "edge": """
        app.__main__ app.study_commands app.web.server app.web.sessions_api app.web.roster_api app.web.results_api
        app.web.live_api app.web.dashboard_frames app.web.participant_socket app.web.scene_proxy app.web.addresses
        app.web.join_api
    """,
    "engine": """
        app.config app.lab.tokens app.lab.lab app.worker.worker app.worker.process app.worker.messages
        app.worker.pacer app.trial.engine app.trial.values app.trial.tasks app.trial.goals app.trial.motion
        app.trial.verdicts app.worker.input_latch app.trial.robots app.report.figure2 app.trial.cycles
        app.trial.setup app.simulated.traits app.simulated.driver app.simulated.answers app.simulated.participant
        app.simulated.study app.simulated.variants app.progress_bar app.replication.paper app.replication.fit
        app.replication.studies app.replication.comparisons app.replication.replicate app.replication.text
        app.replication.power app.session.session app.session.context app.session.transitions
        app.session.submissions app.session.running_trial app.session.worker_link app.session.connections
        app.session.interfaces app.steps app.session.pages app.simulated.pilot app.simulated.bot app.session.history
        app.session.commands app.session.private_text app.session.explanation app.worker.spectator_view
        app.session.spectators app.session.round_trips app.lab.open_enrolment app.report.process app.report.job
    """,
    "adapters": """
        sim.kinematic sim.bullet sim.assets sim.scene sim.nodes sim.spectator sim.urdf sim.meshes sim.props
        study.store study.store.store study.store.database study.store.migration study.store.tables study.store.rows
        study.store.revisions.env study.store.revisions.versions.r0001_where_migrations_began
        study.store.participants study.store.progress study.store.snapshot study.store.erasure study.store.values
        study.store.async_store study.store.fingerprint study.export.export study.export.data_package
        study.analysis.effect_sizes study.analysis.design_matrix study.analysis.linear_model
        study.analysis.mixed_model study.analysis.dataset study.analysis.analysis study.analysis.figures
        study.analysis.tables study.analysis.method_text study.analysis.report
    """,
    "pure": """
        app.wire app.autonomy.actions app.autonomy.arbiter app.autonomy.arrays app.autonomy.belief
        app.autonomy.calibration app.autonomy.errors app.autonomy.hindsight app.autonomy.information
        app.autonomy.transition sim.interface sim.fetch sim.ik sim.objects sim.layouts sim.clearance sim.views
        study.definition.study study.definition.checks study.definition.toml_reader study.flow.protocol
        study.flow.distractor study.flow.answers study.flow.overview study.definition.builtin_questionnaires
        study.definition.field_types study.definition.sections study.definition.questionnaires study.records
        study.flow.roster study.analysis.measures study.analysis.summaries study.analysis.observations
        study.flow.quality study.flow.eligibility study.flow.open_link
    """,
}
LAYER_OF = {module: layer for layer, names in MODULES.items() for module in names.split()}

# A package's own __init__ holds a docstring and at most re-exports from its room.
LAYER_OF |= dict.fromkeys(("app", "app.autonomy", "sim", "study"), "pure")

ROOMS = ("app.autonomy", "sim", "study")

# Rooms with one door: the rest of the project imports the package, and no module in it.
CLOSED = ("study.store",)

EDGE = frozenset(module for module, layer in LAYER_OF.items() if layer == "edge")
STORE = frozenset(module for module in LAYER_OF if module.startswith("study.store."))
ONLY_IN: dict[str, frozenset[str]] = {
    "fastapi": EDGE,
    "starlette": EDGE,
    "uvicorn": EDGE,
    "pybullet": frozenset({"sim.bullet"}),
    "pybullet_data": frozenset(),
    "viser": frozenset({"sim.nodes"}),
    "sqlalchemy": STORE,
    "sqlite3": STORE,
    "alembic": STORE,
    "pyarrow": frozenset({"study.export.data_package"}),
    "matplotlib": frozenset({"study.analysis.figures"}),
    "statsmodels": frozenset({"study.analysis.linear_model", "study.analysis.mixed_model"}),
}

PURE_LIBRARIES = frozenset({"numpy", "pydantic", "pydantic_core", "annotated_types", "tomli", "typing_extensions"})
# What pure code is given (`now_s`, `rng`, text) instead of fetching it.
IMPURE_STDLIB = frozenset(
    {"asyncio", "http", "multiprocessing", "random", "secrets", "select", "socket", "sqlite3", "subprocess"}
    | {"tempfile", "threading", "time", "urllib"}
)


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


def room_of(module: str) -> str | None:
    return next((room for room in ROOMS if module == room or module.startswith(room + ".")), None)


def known_module(name: str, layer_of: Mapping[str, str]) -> str:
    """The module a dotted name leads to: `sim.ik.reachable` -> `sim.ik`; unknown names stay as they are."""
    parts = name.split(".")
    for length in range(len(parts), 1, -1):
        if (prefix := ".".join(parts[:length])) in layer_of:
            return prefix
    return ".".join(parts[:2])


# --- the rules ---------------------------------------------------------------------------------------------------


def violations(sources: Mapping[str, str], layer_of: Mapping[str, str] = LAYER_OF) -> list[str]:
    """One sentence for each import that breaks a rule, and for each module without a layer."""
    found = []
    packages = {name.rpartition(".")[0] for name in sources} | set(PACKAGES)
    for module, source in sources.items():
        if module in packages and not source.strip():
            continue  # a package that says nothing
        if module not in layer_of:
            found.append(
                f"{module} has no layer: add it to MODULES in tests/house/test_architecture.py under the lowest of "
                f"{', '.join(LAYERS)} that its imports allow."
            )
            continue
        for line, name in imported_names(source, module, module in packages):
            where = f"{module}:{line}"
            if name.split(".")[0] in PACKAGES:
                found.extend(_project_import(where, module, known_module(name, layer_of), layer_of))
            else:
                found.extend(_outside_import(where, module, name.split(".")[0], layer_of))
    return list(dict.fromkeys(found))  # `from a import b, c` says it once


def _project_import(where: str, module: str, target: str, layer_of: Mapping[str, str]) -> Iterator[str]:
    if target not in layer_of:
        if target.split(".")[0] != target:
            yield f"{where} imports {target}, which is not in MODULES of tests/house/test_architecture.py."
        return
    if LAYERS.index(layer_of[target]) > LAYERS.index(layer_of[module]):
        yield f"{where} ({layer_of[module]}) imports {target} ({layer_of[target]}): imports run downward only."
    room = room_of(module)
    if room is not None and room_of(target) != room:
        yield f"{where} imports {target}: {room} is a room of its own and imports nothing else of the project."
    for closed in CLOSED:
        if target.startswith(closed + ".") and not f"{module}.".startswith(closed + "."):
            yield f"{where} imports {target}: what others may use of {closed} stands in {closed} itself."


def _outside_import(where: str, module: str, library: str, layer_of: Mapping[str, str]) -> Iterator[str]:
    doors = ONLY_IN.get(library)
    if doors is not None and module not in doors:
        yield f"{where} imports {library}: only {', '.join(sorted(doors)) or 'nobody'} may."
    if layer_of[module] != "pure":
        return
    if library in IMPURE_STDLIB:
        yield f"{where} (pure) imports {library}: pure code is given now_s, rng and text, it does not fetch them."
    if library not in sys.stdlib_module_names and library not in PURE_LIBRARIES:
        yield f"{where} (pure) imports {library}: pure code has only {', '.join(sorted(PURE_LIBRARIES))}."


def test_imports_run_downward_only() -> None:
    sources = project_sources()
    assert len(sources) > len(PACKAGES), "found no modules: is the test reading the right folder?"
    assert not (found := violations(sources)), "\n" + "\n".join(found)


@pytest.mark.parametrize(
    ("module", "source", "complaint"),
    [
        ("sim.ik", "from sim.bullet import BulletRobot", "sim.ik:1 (pure) imports sim.bullet (adapters)"),
        ("app.trial.engine", "import app.web.server", "app.trial.engine:1 (engine) imports app.web.server (edge)"),
        (
            "app.trial.engine",
            "def f():\n    from app.web import server",
            "app.trial.engine:2 (engine) imports app.web.server (edge)",
        ),
        (
            "study.store.rows",
            "from app.lab.lab import Lab",
            "study.store.rows:1 (adapters) imports app.lab.lab (engine)",
        ),
        (
            "app.lab.lab",
            "import importlib\nimportlib.import_module('app.web.sessions_api')",
            "app.lab.lab:2 (engine) imports app.web.sessions_api",
        ),
        ("study.flow.distractor", "from sim.interface import TICK_S", "study is a room of its own"),
        ("sim.kinematic", "from study import records", "sim is a room of its own"),
        ("app.autonomy.belief", "from sim.interface import TICK_S", "app.autonomy is a room of its own"),
        ("sim.scene", "from app.wire import Hello", "sim is a room of its own"),
        ("app.lab.lab", "import fastapi", "app.lab.lab:1 imports fastapi: only"),
        ("app.worker.worker", "import pybullet as p", "only sim.bullet may"),
        ("app.web.scene_proxy", "from viser import ViserServer", "only sim.nodes may"),
        (
            "study.export.export",
            "from sqlalchemy import select",
            "imports sqlalchemy: only study.store.",
        ),
        (
            "study.export.export",
            "from study.store.tables import RECORDS",
            "imports study.store.tables: what others may use",
        ),
        ("app.lab.lab", "from study.store import database", "imports study.store.database: what others may use"),
        ("study.flow.protocol", "import time", "pure code is given now_s"),
        ("sim.ik", "from scipy.optimize import minimize", "(pure) imports scipy"),
        ("app.surprise", "", "app.surprise has no layer: add it to MODULES"),
    ],
)
def test_a_forbidden_import_is_reported(module: str, source: str, complaint: str) -> None:
    assert any(complaint in line for line in violations({module: source})), violations({module: source})


def test_a_relative_import_is_followed() -> None:
    assert violations({"app.config": "from . import __main__"}) == [
        "app.config:1 (engine) imports app.__main__ (edge): imports run downward only."
    ]
    assert violations({"app.autonomy.belief": "from .arrays import frozen"}) == []


def test_allowed_imports_are_silent() -> None:
    assert (
        violations({"app.web.server": "import fastapi\nfrom app.lab.lab import Lab\nfrom study.records import TickRow"})
        == []
    )
    assert violations({"sim.bullet": "import time\nimport pybullet\nfrom sim.interface import Robot"}) == []


def test_the_table_names_only_modules_that_exist() -> None:
    gone = sorted(set(LAYER_OF) - set(project_sources()))
    assert not gone, f"remove from MODULES in tests/house/test_architecture.py, or write: {', '.join(gone)}"


def test_every_pure_module_is_checked_strictly() -> None:
    overrides = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]["overrides"]
    strict = [pattern for entry in overrides if entry.get("ignore_errors") is False for pattern in entry["module"]]
    pure = {module for module, layer in LAYER_OF.items() if layer == "pure"} - {"app", "sim", "study"}
    left_out = sorted(m for m in pure if not any(m == p or m.startswith(p.removesuffix("*")) for p in strict))
    assert not left_out, f"add to the strict modules under [tool.mypy] in pyproject.toml: {', '.join(left_out)}"


@pytest.mark.parametrize(
    "module",
    sorted({m for m in project_sources() if LAYER_OF.get(m) == "edge"} | {"app.lab.lab", "app.worker.process"}),
)
def test_the_web_process_loads_neither_physics_nor_scene(module: str) -> None:
    """Native code that crashes must be able to take a worker with it, never the server."""
    code = f"import {module}, sys; print(*sorted({{'pybullet', 'viser', 'trimesh'}} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [], f"importing {module} also loads {done.stdout.strip()}"


# --- the tree ----------------------------------------------------------------------------------------------------

TOP_LEVEL = {
    *("pyproject.toml", "README.md", "CHANGELOG.md", "LICENSE", "Makefile", ".ci", ".gitignore"),
    *("app", "static", "sim", "study", "tests"),
}
SKIPPED_FOLDERS = {".git", ".venv", "__pycache__", "data", "node_modules"}  # when there is no git to ask


def tree_files() -> list[Path]:
    """The project's files: what git has or would add, or in an unpacked archive everything."""
    asked = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if asked.returncode == 0:
        listed = [ROOT / name for name in asked.stdout.split("\0") if name]
    else:
        listed = [path for path in ROOT.rglob("*") if not SKIPPED_FOLDERS & set(path.relative_to(ROOT).parts)]
    return sorted(path for path in listed if path.is_file())


def texts() -> Iterator[tuple[Path, str]]:
    for path in tree_files():
        try:
            yield path.relative_to(ROOT), path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # a picture or a sound


def test_the_top_level_is_what_the_map_says() -> None:
    assert {path.relative_to(ROOT).parts[0] for path in tree_files()} - TOP_LEVEL == set()


# Put together from halves, so that this file does not contain what it looks for.
MACHINE_PATHS = re.compile(
    "|".join(["/ho" + r"me/\w", "/ro" + "ot/", "/Us" + r"ers/\w", "/wo" + "rk/", "/tmp/pr" + "obe"])
)
REGISTRY_HOSTS = re.compile(
    "|".join(
        re.escape(left + right)
        for left, right in [
            ("pypi", ".org"),
            ("pythonhosted", ".org"),
            ("npmjs", ".org"),
            ("npmjs", ".com"),
            ("unpkg", ".com"),
            ("jsdelivr", ".net"),
            ("cdnjs", ".com"),
            ("deb.debian", ".org"),
            ("anaconda", ".org"),
        ]
    )
)


@pytest.mark.parametrize(("what", "pattern"), [("machine path", MACHINE_PATHS), ("registry host", REGISTRY_HOSTS)])
def test_the_tree_names_no_machine_and_no_registry(what: str, pattern: re.Pattern[str]) -> None:
    found = [
        f"{path}:{number}: {line.strip()[:100]}"
        for path, text in texts()
        for number, line in enumerate(text.splitlines(), 1)
        if pattern.search(line)
    ]
    assert not found, f"{what} in the tree:\n" + "\n".join(found)


def test_the_tree_patterns_find_what_they_look_for() -> None:
    assert MACHINE_PATHS.search("open('/ho" + "me/ada/x')")
    assert REGISTRY_HOSTS.search("https://py" + "pi.org/simple")


# --- static/: ES modules, everything from our own server -----------------------------------------------------------

WEB_TEXT = {".html", ".js", ".mjs", ".css", ".svg"}
OUTSIDE_URL = re.compile(
    r"\b(?:https?|wss?)://(?!www\.w3\.org/)[^\s\"'`)<>]*|(?:src|href)\s*=\s*[\"']//[^\"']*", re.IGNORECASE
)
SCRIPT_TAG = re.compile(r"<script\b[^>]*>", re.IGNORECASE)
IMPORTED = re.compile(r"""(?:^|[;\s])(?:import|export)\b[^;'"()]*?from\s*['"]([^'"]+)['"]|^\s*import\s*['"]([^'"]+)['"]|\bimport\(\s*['"]([^'"]+)['"]""", re.MULTILINE)  # fmt: skip  # noqa: E501


def static_files() -> list[Path]:
    return [path for path in tree_files() if path.is_relative_to(ROOT / "static") and path.suffix in WEB_TEXT]


def static_complaints(path: str, text: str, exists: Mapping[str, bool] | None = None) -> list[str]:
    """What in a page, style or module would load from elsewhere, or is no ES module."""
    found = [f"{path}: loads from elsewhere: {match.group(0)}" for match in OUTSIDE_URL.finditer(text)]
    if path.endswith((".html", ".svg")):
        found += [
            f"{path}: not an ES module: {tag}"
            for tag in SCRIPT_TAG.findall(text)
            if "module" not in tag and "json" not in tag
        ]
    if path.endswith((".js", ".mjs")):
        for groups in IMPORTED.findall(text):
            specifier = next(group for group in groups if group)
            if not specifier.startswith(("./", "../", "/static/")):
                found.append(f"{path}: a bare import needs a build step: {specifier}")
        if re.search(r"\brequire\(|\bmodule\.exports\b", text):
            found.append(f"{path}: CommonJS")
    return found


def test_static_is_es_modules_without_outside_urls() -> None:
    found = [
        line
        for path in static_files()
        for line in static_complaints(str(path.relative_to(ROOT)), path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n" + "\n".join(found)


def test_every_static_import_leads_to_a_file() -> None:
    missing = []
    for path in static_files():
        if path.suffix not in {".js", ".mjs"}:
            continue
        for groups in IMPORTED.findall(path.read_text(encoding="utf-8")):
            specifier = next(group for group in groups if group)
            target = ROOT / specifier[1:] if specifier.startswith("/static/") else path.parent / specifier
            if not target.is_file():
                missing.append(f"{path.relative_to(ROOT)} imports {specifier}: no such file")
    assert not missing, "\n" + "\n".join(missing)


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("page.html", '<script src="/static/main.js"></script>'),
        ("page.html", '<link rel="stylesheet" href="https://fonts.example/a.css">'),
        ("page.html", '<script type="module" src="//cdn.example/a.js"></script>'),
        ("style.css", "@import url(http://fonts.example/a.css);"),
        ("main.js", 'import { html } from "lit";'),
        ("main.js", 'const chart = await import("chart.js");'),
        ("main.js", "const a = require('a');"),
    ],
)
def test_a_page_that_loads_from_elsewhere_is_reported(path: str, text: str) -> None:
    assert static_complaints(path, text)


def test_a_page_of_our_own_is_not_reported() -> None:
    assert static_complaints("page.html", '<script type="module" src="/static/main.js"></script>') == []
    assert static_complaints("icon.svg", '<svg xmlns="http://www.w3.org/2000/svg"></svg>') == []
    assert static_complaints("main.js", 'import { a } from "./a.js";\nexport { b } from "../b.js";') == []
