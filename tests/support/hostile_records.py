"""What nobody should find in a record, and may: data of events, times and cells that cannot be what they stand for."""

from __future__ import annotations

HOSTILE_DATA: tuple[str, ...] = (
    "",
    "null",
    "[]",
    '"text"',
    "3",
    "{}" + "}" * 3,
    '{"ms": ',
    '{"ms": null, "by_s": null, "sound": null, "phase": null, "role": null}',
    '{"ms": "9", "by_s": "9", "sound": "xyz", "phase": 1, "role": 7}',
    '{"ms": [], "by_s": {}, "sound": [], "phase": [], "role": {}}',
    '{"ms": NaN, "by_s": NaN, "sound": NaN, "phase": NaN}',
    '{"ms": Infinity, "by_s": -Infinity, "sound": 1, "phase": "x"}',
    '{"ms": 1e999, "by_s": 1e999, "sound": 1e999, "phase": 1e999}',
    '{"ms": -1, "by_s": 1e300, "sound": 2, "phase": "over"}',
    '{"ms": ' + "9" * 400 + ', "by_s": ' + "9" * 400 + ', "sound": 0, "phase": ""}',
    '{"ms": ' + "9" * 5000 + "}",
    "[" * 100_000,
    '{"words": {"a": 1}, "characters": "many", "by": ["AB"], "text": {"b": 2}}',
    '{"ms": {}, "words": "note-1", "role": "participant"}',
    '{"\\ud800": "\\udfff"}',
)
"""None of them is what any event of the lab says that says something."""
HOSTILE_TIMES: tuple[str, ...] = ("", "yesterday", "2026-13-45T99:99:99Z", "9" * 40, "2026-01-01", "-1")
"""Times of day that are none, and one without its time."""
