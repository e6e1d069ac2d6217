"""The parts that the command line names."""

from __future__ import annotations

from typing import Any

from app.contracts.candidate import Candidate, candidate
from app.contracts.part import usable
from app.contracts.verdict import CollectError, Failed
from study.records import StudyError


def candidates(config: Any, kind: str) -> list[Candidate]:
    """Those of one kind; a file is looked for where pytest was started. Ends the collection with one line when one
    cannot be made."""
    folder = config.invocation_params.dir
    try:
        given = config.getoption("--parameters") or "{}"
        return [usable(candidate(kind, name, folder, given)) for name in config.getoption(f"--{kind}")]
    except (StudyError, Failed) as error:
        raise CollectError(str(error)) from None
