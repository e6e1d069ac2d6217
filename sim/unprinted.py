"""Imports of libraries that print something of their own, without it."""

from __future__ import annotations

import importlib
import os
from types import ModuleType

_STDERR = 2


def imported(name: str) -> ModuleType:
    """The module of that name. What its own C code prints on standard error meanwhile is lost.

    Raises what the import raises.
    """
    try:
        before = os.dup(_STDERR)
    except OSError:  # there is none, as in a program without a console
        return importlib.import_module(name)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, _STDERR)
        return importlib.import_module(name)
    finally:
        os.dup2(before, _STDERR)
        os.close(before)
        os.close(nowhere)
