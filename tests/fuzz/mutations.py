"""What is done to good inputs so that they are bad ones. Everything random comes from the `Random` that is given."""

from __future__ import annotations

import json
import re
from random import Random
from typing import Any

NASTY_TEXTS = (
    *("", " ", "\x00", "\ud800", "\udfff\ud800", "\u2028", "\x85", "\u202e", "\ufeff", "😀" * 50, "a" * 5_000),
    *("NaN", "null", "=1+1", "-1", "true", "1e999", "%s%n", "{n}", "{{x}}", "<script>", "\r\n", "../..", "e\u0301"),
    *("P001", "P999", "constructor", "__proto__", "file.py:Class", "C:\\con", "/dev/zero", "${HOME}", "\x1b[2J"),
    "'; DROP TABLE ticks; --",
)
NASTY_NUMBERS = (
    *(0, -1, 1, 2**31, 2**53, 2**63 - 1, 2**63, -(2**63) - 1, 10**30, 10**400, 0.1, -0.0, 1e-320, 1e308),
    *(float("nan"), float("inf"), float("-inf")),
)
NASTY_JSON: tuple[Any, ...] = (*NASTY_TEXTS, *NASTY_NUMBERS, None, True, False, [], {}, [[]], {"": {}}, [None] * 50)
NASTY_BYTES = (
    *(b"\x00", b"\xff", b"\xef\xbb\xbf", b"\xff\xfe", b"\r", b"\r\n", b"\n\n", b"\xe2\x80\xa8", b"\xc2\x85", b"\x1a"),
    *(b'"', b"'", b'"""', b"[", b"]", b"{", b"}", b"=", b"#", b",", b";", b"\\", b"\\u0000", b"-", b".", b"true"),
    *(b"[" * 300, b"{a=" * 300, b"a." * 60, b"9" * 30, b"9" * 5_000, b" " * 2_000, b"nan", b"inf", b"1979-05-27"),
    b"\xed\xa0\x80",
)
_VALUE = re.compile(rb"(?<== )[^\n#]+|(?<=,)[^,\n]*|\"[^\"\n]*\"|-?\d+(?:\.\d+)?")


def mutated(raw: bytes, random: Random) -> bytes:
    """Some bytes, or what stands in some places, changed."""
    for _ in range(random.choice((1, 1, 1, 2, 3, 8))):
        raw = random.choice((_value, _value, _byte, _insert, _cut, _twice, _line, _swap))(raw, random)
    return raw


def _value(raw: bytes, random: Random) -> bytes:
    """Another value in the place of one."""
    found = list(_VALUE.finditer(raw, *_window(raw, random)))
    if not found:
        return _insert(raw, random)
    place = random.choice(found)
    other = random.choice(found).group() if random.random() < 0.3 else _spelled(random)
    return raw[: place.start()] + other + raw[place.end() :]


def _spelled(random: Random) -> bytes:
    value = random.choice(NASTY_JSON)
    try:
        text = json.dumps(value, ensure_ascii=random.random() < 0.5)
    except ValueError:
        text = str(value)
    return text.encode("utf-8", "surrogatepass")


def _window(raw: bytes, random: Random) -> tuple[int, int]:
    start = random.randrange(len(raw) + 1)
    return start, start + 2_000


def _byte(raw: bytes, random: Random) -> bytes:
    place = random.randrange(len(raw) + 1)
    return raw[:place] + bytes([random.randrange(256)]) + raw[place + 1 :]


def _insert(raw: bytes, random: Random) -> bytes:
    place = random.randrange(len(raw) + 1)
    return raw[:place] + random.choice(NASTY_BYTES) + raw[place:]


def _cut(raw: bytes, random: Random) -> bytes:
    start = random.randrange(len(raw) + 1)
    return raw[:start] + raw[start + random.choice((1, 10, 300, len(raw))) :]


def _twice(raw: bytes, random: Random) -> bytes:
    start = random.randrange(len(raw) + 1)
    end = start + random.choice((1, 30, 1_000))
    return raw[:end] + raw[start:end] + raw[end:]


def _line(raw: bytes, random: Random) -> bytes:
    """A line gone, or in another place."""
    lines = raw.split(b"\n")
    line = lines.pop(random.randrange(len(lines)))
    if random.random() < 0.6:
        lines.insert(random.randrange(len(lines) + 1), line)
    return b"\n".join(lines)


def _swap(raw: bytes, random: Random) -> bytes:
    lines = raw.split(b"\n")
    one, other = random.randrange(len(lines)), random.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


def mutated_json(value: Any, random: Random) -> Any:
    """The same value with something in it changed, added or gone."""
    if random.random() < 0.15 or not isinstance(value, (dict, list)) or not value:
        return random.choice(NASTY_JSON)
    copy = dict(value) if isinstance(value, dict) else list(value)
    keys: list[Any] = list(value) if isinstance(value, dict) else list(range(len(value)))
    key = random.choice(keys)
    what = random.random()
    if what < 0.65:
        copy[key] = mutated_json(value[key], random)
    elif what < 0.8:
        del copy[key]
    elif isinstance(copy, dict):
        copy[random.choice(("id", "type", "data", "", "\ud800", "x" * 300, "__class__"))] = random.choice(NASTY_JSON)
    else:
        copy.append(random.choice(NASTY_JSON))
    return copy


def spelled_json(value: Any, random: Random) -> str:
    """The value as text, in one of the ways that people and programs write JSON, right and wrong."""
    try:
        text = json.dumps(value, ensure_ascii=random.random() < 0.5)
    except ValueError:  # a number of too many digits for Python to write
        text = "9" * 5_000
    what = random.random()
    if what < 0.05:
        return text[: random.randrange(len(text) + 1)]
    if what < 0.08:
        return text + random.choice((" ", "x", "\x00", text, "\ufeff"))
    if what < 0.10:
        return "[" * 3_000 + text + "]" * 3_000
    if what < 0.12:
        return text.replace(":", ":" + "9" * random.choice((30, 5_000)) + ',"a":', 1)
    if what < 0.14 and text.startswith("{") and len(text) > 2:
        return text[:-1] + "," + text[1:]  # every name twice
    return text
