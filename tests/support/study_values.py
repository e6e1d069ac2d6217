"""Made-up values of a study, for tests of what is done with many of them."""

from __future__ import annotations

import itertools

import numpy as np

from app.replication.paper import CONDITIONS_IN_ORDER, REPORTED
from app.replication.studies import SURVEYS, Key, Values
from study.analysis.observations import Observation

ORDERS = tuple(itertools.permutations(CONDITIONS_IN_ORDER))


def as_the_paper_found(rng: np.random.Generator, participants: int = 12, effect: float = 1.0) -> Values:
    """Values with the paper's means and SDs; `effect` 0 puts every condition at pure teleoperation's mean."""
    found: dict[Key, tuple[Observation, ...]] = {}
    for item in REPORTED:
        rows = []
        for person in range(participants):
            order = ORDERS[person % len(ORDERS)]
            for condition in CONDITIONS_IN_ORDER:
                base = item.means["teleoperation"]
                mean = base + effect * (item.means[condition] - base)
                single = item.measure in (*SURVEYS, "window_rate")
                for repeat in range(1 if single else 6):
                    rows.append(
                        Observation(
                            value=float(rng.normal(mean, item.sds[condition])),
                            condition=condition,
                            participant=f"S{person + 1:03d}",
                            position=order.index(condition) + 1,
                            goal="" if single else f"goal_{(person + repeat) % 4}",
                            goals=0 if single else (2, 4, 5, 6)[(person + repeat) % 4],
                        )
                    )
        found[item.measure, item.kind] = tuple(rows)
    return Values(found, {"participants": participants, "tasks": 18 * participants})
