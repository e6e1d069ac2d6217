"""The extras of an installation: which modules each brings, and the one line for whoever needs one that is not there.

`pip install shared-autonomy-lab` serves studies. What analyses them, and the physics that is large, are asked for by
name; `pyproject.toml` says which packages those are. Whoever needs one imports it; `app.__main__` and the jobs make one
line of what that raises.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec

DISTRIBUTION = "shared-autonomy-lab"
ANALYSIS = "analysis"
EXTRAS: Mapping[str, tuple[str, ...]] = {
    ANALYSIS: ("scipy", "matplotlib", "pyarrow"),
    "bullet": ("pybullet",),
    "postgres": ("psycopg",),
}
"""Name of the extra to the modules that the lab imports of it."""


def how_to_install(extra: str) -> str:
    """The command."""
    return f"pip install '{DISTRIBUTION}[{extra}]'"


def has_extra(extra: str) -> bool:
    """Whether all of its modules can be found; none is imported."""
    return all(find_spec(module) is not None for module in EXTRAS[extra])


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """What is not installed and how it is, in one line; None if that module is of no extra."""
    module = (error.name or "").partition(".")[0]
    for extra, modules in EXTRAS.items():
        if module in modules:
            return f"needs {module}, which is not installed: {how_to_install(extra)}"
    return None
