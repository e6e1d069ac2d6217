"""Where a lab's data are: a folder with a database in it, or a database that a server keeps and a folder for the rest.

The address of a server may hold a password. It stands in no text: not in `str` or `repr`, and in no error.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import SplitResult, parse_qsl, urlencode, urlsplit

from study.records import StudyError

SCHEMES = ("postgresql+psycopg", "postgresql", "postgres")
"""How the address of a database begins; the first is how it goes on being called."""
EXAMPLE = "postgresql+psycopg://NAME:PASSWORD@HOST/DATABASE"
VARIABLE = "SALAB_DATABASE_URL"
"""Where a job that the lab starts finds the address: arguments of a process can be read by everybody."""
HIDDEN = "***"


@dataclass(frozen=True)
class DataPlace:
    """Where data are. `url` is None for a database in the folder; else the folder holds what no database does: the
    lab's key, how many people it takes, its lock, and what is being made of the data."""

    folder: Path
    url: str | None = field(default=None, repr=False)
    shares_folder: bool = field(default=False, repr=False, compare=False)
    """Another store of this program holds the folder of a database on a server: a lab of that folder, copied there."""

    def __str__(self) -> str:
        return str(self.folder) if self.url is None else without_password(self.url)

    @property
    def environment(self) -> Mapping[str, str]:
        """What a process of ours needs beside the folder; see `handed_over`."""
        return {VARIABLE: self.url or ""}  # said in any case: somebody may have set it


def place_of(given: DataPlace | Path | str) -> DataPlace:
    """The same, of whatever names it."""
    return given if isinstance(given, DataPlace) else DataPlace(Path(given))


def handed_over(folder: Path | str) -> DataPlace:
    """The place that the process which started this one named: its folder, and its database if it has one."""
    return DataPlace(Path(folder), os.environ.get(VARIABLE) or None)


def is_url(text: str) -> bool:
    """Whether a text is meant as an address: `//` after a scheme stands in no sensible name of a folder."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]*://", text) is not None


def checked_url(text: str) -> str:
    """An address of a database as it is used from now on. Raises `StudyError` for any other."""
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError:
        parts, port = SplitResult("", "", "", "", ""), None
    if parts.scheme not in SCHEMES:
        shown = f"{parts.scheme}://" if parts.scheme else "the address"
        raise StudyError(f"{shown} is no database that the lab can use; name a folder, or {EXAMPLE}")
    if not parts.path.strip("/"):
        raise StudyError(f"{without_password(text)}: names no database; say {EXAMPLE}")
    if port == 0:
        raise StudyError(f"{without_password(text)}: port 0 is no port of a database server")
    return parts._replace(scheme=SCHEMES[0]).geturl()


def without_password(url: str) -> str:
    """An address to be shown: `***` stands for whatever is secret in it."""
    try:
        parts = urlsplit(url)
        pairs = parse_qsl(parts.query, keep_blank_values=True)
    except ValueError:
        return f"{SCHEMES[0]}://{HIDDEN}"
    who, at, where = parts.netloc.rpartition("@")
    name, colon, _ = who.partition(":")
    shown = [(key, HIDDEN if "password" in key.lower() else value) for key, value in pairs]
    netloc = f"{name}{colon}{HIDDEN if colon else ''}{at}{where}"
    return parts._replace(netloc=netloc, query=urlencode(shown, safe="/*,:")).geturl()
