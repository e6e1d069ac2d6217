"""The one error this package raises."""

from __future__ import annotations


class AutonomyError(ValueError):
    """A value the arbiter cannot work with; the message gives the value, the bound and the choices."""
