"""The one error this package raises."""

from __future__ import annotations

from study.records import StudyError


class PartError(StudyError):
    """A part that cannot be used; the message is one line that says which, why, and what there is instead."""


def one_line(error: BaseException) -> str:
    """What an error of somebody else's code says, fit for one line: whatever it holds, however long it is."""
    try:
        text = str(error)
    except (Exception, SystemExit) as worse:
        text = f"(its text raises {type(worse).__name__})"
    text = "".join(sign if sign.isprintable() else "?" for sign in " ".join(text.split()))
    return text if len(text) <= _LONGEST_TOLD else text[: _LONGEST_TOLD - 1] + "…"


_LONGEST_TOLD = 300
