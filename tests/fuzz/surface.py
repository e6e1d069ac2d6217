"""What every surface can do: make inputs, and tell what is wrong with what comes of one."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import Any, Protocol


class Surface(Protocol):
    """One kind of door into the lab. An input is a value that JSON holds, so that it can be kept."""

    name: str

    def inputs(self, count: int, random: Random) -> Iterator[tuple[Any, int]]:
        """Inputs, each with how many it counts for, until there were `count`."""

    def problem(self, given: Any) -> str:
        """What went wrong with an input, "" for nothing."""
