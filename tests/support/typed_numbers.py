"""Numbers as people type them, with what they can stand for: the lab and the pages have to read alike."""

from __future__ import annotations

import sys
import unicodedata
from functools import cache

ALPHABET = "0123456789.,' -+eE\u066b\u066c\u00a0\u200f\uff15\uff0e\u0665x\u00b2"
READ: dict[str, tuple[str, ...]] = {
    "3,5": ("3.5",),
    "3.5": ("3.5",),
    "0,123": ("0.123",),
    "12,34": ("12.34",),
    "1,2345": ("1.2345",),
    ".5": ("0.5",),
    "007": ("7",),
    "+5": ("5",),
    "-5": ("-5",),
    "\N{MINUS SIGN}5": ("-5",),
    "\N{EN DASH}5": ("-5",),
    "\uff0d5": ("-5",),
    "-0": ("0",),
    "1e5": ("1e5",),
    "1.5E-3": ("1.5e-3",),
    "1,234e5": ("1.234e5",),
    "1e400": ("1e400",),
    "3.50": ("3.50",),
    "\uff18\uff19\uff17\uff0e\uff16": ("897.6",),
    "\u0664\u0668\u0662\u066b\u0661": ("482.1",),
    "\u0664\u0668\u0662\u060c\u0661": ("482.1",),
    "\u06f4\u06f8\u06f2.\u06f1": ("482.1",),
    "\u0967\u0968\u0969": ("123",),
    "\U0001d7d9\U0001d7da": ("12",),
    "\u200e482.1\u200f": ("482.1",),
    "4\u200d82.1": ("482.1",),
    "4\u00ad82.1": ("482.1",),
    "\ufeff482.1": ("482.1",),
    "4\ufe0f82.1": ("482.1",),
    "482.1\u00a0\n": ("482.1",),
    "1 234,5": ("1234.5",),
    "1\u202f234,5": ("1234.5",),
    "1'234.5": ("1234.5",),
    "1\N{RIGHT SINGLE QUOTATION MARK}234": ("1234",),
    "1,234.5": ("1234.5",),
    "1.234,5": ("1234.5",),
    "1.234.567": ("1234567",),
    "\u0661\u066c\u0662\u0663\u0664\u066b\u0665": ("1234.5",),
    "12,34,567": ("1234567",),
    "1,234": ("1.234", "1234"),
    "12.345": ("12.345", "12345"),
    **dict.fromkeys(
        [
            "",
            "  ",
            "\u200e",
            "12e",
            "1-2",
            "5.",
            "5,",
            ".",
            "-",
            "1,2,3",
            "1.2.3",
            "1 2",
            "1,23,4",
            "--5",
            "5-",
            "1e",
            "1e1.5",
            "0x10",
            "1_000",
            "nan",
            "inf",
            "Infinity",
            "NaN",
            "30 years",
            "5%",
            "\u00bd",
            "10\u00b2",
            "\u2460",
            "\u2167",
            "\u4e09",
            "1/2",
            "about 3",
            "=1+1",
            "5\0",
        ],
        (),
    ),
}


@cache
def digits() -> dict[str, str]:
    """Every decimal digit of every script that this Python knows, with its plain one."""
    every = map(chr, range(sys.maxunicode + 1))
    return {one: str(unicodedata.decimal(one)) for one in every if unicodedata.category(one) == "Nd"}
