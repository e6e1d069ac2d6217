"""The clock of a session: even, never back, and it tells once that the computer's own was set."""

from __future__ import annotations

from app.clock import JUMP_S, SteadyClock


class Computer:
    """Its two clocks: the one that can be set, and the one that cannot."""

    def __init__(self) -> None:
        self.wall_unix_s, self.monotonic_s = 1000.0, 5.0

    def passes(self, seconds: float) -> None:
        self.wall_unix_s += seconds
        self.monotonic_s += seconds

    def clock(self, not_before_unix_s: float = 0.0) -> SteadyClock:
        return SteadyClock(lambda: self.wall_unix_s, lambda: self.monotonic_s, not_before_unix_s)


def test_it_is_the_computers_time_as_long_as_nobody_sets_that() -> None:
    computer = Computer()
    clock = computer.clock()
    computer.passes(12.5)
    assert (clock.now_unix_s(), clock.jump_s()) == (1012.5, None)


def test_a_clock_that_is_set_moves_nothing_and_is_told_once_each_time() -> None:
    computer = Computer()
    clock = computer.clock()
    for by_s in (-3600.0, 7200.0, -JUMP_S, 86_400.0):
        before = clock.now_unix_s()
        computer.wall_unix_s += by_s
        assert clock.jump_s() == by_s
        assert clock.jump_s() is None
        computer.passes(1.0)
        assert clock.now_unix_s() == before + 1.0


def test_a_drift_is_no_jump_until_it_adds_up() -> None:
    computer = Computer()
    clock = computer.clock()
    told = []
    for _ in range(25):
        computer.passes(1.0)
        computer.wall_unix_s += 0.125
        told.append(clock.jump_s())
    assert [by_s for by_s in told if by_s is not None] == [1.0, 1.0, 1.0]
    assert clock.now_unix_s() == 1025.0


def test_it_does_not_begin_before_the_end_of_the_record() -> None:
    computer = Computer()
    clock = computer.clock(not_before_unix_s=5000.0)
    assert (clock.now_unix_s(), clock.jump_s(), clock.jump_s()) == (5000.0, -4000.0, None)
    assert computer.clock(not_before_unix_s=900.0).now_unix_s() == 1000.0
