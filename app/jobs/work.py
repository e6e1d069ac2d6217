"""A job seen from the inside: what it says on stdout, one JSON object a line.

{"step": 2, "of": 4, "text": "Measuring the trials"}        how far it is
{"made": {...}}                                             the end of it
{"cannot": "No trial is completed yet."}                    or why there is none
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from app.processes import step_back
from study.records import StudyError
from study.store import StoreTroubled

Say = Callable[[dict[str, Any]], None]
NICENESS = 15
"""The robots of live sessions come first."""


def run(work: Callable[[Say], dict[str, Any]], *, niceness: int = NICENESS) -> int:
    """Do the work as a program, and say what it made, or in one line why it could not."""
    step_back(niceness)
    try:
        made = work(say)
    except StoreTroubled as error:
        say({"cannot": str(error).splitlines()[0], "trouble": error.kind})
    except StudyError as error:
        say({"cannot": str(error).splitlines()[0]})
    else:
        say({"made": made})
    return 0


def say(told: dict[str, Any]) -> None:
    """Tell the lab. Whoever has nobody to tell any more ends: the lab is gone."""
    print(json.dumps(told), flush=True)
