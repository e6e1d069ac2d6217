"""The options of `pytest --pyargs app.contracts`: which parts are held to their contract.

pytest finds this as an entry point, because a `conftest.py` in an installed package is read after the command line, too
late for options. Every pytest loads it where the lab is installed, so it imports nothing and changes nothing of others.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent
SUITES = {"test_arbiters.py": "arbiter", "test_inferences.py": "inference", "test_robots.py": "robot"}
"""The file of each kind of part, and so the option that names such parts."""
TIMES = "salab_slowest_answer"
"""Under this name a check leaves how long the slowest answer took."""


def pytest_addoption(parser: Any) -> None:
    """`--arbiter blend.py:Blend`, and the like."""
    group = parser.getgroup("salab", "parts of a shared-autonomy study, for pytest --pyargs app.contracts")
    for kind in SUITES.values():
        group.addoption(
            f"--{kind}",
            action="append",
            default=[],
            metavar="NAME",
            help=f"an {kind}" if kind[0] in "ai" else f"a {kind}",
        )
    group.addoption("--parameters", metavar="JSON", help="what those parts take, such as '{\"confidence\": 0.4}'")


def pytest_ignore_collect(collection_path: Path, config: Any) -> bool | None:
    """Of the suites only those that somebody named a part for."""
    if collection_path.parent != FOLDER or collection_path.name not in SUITES:
        return None
    if not any(config.getoption(f"--{kind}") for kind in SUITES.values()):
        import pytest

        raise pytest.UsageError("name what to check: --arbiter, --inference or --robot, as blend.py:Blend or by name")
    return None if config.getoption(f"--{SUITES[collection_path.name]}") else True


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """How long the slowest answers took."""
    for report in terminalreporter.getreports("passed") + terminalreporter.getreports("failed"):
        for name, told in getattr(report, "user_properties", ()):
            if name == TIMES:
                terminalreporter.write_line(told)
