"""The rule by which the shipped study's open values were chosen: `rule.toml`, its hash, and what it says of a run."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from app.replication.formats import columns
from app.simulated.variants import fitted
from app.trial.setup import StudySetup

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

RULE_FILE = Path(__file__).with_name("rule.toml")
Use = Literal["choosing", "testing", "neither"]


@dataclass(frozen=True)
class OpenValue:
    """One value the paper leaves open: where it stands in a study file, what fixes it, and how."""

    name: str
    section: str
    key: str
    fixed_by: str
    how: str


@dataclass(frozen=True)
class Rule:
    """What `rule.toml` says, and its SHA-256 over the file's bytes."""

    sha256: str
    equations: str
    blind: str
    procedure: tuple[str, ...]
    anchor_tolerance: float
    window_tolerance: float
    misses: tuple[str, ...]
    then: str
    choosing: tuple[int, ...]
    testing: tuple[int, ...]
    open: tuple[OpenValue, ...]
    aims: dict[str, float]

    def use_of(self, seed: int) -> Use:
        """What a seed is for."""
        if seed in self.testing:
            return "testing"
        return "choosing" if seed in self.choosing else "neither"


@lru_cache(maxsize=1)
def rule() -> Rule:
    """The rule that ships."""
    text = RULE_FILE.read_bytes()
    data = tomllib.loads(text.decode("utf-8"))
    return Rule(
        sha256=hashlib.sha256(text).hexdigest(),
        equations=data["equations"],
        blind=data["blind"],
        procedure=tuple(data["procedure"]),
        anchor_tolerance=data["tolerance"]["anchors"],
        window_tolerance=data["tolerance"]["windows"],
        misses=tuple(data["misses"]["what"]),
        then=data["misses"]["then"],
        choosing=tuple(data["seeds"]["choosing"]),
        testing=tuple(data["seeds"]["testing"]),
        open=tuple(OpenValue(**item) for item in data["open"]),
        aims=dict(data["aims"]),
    )


def value_of(item: OpenValue, setup: StudySetup) -> str:
    """What a study has for an open value; alpha as it was calibrated."""
    study = setup.study
    if item.section == "conditions":
        return "" if setup.calibration is None else f"{setup.calibration.alpha:.4g} (calibrated)"
    of: Any = getattr(study, item.section) if item.section else study
    value = getattr(of, item.key)
    return f"{value:g}" if isinstance(value, float) else str(value)


def table(setup: StudySetup) -> str:
    """Every open value of a study, and what fixes it."""
    rows = [("open value", "here", "fixed by")]
    rows += [(item.name, value_of(item, setup), item.fixed_by) for item in rule().open]
    return columns(rows)


def hash_line() -> str:
    """The hash as it is printed."""
    return f"rule of choice (app/replication/{RULE_FILE.name}): SHA-256 {rule().sha256}"


def seed_sentence(seed: int) -> str:
    """What the rule says of a run's seed."""
    told = {
        "testing": "is reserved for testing: no value was chosen with it",
        "choosing": "was used while values were chosen, so that these studies are not unseen",
        "neither": "is neither one used while choosing nor one reserved for testing",
    }
    return f"Seed {seed} {told[rule().use_of(seed)]}."


def fitted_sentence() -> str:
    """Whether the simulated people that ship were fitted under this rule."""
    noted = fitted()["found"].get("rule")
    if noted == rule().sha256:
        return "The fitted values that ship were found under this rule."
    return f"The fitted values that ship were found under {'no rule' if noted is None else f'another rule ({noted})'}."
