"""A participant's certificate: what was acknowledged, what is stored, where the chain ended, signed when they ended.

Pages tell what they were told is saved: of practice and trials the last tick, and how many submits and notes. It is
complete when that is what is stored.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Literal, TypeAlias

from study.integrity.chain import Head
from study.integrity.findings import Finding
from study.records import CertificateRow, ChainRow

State: TypeAlias = Literal["complete", "less", "more", "unconfirmed"]
COUNTED = ("ticks", "practice_ticks", "survey_answers")
"""Tables whose rows are counted: those of a participant who has ended grow no more."""


def signed_text(row: CertificateRow) -> str:
    """What is signed: everything but the signature."""
    values = {name: value for name, value in vars(row).items() if name != "signature"}
    return json.dumps(values, sort_keys=True, separators=(",", ":"))


def told(reports: Iterable[Mapping[str, Any]]) -> tuple[int, int] | None:
    """(ticks, submits and notes) that pages were told are saved, of all they reported; None without a report.

    A phase may have been driven in several tabs, each of which numbers its own messages.
    """
    phases: dict[str, int] = {}
    messages: dict[str, int] = {}
    for report in reports:
        for phase, ticks in report["ticks"].items():
            phases[phase] = max(phases.get(phase, 0), ticks)
        messages[report["client"]] = report["acknowledged"]
    return (sum(phases.values()), sum(messages.values())) if messages else None


def state_of(row: CertificateRow) -> State:
    """complete, less (pages were told of less than is stored: the last words did not reach them), more (of what is not
    stored: something is lost), or unconfirmed (no page reported)."""
    if row.told_ticks is None or row.told_messages is None:
        return "unconfirmed"
    ticks, messages = row.told_ticks - row.ticks - row.practice_ticks, row.told_messages - row.messages
    if ticks > 0 or messages > 0:
        return "more"
    return "less" if ticks < 0 or messages < 0 else "complete"


def all_heads(heads: Mapping[str, Head]) -> str:
    """One hash over the ends of all chains."""
    lines = "".join(f"{participant} {head.seq} {head.hash}\n" for participant, head in sorted(heads.items()))
    return hashlib.sha256(lines.encode()).hexdigest()


def check_certificate(
    row: CertificateRow, links: Iterable[ChainRow], is_signed: Callable[[str, str, str], bool]
) -> Iterator[Finding]:
    """What does not fit between a certificate and the participant's chain. `is_signed(key, text, signature)`."""
    place = f"certificate of {row.participant}"
    if not is_signed(row.key, signed_text(row), row.signature):
        yield Finding(place, "its signature does not fit what it says")
    until = [link for link in links if link.seq <= row.links]
    if len(until) != row.links or (until and until[-1].hash != row.head):
        yield Finding(place, f"the chain does not end its first {row.links} links with {row.head[:12]}")
    counts = Counter(link.row_table for link in until)
    for table in COUNTED:
        certified = {"ticks": row.ticks, "practice_ticks": row.practice_ticks, "survey_answers": row.answers}[table]
        if counts[table] != certified:
            yield Finding(place, f"{certified} {table} were certified, {counts[table]} are linked")
    if state_of(row) == "more":
        yield Finding(place, "pages were told that more is saved than is stored")
