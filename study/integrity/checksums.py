"""Checksums of the files of a folder, in a file beside them that `sha256sum --check` reads too."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from study.integrity.findings import Finding

SUMS_NAME = "SHA256SUMS"


def digest(path: Path) -> str:
    """The SHA-256 of a file."""
    sha256 = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            sha256.update(block)
    return sha256.hexdigest()


def sums_of(sums: Mapping[str, str]) -> str:
    """The text of the file, of file to SHA-256."""
    return "".join(f"{sha256}  {name}\n" for name, sha256 in sorted(sums.items()))


def check_sums(folder: Path, described: Mapping[str, str] = {}) -> Iterator[Finding]:
    """Files that are changed or missing. `described` is what another file says of their SHA-256: where it agrees with a
    file, the checksum is what was changed."""
    try:
        lines = (folder / SUMS_NAME).read_bytes().decode("utf-8", "backslashreplace").split("\n")
    except OSError:
        yield Finding(SUMS_NAME, "is missing: nothing says what the files were")
        return
    for number, line in enumerate(filter(None, lines), start=1):
        sha256, gap, name = line.partition("  ")
        if not gap or Path(name).name != name or name in ("", ".", ".."):
            yield Finding(SUMS_NAME, f"line {number} is no checksum of a file beside it")
            continue
        try:
            found = digest(folder / name)
        except FileNotFoundError:
            is_strange = described and name not in described
            line_says = f"line {number} names {name}, which was no file of it"
            yield Finding(SUMS_NAME, line_says) if is_strange else Finding(name, "is missing")
            continue
        except OSError as error:
            yield Finding(name, f"cannot be read: {error.strerror or error}")
            continue
        if found != sha256 and described.get(name) == found:
            yield Finding(SUMS_NAME, f"line {number} is changed: {name} is as described elsewhere")
        elif found != sha256:
            sure = described.get(name, found) == sha256
            yield Finding(name, f"is changed{'' if sure else f', or its line in {SUMS_NAME} is'}")


def changed_files(findings: Iterable[Finding]) -> str:
    """The files of these findings, for one line."""
    return ", ".join(dict.fromkeys(finding.place for finding in findings))
