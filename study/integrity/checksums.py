"""Checksums of the files of a folder, in a file beside them that `sha256sum --check` reads too."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from study.integrity.findings import Finding
from study.text_file import MOST_TABLE_BYTES, FileProblem, opened, read_bytes

SUMS_NAME = "SHA256SUMS"
MOST_SUMS_BYTES = 1_000_000


def digest(path: Path) -> str:
    """The SHA-256 of a file. Raises `FileProblem` for one that cannot be read, or is a link out of its folder."""
    sha256 = hashlib.sha256()
    with opened(path, MOST_TABLE_BYTES, within=path.parent) as file:
        while block := file.read(1 << 20):
            sha256.update(block)
    return sha256.hexdigest()


def sums_of(sums: Mapping[str, str]) -> str:
    """The text of the file, of file to SHA-256."""
    return "".join(f"{sha256}  {name}\n" for name, sha256 in sorted(sums.items()))


def check_sums(folder: Path, described: Mapping[str, str] = {}, known: Collection[str] = ()) -> Iterator[Finding]:
    """Files that are changed or missing, or have no checksum.

    `described` is what another file says of their SHA-256: where it agrees with a file, the checksum is what was
    changed; where it disagrees with both, somebody made the checksum anew. `known` are names that have a checksum
    whenever there is such a file.
    """
    try:
        raw = read_bytes(folder / SUMS_NAME, MOST_SUMS_BYTES, within=folder)
    except FileProblem as problem:
        is_missing = not os.path.lexists(folder / SUMS_NAME)
        yield Finding(SUMS_NAME, "is missing: nothing says what the files were" if is_missing else problem.reason)
        return
    lines = raw.decode("utf-8", "backslashreplace").split("\n")
    summed = {line.partition("  ")[2] for line in lines}
    for name in sorted({*described, *known} - summed):
        if os.path.lexists(folder / name):
            yield Finding(SUMS_NAME, f"has no line of {name}")
        elif name in described:
            yield Finding(name, "is missing, and its checksum")
    for number, line in enumerate(filter(None, lines), start=1):
        sha256, gap, name = line.partition("  ")
        if not gap or Path(name).name != name or name in ("", ".", ".."):
            yield Finding(SUMS_NAME, f"line {number} is no checksum of a file beside it")
            continue
        if not os.path.lexists(folder / name):
            is_strange = described and name not in described
            line_says = f"line {number} names {name}, which was no file of it"
            yield Finding(SUMS_NAME, line_says) if is_strange else Finding(name, "is missing")
            continue
        try:
            found = digest(folder / name)
        except FileProblem as problem:
            yield Finding(name, problem.reason)
            continue
        if found != sha256 and described.get(name) == found:
            yield Finding(SUMS_NAME, f"line {number} is changed: {name} is as described elsewhere")
        elif found != sha256:
            sure = described.get(name, found) == sha256
            yield Finding(name, f"is changed{'' if sure else f', or its line in {SUMS_NAME} is'}")
        elif described.get(name, found) != found:
            yield Finding(name, "is not the file that is described elsewhere, though its checksum fits")


def changed_files(findings: Iterable[Finding]) -> str:
    """The files of these findings, for one line."""
    return ", ".join(dict.fromkeys(finding.place for finding in findings))
