"""The error that everything in `app` reports at its edges."""

from __future__ import annotations


class LabError(RuntimeError):
    """Something the lab cannot do; the message is one line that says what and what would help."""
