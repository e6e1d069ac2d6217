"""Between people and within: variance components of values whose parts are known."""

from __future__ import annotations

import numpy as np
import pytest

from app.replication.spread import spread, table
from app.replication.studies import Values
from study.analysis.observations import Observation


def values(between: float, within: float, people: int = 400, tasks: int = 3) -> list[Observation]:
    """Pickups of "can" at 150 and dropoffs at 100 ticks, each person shifted, each task by itself."""
    rng = np.random.default_rng(1)
    found = []
    for person in range(people):
        own = between * rng.standard_normal()
        for goal, middle in (("can", 150.0), ("left_bin", 100.0)):
            for _ in range(tasks):
                value = middle + own + within * float(rng.standard_normal())
                found.append(Observation(value, "balanced", str(person), 1, goal, 2))
    return found


@pytest.mark.parametrize(("between", "within"), [(30.0, 60.0), (50.0, 20.0)])
def test_both_parts_come_out_as_they_went_in(between: float, within: float) -> None:
    found = spread(values(between, within), {"can"})
    assert found is not None
    assert found.people == 400
    assert found.between == pytest.approx(between, rel=0.1)
    assert found.within == pytest.approx(within, rel=0.05)
    assert found.total > found.within  # pickups and dropoffs differ too


def test_people_who_differ_by_chance_alone_have_no_spread_between_them() -> None:
    same = [Observation(value, "balanced", person, 1, "can", 4) for person in "ab" for value in (10.0, 20.0)]
    found = spread(same, {"can"})
    assert found is not None
    assert (found.people, found.between) == (2, 0.0)
    assert (found.within, found.total) == pytest.approx((50.0**0.5, (100.0 / 3.0) ** 0.5))


@pytest.mark.parametrize(
    "few",
    [
        [],
        [Observation(10.0, "balanced", "a", 1, "can", 4), Observation(20.0, "balanced", "a", 1, "can", 4)],
        [Observation(10.0, "balanced", person, 1, "can", 4) for person in "ab"],
    ],
)
def test_too_few_values_say_so(few: list[Observation]) -> None:
    assert spread(few, {"can"}) is None
    told = table([Values({("efficiency_ticks", kind): tuple(few) for kind in ("pickup", "all")})])
    assert told.count("not known: too few values") == 6
    assert "nan" not in told


def test_the_larger_part_is_named_for_every_condition() -> None:
    of = tuple(values(50.0, 20.0, people=20))
    pickups = tuple(one for one in of if one.goal == "can")
    lines = table([Values({("efficiency_ticks", "pickup"): pickups, ("efficiency_ticks", "all"): of})]).splitlines()
    assert [line.split()[-1] for line in lines if line.startswith("balanced")] == ["BETWEEN", "BETWEEN"]
