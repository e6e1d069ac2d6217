"""The tree: what may stand at the top, no machine's paths, strict types, and pages that load nothing from elsewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]

TOP_LEVEL = {
    *("pyproject.toml", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "LICENSE", "Makefile"),
    *("Dockerfile", ".dockerignore", "compose.yaml"),
    *(".ci", ".gitignore", "app", "docs", "static", "sim", "study", "tests"),
}

# When there is no git to ask: what tools leave behind anywhere, and what the README's commands write at the top.
LEFT_BEHIND = {"__pycache__", "node_modules"}
LEFT_AT_THE_TOP = {".git", ".venv", ".hypothesis", ".mypy_cache", ".pytest_cache", ".ruff_cache", "build", "dist"}
WRITTEN_BY_THE_README = {
    *("data", "my-study.toml", "my-study.layout.png", "out", "pilot", "pilot-report", "replication", "report"),
}


def tree_files(root: Path = ROOT) -> list[Path]:
    """The project's files: those git tracks, or in an unpacked archive all but what was made there since."""
    asked = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True)
    listed = [root / name for name in asked.stdout.split("\0") if name]
    if not listed:  # there is no repository, or one around us that has none of our files
        listed = [path for path in root.rglob("*") if not _was_made_here(path.relative_to(root).parts)]
    return sorted(path for path in listed if path.is_file())


def _was_made_here(parts: tuple[str, ...]) -> bool:
    at_top = parts[0] in LEFT_AT_THE_TOP | WRITTEN_BY_THE_README or parts[0].endswith(".egg-info")
    return at_top or bool(LEFT_BEHIND & set(parts))


def texts() -> Iterator[tuple[Path, str]]:
    for path in tree_files():
        try:
            yield path.relative_to(ROOT), path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # a picture or a sound


def test_the_top_level_is_what_the_map_says() -> None:
    assert {path.relative_to(ROOT).parts[0] for path in tree_files()} - TOP_LEVEL == set()


def names(root: Path) -> list[str]:
    return [path.relative_to(root).as_posix() for path in tree_files(root)]


def test_what_a_user_made_in_the_checkout_is_no_part_of_the_tree(tmp_path: Path) -> None:
    for name in ("README.md", "app/report/job.py", "pilot/ticks.csv", "report/index.html", "my-study.toml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("text", encoding="utf-8")
    assert names(tmp_path) == ["README.md", "app/report/job.py"], "an unpacked archive"
    subprocess.run(["git", "init", "--quiet"], cwd=tmp_path, check=True)
    assert names(tmp_path) == ["README.md", "app/report/job.py"], "a repository that has none of it"
    (tmp_path / "stray.txt").write_text("text", encoding="utf-8")
    assert "stray.txt" in names(tmp_path)
    subprocess.run(["git", "add", "README.md", "pilot"], cwd=tmp_path, check=True)
    assert names(tmp_path) == ["README.md", "pilot/ticks.csv"], "what git tracks, whatever its name"


def test_what_the_readme_writes_is_known() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = [line for line in text.splitlines() if line.startswith(".venv/bin/salab ")]
    written = {name for line in commands for name in re.findall(r"--(?:out|data) ([\w.-]+)", line)}
    written |= {f"{name}.toml" for line in commands for name in re.findall(r"salab new ([\w-]+)", line)}
    written |= {f"{name}.layout.png" for line in commands for name in re.findall(r"salab check ([\w-]+)\.toml", line)}
    assert written == WRITTEN_BY_THE_README


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


# --- types ---------------------------------------------------------------------------------------------------------

OUR_FOLDERS = {"app", "sim", "study", "tests"}


def type_complaints(settings: Mapping[str, Any]) -> list[str]:
    """Where these settings of mypy let an error in our own code pass."""
    found = [] if settings.get("strict") is True else ["strict is not on"]
    found += [f"{folder} is not read" for folder in sorted(OUR_FOLDERS - set(settings.get("files", ())))]
    found += [f"{name} leaves files out" for name in ("exclude", "exclude_gitignore") if name in settings]
    overrides = settings.get("overrides", [])
    for part in (settings, *overrides):
        found += [f"{name} switches errors off" for name in ("ignore_errors", "disable_error_code") if part.get(name)]
        found += [f"{name} is weaker than strict" for name, value in part.items() if value is False]
    for override in overrides:
        asked = override["module"]
        modules = [asked] if isinstance(asked, str) else asked
        found += [f"{name} is ours" for name in modules if name == "*" or name.split(".")[0] in OUR_FOLDERS]
    return found


def test_everything_that_is_ours_is_checked_strictly() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]
    assert type_complaints(settings) == []
    inline = [str(path) for path, text in texts() if path.suffix == ".py" and re.search(r"^# ?mypy:", text, re.M)]
    assert inline == [], "settings in a file go over those of the project"


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"strict": False}, "strict is not on"),
        ({"files": ["app", "sim", "study"]}, "tests is not read"),
        ({"exclude": ["tests/bench"]}, "exclude leaves files out"),
        ({"disallow_untyped_defs": False}, "disallow_untyped_defs is weaker than strict"),
        ({"overrides": [{"module": "viser.*", "ignore_errors": True}]}, "ignore_errors switches errors off"),
        ({"overrides": [{"module": ["tests.*"], "follow_imports": "skip"}]}, "tests.* is ours"),
    ],
)
def test_settings_that_let_errors_pass_are_reported(changes: dict[str, Any], complaint: str) -> None:
    assert complaint in type_complaints({"strict": True, "files": sorted(OUR_FOLDERS), **changes})


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
