"""A curve that climbs is found, and one of two processes is no curve."""

from __future__ import annotations

import pytest

from tests.soak.memory import Sample, drawn, flatness

MB = 2**20


def climbing(by_mb_per_s: float) -> list[Sample]:
    return [Sample(float(at_s), int((100 + by_mb_per_s * at_s) * MB), 7) for at_s in range(0, 600, 5)]


def test_a_flat_curve_is_flat_and_a_climbing_one_is_not() -> None:
    assert flatness(climbing(0.0), 100, 500).is_flat
    assert flatness(climbing(0.01), 100, 500).is_flat
    climbs = flatness(climbing(0.05), 100, 500)
    assert not climbs.is_flat
    assert climbs.mean_bytes == pytest.approx(115 * MB) and climbs.above == pytest.approx(10 / 115, rel=0.01)


def test_what_came_before_it_was_warm_does_not_count() -> None:
    samples = [Sample(0.0, 10 * MB, 7), *climbing(0.0)[20:]]
    assert flatness(samples, 100, 500).is_flat
    assert not flatness(samples, 0, 500).is_flat


def test_two_processes_are_no_curve() -> None:
    with pytest.raises(ValueError, match="2 processes"):
        flatness([Sample(0.0, MB, 7), Sample(5.0, MB, 8)], 0, 10)


def test_the_curve_is_drawn_a_line_a_stretch() -> None:
    lines = drawn(climbing(0.1), 60.0)
    assert len(lines) == 10
    assert lines[0].startswith("    0.0 min   100.0 MB  #") and lines[-1].count("#") > lines[0].count("#")
