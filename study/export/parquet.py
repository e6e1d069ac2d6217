"""The tables of an export as Parquet, beside the CSV: the same rows, with times of day as timestamps.

pyarrow, which comes with the extra `analysis`, is loaded when a table is written or read. Without it an export is CSV
alone, and says so; what CSV and Parquet refuse is the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from study.extras import ANALYSIS, has_extra, how_to_install
from study.records import UTC, ColumnInfo, columns
from study.text_file import MOST_TABLE_BYTES, FileProblem, opened

if TYPE_CHECKING:
    import pyarrow as pa
    from pyarrow.parquet import ParquetFile

_READ_ROWS = 20_000
"""Rows that are read at a time."""
_INT64 = range(-(2**63), 2**63)


def has_parquet() -> bool:
    """Whether Parquet can be written and read here."""
    return has_extra(ANALYSIS)


def csv_alone() -> str:
    """What to say of an export that is written here, in brackets; nothing where Parquet is written too."""
    return "" if has_parquet() else f" (CSV alone; for Parquet too: {how_to_install(ANALYSIS)})"


class TableBeside(Protocol):
    """What is written beside the CSV of one table; a context that closes it."""

    def __enter__(self) -> TableBeside: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def arrays(self, cells: Sequence[Sequence[Any]]) -> Sequence[Any]:
        """The next rows, column by column: values or None. Raises `ValueError` for a time of day that is none, and
        `OverflowError` or `TypeError` for a value that is not of its column's type."""
        ...

    def add(self, arrays: Sequence[Any]) -> None:
        """What `arrays` has made belongs to the group of rows under way."""
        ...

    def end_group(self) -> None:
        """Write the group of rows; the next one begins. Closing writes the last one."""
        ...


def table_beside(path: Path, table: str) -> TableBeside:
    """The Parquet of one recorded table, or nothing at all where it cannot be written."""
    return ParquetTable(path, table) if has_parquet() else NoTable(table)


class NoTable:
    """Writes nothing, and refuses what Parquet would."""

    def __init__(self, table: str) -> None:
        self._infos = columns(table)

    def __enter__(self) -> NoTable:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def arrays(self, cells: Sequence[Sequence[Any]]) -> Sequence[Any]:
        """Look at the next rows as `TableBeside.arrays`; there is nothing to be written of them."""
        for info, column in zip(self._infos, cells, strict=True):
            for value in column:
                if info.unit == UTC:
                    _time(value)
                elif info.type == "str" and value is not None:
                    value.encode()
                elif info.type == "int" and value is not None and value not in _INT64:
                    raise OverflowError(value)
        return ()

    def add(self, arrays: Sequence[Any]) -> None:
        """Nothing to write."""

    def end_group(self) -> None:
        """Nothing to write."""


class ParquetTable:
    """One recorded table on its way into a Parquet file."""

    def __init__(self, path: Path, table: str) -> None:
        import pyarrow as pa
        from pyarrow.parquet import ParquetWriter

        self._infos = columns(table)
        self._schema = pa.schema([_field(info) for info in self._infos])
        self._writer = ParquetWriter(path, self._schema)
        self._group: list[list[pa.Array]] = []

    def __enter__(self) -> ParquetTable:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self.end_group()
        finally:
            self._writer.close()

    def arrays(self, cells: Sequence[Sequence[Any]]) -> list[pa.Array]:
        """As `TableBeside.arrays`."""
        import pyarrow as pa

        return [
            pa.array(map(_time, column) if info.unit == UTC else column, type=field.type)
            for info, field, column in zip(self._infos, self._schema, cells, strict=True)
        ]

    def add(self, arrays: Sequence[pa.Array]) -> None:
        """Hold what `arrays` has made, a fraction of what the rows take, for the group of rows under way."""
        self._group.append(list(arrays))

    def end_group(self) -> None:
        """Write what is held as a group of rows."""
        import pyarrow as pa

        if self._group:
            columns = [pa.concat_arrays(pieces) for pieces in zip(*self._group, strict=True)]
            self._writer.write_table(pa.Table.from_arrays(columns, schema=self._schema))
            self._group.clear()


def _field(info: ColumnInfo) -> pa.Field:
    import pyarrow as pa

    types = {"int": pa.int64(), "float": pa.float64(), "str": pa.string()}
    kind = pa.timestamp("us", tz="UTC") if info.unit == UTC else types[info.type]
    told = {"description": info.description, **({"unit": info.unit} if info.unit else {})}
    return pa.field(info.name, kind, nullable=info.optional, metadata=told)


def parquet_rows(path: Path) -> Iterator[dict[str, Any]]:
    """The rows of a Parquet file. Raises `ValueError` for one that cannot be read."""
    with _readable(path) as file:
        for batch in file.iter_batches():
            yield from batch.to_pylist()


def parquet_columns(path: Path, names: Sequence[str], given: str) -> Iterator[list[npt.NDArray[Any]]]:
    """These columns of a Parquet file, some thousand rows at a time, without the rows where `given` has no value; equal
    texts are mostly one object. Raises `ValueError` for a file that cannot be read, or lacks a column or a value."""
    with _readable(path) as file:
        texts = [field.name for field in file.schema_arrow if field.name in names and str(field.type) == "string"]
        if missing := set(names) - set(file.schema_arrow.names):
            raise ValueError(f"columns missing: {', '.join(sorted(missing))}")
    with _readable(path, texts) as file:
        for batch in file.iter_batches(_READ_ROWS, columns=list(names)):
            columns = [(rows := batch.filter(batch.column(given).is_valid())).column(name) for name in names]
            if any(column.null_count for column in columns):
                raise ValueError("a value is missing")
            if len(rows):
                yield [_numpy(column) for column in columns]


def _numpy(column: pa.Array) -> npt.NDArray[Any]:
    if (words := getattr(column, "dictionary", None)) is None:
        return np.asarray(column)
    return np.asarray(words.to_numpy(zero_copy_only=False)[column.indices.to_numpy()])


@contextmanager
def _readable(path: Path, with_words: Sequence[str] = ()) -> Iterator[ParquetFile]:
    """The file, open; columns `with_words` come as numbers into a list of their words."""
    import pyarrow as pa
    from pyarrow.parquet import ParquetFile

    try:
        with (
            opened(path, MOST_TABLE_BYTES, within=path.parent) as source,
            ParquetFile(source, read_dictionary=list(with_words)) as file,
        ):
            yield file
    except FileProblem as problem:
        raise ValueError(problem.reason) from None
    except (OSError, pa.ArrowException) as error:
        raise ValueError(f"cannot be read: {' '.join(str(error).split())}") from None


def same_in_parquet(info: ColumnInfo, value: Any, row: Mapping[str, Any]) -> bool:
    """Whether a row of a Parquet file has this value; a column that came later is in none of before."""
    if info.name not in row:
        return True
    other = row[info.name]
    try:
        return bool(other == (_time(value) if info.unit == UTC else value))
    except ValueError:  # a time that is none
        return False


def _time(utc: str | None) -> datetime | None:
    return None if utc is None else datetime.fromisoformat(utc.replace("Z", "+00:00"))
