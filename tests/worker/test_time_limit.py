"""The limit on a part's thinking: what stops what. Every part here would go on for far longer than the limit."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from app.trial.reasoning import TookTooLong
from app.worker.time_limit import DECIDE_WITHIN_S, TimeLimit, own_time_s

LIMIT_S = 0.05


def busy() -> None:
    while True:
        pass


def sleeping() -> None:
    time.sleep(20.0)


def waiting_in_pieces() -> None:
    """Each piece is shorter than the limit."""
    while True:
        time.sleep(0.01)


def catching_everything() -> None:
    while True:
        try:
            busy()
        except Exception:
            continue


def finally_going_on() -> None:
    """It tidies up for ever."""
    try:
        busy()
    finally:
        busy()


@contextlib.contextmanager
def no_timer() -> Iterator[None]:
    """As on Windows. What times the tests needs a timer itself, so this ends before they do."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("setitimer", "SIGALRM", "ITIMER_REAL"):
            patch.delattr(signal, name)
        yield


@pytest.mark.parametrize("part", [busy, waiting_in_pieces, catching_everything, finally_going_on])
def test_python_code_is_interrupted_also_where_there_is_no_timer(part: Callable[[], None]) -> None:
    before, threads = signal.getsignal(signal.SIGINT), set(threading.enumerate())
    for _ in range(3):
        with no_timer(), pytest.raises(TookTooLong), TimeLimit(LIMIT_S):
            part()
    with no_timer(), TimeLimit(5.0):
        pass
    assert signal.getsignal(signal.SIGINT) is before
    assert set(threading.enumerate()) <= threads


def test_where_there_is_no_timer_somebodys_own_interrupt_still_arrives() -> None:
    with no_timer(), pytest.raises(KeyboardInterrupt), TimeLimit(5.0):
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("part", [busy, sleeping, waiting_in_pieces, catching_everything, finally_going_on])
def test_python_code_is_interrupted(part: Callable[[], None]) -> None:
    began_s = time.monotonic()
    with pytest.raises(TookTooLong, match=r"took longer than 50 ms"), TimeLimit(LIMIT_S):
        part()
    assert time.monotonic() - began_s < 15.0, "it was left to sleep"


def test_one_that_catches_even_what_no_exception_is_does_not_get_away_with_an_answer() -> None:
    """It comes back by itself here; one that does not is ended with its worker."""
    answers = []

    def stubborn() -> None:
        try:
            busy()
        except BaseException:
            answers.append("an answer")

    with pytest.raises(TookTooLong), TimeLimit(LIMIT_S):
        stubborn()
    assert answers == ["an answer"]


def test_code_in_c_is_told_when_it_comes_back() -> None:
    with pytest.raises(TookTooLong), TimeLimit(0.01):
        sum(range(20_000_000))


def test_one_that_is_quick_is_left_alone_and_nothing_stays_behind() -> None:
    before = signal.getsignal(signal.SIGALRM)
    for _ in range(3):
        with TimeLimit(5.0):
            pass
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_what_it_raises_itself_is_not_covered_up() -> None:
    with pytest.raises(KeyError), TimeLimit(5.0):
        raise KeyError("goal")


def test_after_a_part_that_took_too_long_the_next_has_all_its_time() -> None:
    with pytest.raises(TookTooLong), TimeLimit(LIMIT_S):
        busy()
    with TimeLimit(5.0):
        began_s = own_time_s()
        while own_time_s() - began_s < 2 * LIMIT_S:
            pass


def test_no_exception_of_a_part_is_mistaken_for_it() -> None:
    assert not issubclass(TookTooLong, Exception)


def test_the_limit_is_a_fifth_of_a_tick() -> None:
    assert DECIDE_WITHIN_S == 0.1
