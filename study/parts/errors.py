"""The error this package raises, and how the errors of somebody else's code are told."""

from __future__ import annotations

from study.records import StudyError

MOST_CHARACTERS = 300


class PartError(StudyError):
    """A part that cannot be used; the message is one line that says which, why, and what there is instead."""


def one_line(error: BaseException) -> str:
    """What an error says, in one line that can be stored and shown anywhere, whatever its author put in it."""
    try:
        text = str(error)
    except BaseException as worse:  # whoever raises may raise here, too
        text = f"an error that cannot be told ({type(worse).__name__})"
    return plain(text)


def plain(text: str) -> str:
    """A text in one line, without what cannot be printed, shortened."""
    joined = " ".join(text.encode("utf-8", "replace").decode("utf-8").split())
    shown = "".join(sign if sign.isprintable() else "?" for sign in joined)
    return shown if len(shown) <= MOST_CHARACTERS else shown[: MOST_CHARACTERS - 1] + "…"
