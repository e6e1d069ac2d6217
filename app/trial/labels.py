"""The words for what can be named in an instruction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Labels:
    """The words for objects and bins, by id."""

    objects: Mapping[str, str]
    bins: Mapping[str, str]
