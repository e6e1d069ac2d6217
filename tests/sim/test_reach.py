"""What is said to be certainly within reach is within reach, and that is most of what there is."""

from __future__ import annotations

import numpy as np

from sim import ik
from sim.interface import Vector3
from sim.open_ways import has_margin
from sim.reach import WORKSPACE_HIGH_M, WORKSPACE_LOW_M, Place, is_sure_around, is_sure_way, is_surely_within


def places(count: int, seed: int, beyond_m: float = 0.03) -> list[Vector3]:
    low, high = np.array(WORKSPACE_LOW_M) - beyond_m, np.array(WORKSPACE_HIGH_M) + beyond_m
    return [(x_m, y_m, z_m) for x_m, y_m, z_m in np.random.default_rng(seed).uniform(low, high, (count, 3)).tolist()]


def test_what_is_sure_is_within_reach_and_little_within_reach_is_unsure() -> None:
    points = places(40_000, 1)
    within = [not ik.solve(point)[1] for point in points]
    sure = [is_sure_around(point, 0.0) for point in points]
    assert not any(is_sure and not is_within for is_sure, is_within in zip(sure, within, strict=True))
    assert sum(sure) > 0.95 * sum(within)


def test_what_is_surely_beyond_reach_is_beyond_it_and_little_is_left_to_tell() -> None:
    points = places(40_000, 6)
    told = [is_surely_within(point) for point in points]
    within = ik.within_reach(np.array(points)).tolist()
    assert all(one in (None, other) for one, other in zip(told, within, strict=True))
    assert told.count(None) < 0.03 * len(points)
    assert told.count(False) > 1_000


def test_a_margin_is_what_the_places_around_say() -> None:
    margin_m, told = 0.03, []
    for place in places(4_000, 7, beyond_m=0.0):
        beside = np.array(place) + margin_m * np.vstack((np.eye(3), -np.eye(3)))
        told.append(bool(ik.within_reach(beside).all()))
        assert has_margin(place, margin_m) == told[-1]
    assert 0.2 < np.mean(told) < 0.9


def test_what_is_sure_around_a_place_is_within_reach_all_around() -> None:
    rng = np.random.default_rng(2)
    radius_m, found = 0.05, 0
    for place in places(4_000, 3):
        if is_sure_around(place, radius_m):
            found += 1
            ways = rng.standard_normal((20, 3))
            edge = np.array(place) + radius_m * ways / np.linalg.norm(ways, axis=1, keepdims=True)
            assert ik.within_reach(edge).all()
    assert found > 500


def test_a_sure_way_is_within_reach_all_along() -> None:
    shares = np.linspace(0.0, 1.0, 60)[:, None]
    found = open_ = 0
    for start, end in zip(places(3_000, 4), places(3_000, 5), strict=True):
        along = np.array(start) + shares * (np.array(end) - np.array(start))
        is_within = bool(ik.within_reach(along).all())
        open_ += is_within
        if is_sure_way(Place(start), Place(end)):
            found += 1
            assert is_within
    assert found > 0.4 * open_


def test_the_very_edge_of_the_box_is_told_as_it_is_worked_out() -> None:
    for x_m in (WORKSPACE_HIGH_M[0] + add_m for add_m in (-1e-9, 0.0, 0.5e-9, 0.9e-9, 1.1e-9, 1e-6)):
        place = (x_m, 0.2, 0.9)
        assert not is_sure_around(place, 0.0) or not ik.solve(place)[1]
        assert is_surely_within(place) in (None, not ik.solve(place)[1])
    assert is_sure_around((WORKSPACE_HIGH_M[0], 0.1, 0.9), 0.0)
