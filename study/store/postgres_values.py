"""Values on their way to PostgreSQL, as SQLite would keep them."""

from __future__ import annotations

from typing import Any

from psycopg.types.numeric import FloatDumper, Int8Dumper
from psycopg.types.string import StrDumperUnknown


class _Number(FloatDumper):  # type: ignore[misc]
    """What is no number is nothing, and zero has no sign."""

    def dump(self, value: Any) -> Any:
        return None if value != value else super().dump(value + 0.0)


class _Text(StrDumperUnknown):  # type: ignore[misc]
    """NUL stands in no text of PostgreSQL's; nothing is found by a text that has it."""

    def dump(self, value: str) -> Any:
        return super().dump(value.replace("\0", "\ufffd") if "\0" in value else value)


def adapt(connection: Any) -> None:
    """Have a connection send values so. Whole numbers are of one type, whatever their size: one prepared statement."""
    for kind, dumper in ((float, _Number), (int, Int8Dumper), (str, _Text)):
        connection.adapters.register_dumper(kind, dumper)
