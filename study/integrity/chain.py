"""A participant's chain: every row that was written for them, in order, each link over the one before.

    hash = SHA-256 of "hash before\\nparticipant\\nseq\\ntable\\nkey\\ncontent\\nmarks"

A row that is written anew (a trial that ends, a verdict that is overridden) has a link for each version: the last one
tells of the row as it is, those before prove what it was. A changed, added or missing row, and a changed link, are
found. Whoever can write the file can write another chain with it: what shows that is the last hash, kept elsewhere.
"""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from study.integrity.content import (
    CHAINED,
    changed_columns,
    content_and_marks_of,
    content_of,
    key_of,
    keys_of,
)
from study.integrity.findings import Finding
from study.records import ChainRow, row_of

BEGUN = "begun"
"""The table of a link that says: what was there already is linked after this one, as it was then."""


@dataclass(frozen=True)
class Head:
    """The end of a chain: how many links it has, and the hash of the last."""

    seq: int = 0
    hash: str = ""


@dataclass(frozen=True)
class Entry:
    """What is to be linked: which row, the hash of its content ("" = it was removed), and its marks."""

    table: str
    key: str
    content: str
    marks: str = ""
    salt: str = ""
    """What was hashed before the row. It is in no export, so that nobody can try what a row in no export held."""


@dataclass(frozen=True)
class Linked:
    """A link with the salt of its content, where there is one and it is known."""

    row: ChainRow
    salt: str = ""


def entry(table: str, values: Mapping[str, Any], salt: str = "") -> Entry:
    """The entry of a row as it is written."""
    content, marks = content_and_marks_of(table, values, salt)
    return Entry(table, key_of(table, values), content, marks, salt)


def link_hash(before: str, participant: str, seq: int, entry: Entry) -> str:
    """The hash of a link."""
    text = "\n".join((before, participant, str(seq), entry.table, entry.key, entry.content, entry.marks))
    return hashlib.sha256(text.encode()).hexdigest()


def extended(head: Head, participant: str, entries: Iterable[Entry]) -> list[ChainRow]:
    """The links of these entries after `head`."""
    links = []
    for made in entries:
        head = Head(head.seq + 1, link_hash(head.hash, participant, head.seq + 1, made))
        key, content, marks = (text or None for text in (made.key, made.content, made.marks))
        links.append(ChainRow(participant, head.seq, made.table, key, content, marks, head.hash))
    return links


def chained(participant: str, tables: Mapping[str, Sequence[Any]]) -> list[ChainRow]:
    """The chain of rows that were made at once, table by table: those of a simulated participant."""
    links: list[ChainRow] = []
    head, add = "", links.append
    for table in CHAINED:
        keys = keys_of(table) or ()
        for row in tables.get(table, ()):
            values = vars(row)
            content, marks = content_and_marks_of(table, values)
            seq, key = len(links) + 1, key_of(table, values) if table == "tokens" else _joined(values, keys)
            text = f"{head}\n{participant}\n{seq}\n{table}\n{key}\n{content}\n{marks}"
            head = hashlib.sha256(text.encode()).hexdigest()
            add(
                row_of(
                    ChainRow,
                    {
                        "participant": participant,
                        "seq": seq,
                        "row_table": table,
                        "row_key": key or None,
                        "content": content or None,
                        "marks": marks or None,
                        "hash": head,
                    },
                )
            )
    return links


def _joined(values: Mapping[str, Any], keys: Sequence[str]) -> str:
    return "_".join([str(values[name]) for name in keys])


def tombstone_hash(participant: str, utc: str) -> str:
    """The hash of what an erased chain leaves: whose it was and when it was erased, over no content."""
    return link_hash("", participant, 0, Entry("erased", utc, ""))


class ReadChain:
    """A chain that was read: what does not fit in itself, and how rows compare with it, table by table."""

    def __init__(self, participant: str, links: Iterable[Linked]) -> None:
        self._participant = participant
        self._last: dict[tuple[str, str], Linked] = {}
        self._arrived: dict[str, list[Linked]] = defaultdict(list)
        self.head = Head()
        self.findings = tuple(self._read(links))

    def _read(self, links: Iterable[Linked]) -> Iterator[Finding]:
        for link in links:
            row = link.row
            made = Entry(row.row_table, row.row_key or "", row.content or "", row.marks or "")
            place = f"chain of {self._participant}, link {row.seq}"
            if row.seq != self.head.seq + 1:
                yield Finding(place, f"the link before it has number {self.head.seq}")
            elif link_hash(self.head.hash, self._participant, row.seq, made) != row.hash:
                told = _row(made.table, self._participant, made.key)
                yield Finding(place, f"its hash does not fit what it says of {told}")
            self.head = Head(row.seq, row.hash)
            if made.table not in CHAINED and made.table != BEGUN:
                yield Finding(place, f"no table {made.table!r} is known")
            elif made.table != BEGUN and keys_of(made.table) is None:
                self._arrived[made.table].append(link)
            else:
                self._last[made.table, made.key] = link

    def compared(self, table: str, rows: Iterable[Mapping[str, Any]]) -> Iterator[Finding]:
        """What does not fit between the chain and the participant's rows of a table, which come in order of arrival
        where they have no key."""
        if keys_of(table) is None:
            yield from _in_order(self._participant, table, rows, self._arrived[table])
        else:
            links = {key: link for (of, key), link in self._last.items() if of == table and link.row.content}
            yield from _by_key(self._participant, table, rows, links)


def _in_order(
    participant: str, table: str, rows: Iterable[Mapping[str, Any]], links: Sequence[Linked]
) -> Iterator[Finding]:
    count = 0
    for count, values in enumerate(rows, start=1):
        place = f"{table} of {participant}, row {count}"
        if count > len(links):
            yield Finding(place, "was not recorded by the lab: the chain does not have it")
        else:
            yield from _compared(place, table, values, links[count - 1])
    if count < len(links):
        yield Finding(f"{table} of {participant}", f"has {count} rows; {len(links)} were recorded")


def _by_key(
    participant: str, table: str, rows: Iterable[Mapping[str, Any]], links: dict[str, Linked]
) -> Iterator[Finding]:
    for values in rows:
        key = key_of(table, values)
        place, link = _row(table, participant, key), links.pop(key, None)
        if link is None:
            yield Finding(place, "was not recorded by the lab, or is there twice: the chain does not have it")
        else:
            yield from _compared(place, table, values, link)
    for key in links:
        yield Finding(_row(table, participant, key), "is missing; it was recorded")


def _compared(place: str, table: str, values: Mapping[str, Any], link: Linked) -> Iterator[Finding]:
    if content_of(table, values, link.salt) != link.row.content:
        names = changed_columns(table, values, link.row.marks or "")
        which = f"column {', '.join(names)} is" if len(names) == 1 else f"columns {', '.join(names)} are"
        yield Finding(place, f"{which if names else 'is'} not as recorded")


def _row(table: str, participant: str, key: str) -> str:
    names = keys_of(table) if table in CHAINED else None
    parts = key.split("_") if table != "submissions" else [key]
    named = [f"{name} {part}" for name, part in zip(names or (), parts, strict=False)]
    return ", ".join([f"{table} of {participant}", *named])
