"""The rule by which two robots' data count as usable for one another: `rule.toml`, and its hash."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

RULE_FILE = Path(__file__).with_name("rule.toml")


@dataclass(frozen=True)
class Rule:
    """What `rule.toml` says, and its SHA-256 over the file's bytes."""

    sha256: str
    sentences: tuple[str, ...]
    share_of_difference: float
    """Of the largest difference between two conditions: a measure's bound."""
    share_of_standard_error: float
    """Of that difference's standard error in one study: the bound where it is larger."""
    outcome: float
    """The bound of outcomes, tasks a task."""
    alpha: float
    quantile: float
    """Of the moments up to first contact, the share in which the paths are no farther apart than what follows."""
    apart_mm: float
    turned_deg: float
    same_choices: float
    """Least share of ticks in which the arbiter chooses the same."""


@lru_cache(maxsize=1)
def rule() -> Rule:
    """The rule that ships."""
    text = RULE_FILE.read_bytes()
    data = tomllib.loads(text.decode("utf-8"))
    return Rule(
        hashlib.sha256(text).hexdigest(),
        tuple(data["sentences"]),
        **data["bounds"],
        **data["tests"],
        **data["paths"],
    )


def hash_line() -> str:
    """The hash as it is printed."""
    return f"rule of equivalence (app/physics_comparison/{RULE_FILE.name}): SHA-256 {rule().sha256}"
