"""The one error this package raises."""

from __future__ import annotations

from study.records import StudyError


class PartError(StudyError):
    """A part that cannot be used; the message is one line that says which, why, and what there is instead."""
