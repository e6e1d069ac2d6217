"""Questionnaires that installed packages bring: an entry point names a text in the form of a questionnaire's own file,
or the path of such a file.

    [project.entry-points."salab.questionnaires"]
    teamwork = "team_scales:TEAMWORK"

Like a file beside the study file, it becomes a part of the study's text: what is stored and exported needs no package.
"""

from __future__ import annotations

from pathlib import Path

from study.definition.questionnaires import file_problems
from study.parts.errors import PartError
from study.parts.registry import Registry
from study.text_file import FileProblem, read_text

MOST_BYTES = 1_000_000


def packaged_questionnaire(name: str, registry: Registry) -> tuple[bytes, str] | None:
    """The text of a questionnaire and whose it is, as `package version`; None when no package brings one.

    Raises `PartError` with one line for one that cannot be used.
    """
    found = registry.registered.get(name)
    if found is None:
        return None
    called = f"questionnaire {name!r} of {found.package} {found.version}"
    brought = registry.load(name)
    if isinstance(brought, Path):
        try:
            source = read_text(brought, MOST_BYTES).encode()
        except FileProblem as problem:
            raise PartError(f"{called}: {brought.name} {problem.reason}") from None
    elif isinstance(brought, str):
        source = brought.encode()
    else:
        raise PartError(
            f"{called}: {found.place} is of type {type(brought).__name__}; it must be a text or a pathlib.Path"
        )
    problems = file_problems(source, f"{name}.toml")
    if problems:
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise PartError(f"{called} cannot be used: {problems[0]}{more}")
    return source, f"{found.package} {found.version}"
