"""One event as one line, of text or of JSON, and nothing in it that identifies a person.

A line has time, level, logger, message and the fields that `about` gave it. An error is in it as its type, the frames
it went through (file, line, function; never the values in them) and its words, but these only where the lab or the
system wrote them: the words of any other error may quote what somebody typed.
"""

from __future__ import annotations

import ipaddress
import json
import logging
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

from app.errors import LabError
from study.records import StudyError

LogFormat = Literal["text", "json"]
Field = str | int | float | bool | None

TOLD: tuple[type[BaseException], ...] = (LabError, StudyError, OSError)
"""Errors whose words quote nobody."""
MAX_CHARACTERS = 2000
"""Of a message, or of a field."""
MAX_FRAMES = 16
"""Of an error, the innermost ones."""
MAX_CAUSES = 5
CHECKOUT = Path(__file__).resolve().parents[2]

_SECRETS = (
    (re.compile(r"(/[pd]/)[^\s/\"'?#]+"), r"\1..."),  # a link to a page
    (re.compile(r"(?i)(token=|bearer\s+|salab\w*=)[^\s;,\"'&]+"), r"\1..."),
    (re.compile(r"(?i)((?:raddr|laddr|peername)=)\([^)]*\)"), r"\1..."),
)
_MAYBE_ADDRESS = re.compile(r"(?<![\w.:])(?:\d+(?:\.\d+){3}(?!\w)|[0-9a-fA-F]*(?::[0-9a-fA-F.]*){2,7}(?![\w:]))")


def about(**fields: Field) -> dict[str, dict[str, Field]]:
    """`log.error("the worker hangs", extra=about(participant="P001"))`: the fields of a line."""
    return {"about": fields}


@dataclass(frozen=True)
class LogLine:
    """One event.

    Attributes:
        time_unix_s: when it was.
        error: an error's type, and those of its causes, innermost last.
        reason: the error's words, where they may be told.
        trace: the frames it went through as `file:line function`, innermost last.
    """

    time_unix_s: float
    level: str
    logger: str
    message: str
    fields: Mapping[str, Field] = field(default_factory=dict)
    error: tuple[str, ...] = ()
    reason: str = ""
    trace: tuple[str, ...] = ()

    def repeated(self, times: int, within_s: float) -> LogLine:
        """The same, standing for so many."""
        return replace(self, fields={**self.fields, "repeated": times, "within_s": round(within_s, 1)})

    def items(self) -> Iterator[tuple[str, Any]]:
        """What stands behind the message."""
        yield from self.fields.items()
        if self.error:
            yield "error", " < ".join(self.error)
        if self.reason:
            yield "reason", self.reason
        if self.trace:
            yield "trace", " > ".join(self.trace)


def line_of(record: logging.LogRecord) -> LogLine:
    """What a record of `logging` says."""
    fields: Mapping[str, Field] = getattr(record, "about", {})
    error = record.exc_info[1] if record.exc_info else None
    return LogLine(
        time_unix_s=record.created,
        level=record.levelname,
        logger=record.name,
        message=cleaned(_message(record)),
        fields={name: cleaned(value) if isinstance(value, str) else value for name, value in fields.items()},
        error=tuple(type(one).__name__ for one in causes(error)),
        reason=cleaned("; ".join(str(one) for one in causes(error) if isinstance(one, TOLD))),
        trace=tuple(frames(error)) if error is not None else (),
    )


def key_of(record: logging.LogRecord) -> tuple[object, ...]:
    """What two records share that say the same: numbers in them may differ."""
    fields: Mapping[str, Field] = getattr(record, "about", {})
    error = record.exc_info[1] if record.exc_info else None
    place = None
    if error is not None and error.__traceback__ is not None:
        last = _innermost(error.__traceback__)
        place = (last.tb_frame.f_code.co_filename, last.tb_lineno)
    named = tuple(item for item in fields.items() if isinstance(item[1], str))
    return (record.name, record.levelno, str(record.msg), type(error).__name__, place, named)


def as_text(line: LogLine) -> str:
    """`2026-01-31T09:00:00.000Z ERROR app.session.session: a piece of work failed participant=P001 ...`"""
    head = f"{_utc(line.time_unix_s)} {line.level} {line.logger}: {line.message}"
    return " ".join([head, *(f"{name}={_quoted(value)}" for name, value in line.items())])


def as_json(line: LogLine) -> str:
    """One object on one line, ASCII throughout. The fields stand beside `time`, `level`, `logger` and `message`."""
    head = {"time": _utc(line.time_unix_s), "level": line.level, "logger": line.logger, "message": line.message}
    return json.dumps({**head, **dict(line.items()), **head})


FORMATS: Mapping[LogFormat, Callable[[LogLine], str]] = {"text": as_text, "json": as_json}


def cleaned(text: str) -> str:
    """A text for the log: one line of printable characters, no token and no address in it."""
    text = text[: MAX_CHARACTERS * 2]
    for pattern, instead in _SECRETS:
        text = pattern.sub(instead, text)
    text = _MAYBE_ADDRESS.sub(_unless_address, text)
    text = " | ".join(part.strip() for part in text.splitlines() if part.strip())
    text = "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text)
    return text if len(text) <= MAX_CHARACTERS else text[: MAX_CHARACTERS - 1] + "…"


def _unless_address(found: re.Match[str]) -> str:
    try:
        ipaddress.ip_address(found[0])
    except ValueError:
        return found[0]  # a time of day, a version
    return "(address)"


def causes(error: BaseException | None) -> Iterator[BaseException]:
    """An error and what led to it, the last first."""
    seen: list[BaseException] = []
    while error is not None and error not in seen and len(seen) < MAX_CAUSES:
        yield error
        seen.append(error)
        error = error.__cause__ if error.__cause__ is not None or error.__suppress_context__ else error.__context__


def frames(error: BaseException) -> list[str]:
    """Where an error went through, innermost last; of ours from the checkout on, of others the file's name."""
    found = []
    place: TracebackType | None = error.__traceback__
    while place is not None:
        code = place.tb_frame.f_code
        found.append(f"{_file(code.co_filename)}:{place.tb_lineno} {code.co_name}")
        place = place.tb_next
    return found[-MAX_FRAMES:]


def _innermost(place: TracebackType) -> TracebackType:
    while place.tb_next is not None:
        place = place.tb_next
    return place


def _file(name: str) -> str:
    path = Path(name)
    if path.is_relative_to(CHECKOUT) and not path.is_relative_to(sys.prefix):
        return path.relative_to(CHECKOUT).as_posix()
    return path.name


def _message(record: logging.LogRecord) -> str:
    try:
        return record.getMessage()
    except Exception:  # a message whose values do not fit it: it is still an event
        return str(record.msg)


def _utc(unix_s: float) -> str:
    moment = datetime.fromtimestamp(unix_s, timezone.utc)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _quoted(value: Field) -> str:
    text = str(value)
    return text if re.fullmatch(r"[^\s\"=]+", text) else json.dumps(text, ensure_ascii=False)
