"""Whether an export holds what was recorded: checksums, bounds, references, CSV against Parquet, everybody's chain."""

from __future__ import annotations

import hashlib
import os
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from study.definition.files_beside import MOST_STUDY_BYTES
from study.export.data_package import descriptor_sums, file_names
from study.export.export import META_NAME, WITH_PARQUET, ExportError, read_meta, read_table
from study.export.parquet import has_parquet, parquet_rows, same_in_parquet
from study.extras import ANALYSIS, how_to_install
from study.integrity.certificate import check_certificate
from study.integrity.chain import Linked, ReadChain
from study.integrity.checksums import SUMS_NAME, changed_files, check_sums
from study.integrity.content import OWN_KEYS, key_of
from study.integrity.findings import Finding, Verdict
from study.integrity.signing import is_signed
from study.records import KEYS, REFERENCES, TABLES, TrialRow, columns
from study.text_file import FileProblem, read_bytes

CHAIN = "chain"


def verify_export(folder: Path) -> Verdict:
    """Compare an export with its checksums and its chain. Raises `ExportError` for a folder that is none, and where
    its Parquet cannot be read for want of what reads it."""
    meta = read_meta(folder)
    if meta.get(WITH_PARQUET) is not False and not has_parquet():
        raise ExportError(f"{folder}: to compare its Parquet with the CSV: {how_to_install(ANALYSIS)}")
    return _Export(folder, meta).verdict()


def refuse_changed(folder: Path) -> None:
    """Raises `ExportError` with one line when files of an export are not as they were written."""
    read_meta(folder)  # says so when there is no export
    found = changed_files(_file_findings(folder))
    if found:
        raise ExportError(
            f"{folder}: changed since the export: {found}; export the data again, see `salab verify {folder}`, or say "
            "--changed to take the files as they are"
        )


def _file_findings(folder: Path) -> Iterator[Finding]:
    known = {*file_names(), *(path.name for path in folder.glob("study*.toml"))} - {SUMS_NAME}
    return check_sums(folder, descriptor_sums(folder), known)


class _Export:
    """A folder that is an export, table by table: only the chains and the keys are held."""

    def __init__(self, folder: Path, meta: Mapping[str, Any]) -> None:
        self._folder = folder
        self._meta = meta
        self._keys: dict[str, set[tuple[Any, ...]]] = {}
        self._wanted: dict[str, set[tuple[Any, ...]]] = {}
        self._ticks: Counter[tuple[str, int]] = Counter()

    def verdict(self) -> Verdict:
        findings = list(_file_findings(self._folder))
        findings += self._studies()
        told = self._meta.get("rows")
        # A table is there when its file is, too: no word in `meta.json` hides one from being looked at.
        counted = {name for name in TABLES if not isinstance(told, dict) or name in told or self._has(f"{name}.csv")}
        has_chain = CHAIN in counted
        chains: dict[str, ReadChain] = {}
        links = []
        if has_chain:
            links = self._read(CHAIN, findings) or []
            chains = {who: ReadChain(who, map(Linked, rows)) for who, rows in _by_participant(links).items()}
            findings += [finding for chain in chains.values() for finding in chain.findings]
        with_parquet = self._meta.get(WITH_PARQUET) is not False
        notes = [] if with_parquet else ["written without Parquet: CSV is compared with checksums and the chain"]
        notes += [] if has_chain else ["written before there was a chain: rows can be compared with checksums alone"]
        # Ticks come before trials, whose rows are counted from them while they run.
        for table in sorted(
            (name for name in TABLES if name != CHAIN and name in counted), key=lambda name: name == "trials"
        ):
            rows = self._read(table, findings)
            if rows is None:
                continue
            findings += self._counts(table, rows)
            if table == "ticks":
                self._ticks = Counter((row.participant, row.trial) for row in rows)
            if has_chain:
                findings += self._chained(table, rows, chains)
            if has_chain and table == "certificates":
                linked = _by_participant(links)
                for row in rows:
                    findings += check_certificate(row, linked.get(row.participant, ()), is_signed)
        findings += self._references()
        people = len(self._keys.get("participants", ()))
        return Verdict(tuple(findings), people, len(links), tuple(notes))

    def _has(self, name: str) -> bool:
        return os.path.lexists(self._folder / name)

    def _read(self, table: str, findings: list[Finding]) -> list[Any] | None:
        """The rows of a table, their Parquet compared; None, and a finding, when they cannot be read."""
        try:
            rows = read_table(self._folder, table)
        except ExportError as error:
            findings.append(
                Finding(f"{table}.csv", str(error).removeprefix(f"{self._folder / table}.csv").lstrip(": "))
            )
            return None
        if table in KEYS:
            self._keys[table] = _keys(rows, KEYS[table])
        if table in REFERENCES:
            self._wanted[table] = _keys(rows, KEYS[REFERENCES[table]])
        if self._meta.get(WITH_PARQUET) is not False:
            findings += self._parquet(table, rows)
        return rows

    def _parquet(self, table: str, rows: Sequence[Any]) -> Iterator[Finding]:
        name, count, infos = f"{table}.parquet", 0, columns(table)
        try:
            for count, (row, other) in enumerate(zip(rows, parquet_rows(self._folder / name), strict=False), start=1):
                differs = [info.name for info in infos if not same_in_parquet(info, getattr(row, info.name), other)]
                if differs:
                    place = f"{table}.csv, {_named(table, row, count)}"
                    yield Finding(place, f"{_columns(differs)} not what {name} has")
            there = sum(1 for _ in parquet_rows(self._folder / name))
        except ValueError as error:
            yield Finding(name, str(error))
            return
        if there != len(rows):
            yield Finding(name, f"has {there} rows, {table}.csv {len(rows)}")

    def _counts(self, table: str, rows: Sequence[Any]) -> Iterator[Finding]:
        counted = self._meta.get("rows")
        told = counted.get(table) if isinstance(counted, dict) else None
        if told != len(rows):
            yield Finding(f"{table}.csv", f"has {len(rows)} rows; meta.json says {told}")

    def _references(self) -> Iterator[Finding]:
        for table, wanted in self._wanted.items():
            target = REFERENCES[table]
            if target not in self._keys:
                continue  # it cannot be read, which is told
            for key in sorted(wanted - self._keys.get(target, set()), key=str):
                named = ", ".join(f"{name} {value}" for name, value in zip(KEYS[target], key, strict=True))
                yield Finding(f"{table}.csv", f"has rows of {named}, which {target}.csv has not")

    def _chained(self, table: str, rows: Sequence[Any], chains: Mapping[str, ReadChain]) -> Iterator[Finding]:
        found = _by_participant(rows)
        for who in sorted({*found, *chains}):
            if who not in chains:
                yield Finding(f"{table} of {who}", "the export has no chain of this participant")
                continue
            yield from chains[who].compared(table, (vars(self._as_stored(row)) for row in found.get(who, ())))

    def _as_stored(self, row: Any) -> Any:
        """A trial under way is exported with its ticks so far; its row is from its begin."""
        if isinstance(row, TrialRow) and row.outcome == "running":
            if row.ticks != self._ticks[row.participant, row.trial]:
                return row
            return replace(row, ticks=0, overruns=0)
        return row

    def _studies(self) -> Iterator[Finding]:
        """Study files, by the hashes that participants were enrolled with."""
        hashes = {}
        for path in sorted(self._folder.glob("study*.toml")):
            try:
                raw = read_bytes(path, MOST_STUDY_BYTES, within=self._folder)
                hashes[hashlib.sha256(raw).hexdigest()] = path.name
            except FileProblem as problem:
                yield Finding(path.name, problem.reason)
        told = self._meta.get("studies", [])
        if not isinstance(told, list):
            yield Finding(META_NAME, f"studies is {str(told)[:40]!r}, must be a list of hashes")
            return
        for study in map(str, told):
            if study not in hashes:
                yield Finding("study.toml", f"no study file here is the one of hash {study[:12]}")


def _by_participant(rows: Sequence[Any]) -> dict[str, list[Any]]:
    found = defaultdict(list)
    for row in rows:
        found[row.participant].append(row)
    return found


def _keys(rows: Sequence[Any], names: Sequence[str]) -> set[tuple[Any, ...]]:
    return {tuple(getattr(row, name) for name in names) for row in rows}


def _columns(names: Sequence[str]) -> str:
    return f"column {names[0]} is" if len(names) == 1 else f"columns {', '.join(names)} are"


def _named(table: str, row: Any, number: int) -> str:
    key = key_of(table, vars(row)).replace("_", ", ") if table != CHAIN and table not in OWN_KEYS else str(row.seq)
    return f"row {number} ({', '.join(part for part in (row.participant, key) if part)})"
