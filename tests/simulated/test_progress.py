"""Progress: one line that is rewritten where somebody watches, a line now and then where nobody does."""

from __future__ import annotations

import io
import re
import threading
import time

import pytest

from app.simulated.progress import QUIET_EVERY_S, progress

STARTED_S = 1000.0


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    def __init__(self) -> None:
        self.now_s = STARTED_S

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(time, "time", made)
    monkeypatch.setattr("tqdm.std.time", made)
    return made


def test_a_terminal_has_one_line_with_the_time_left(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    threads = threading.active_count()
    with progress("participants", total=12, done=4) as bar:
        assert "participants: 4/12 |" in screen.getvalue()
        for _ in range(2):
            clock.now_s += 10.0
            bar.update()
        assert threading.active_count() == threads
    said = screen.getvalue()
    assert said.count("\n") == 1 and said.endswith("\n")
    last = said.strip().rsplit("\r", 1)[-1]
    assert re.fullmatch(r"participants: 6/12 \|#+ +\| 00:20, about 01:00 left", last)  # by the two of now alone


def test_where_nobody_watches_a_line_comes_now_and_then_and_one_at_the_end(
    clock: Clock, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress("studies", total=100, done=50) as bar:
        for _ in range(50):
            clock.now_s += QUIET_EVERY_S / 8
            bar.update()
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "\r" not in printed.err
    lines = printed.err.splitlines()
    assert [line.split()[1] for line in lines] == [*(f"{count}/100" for count in range(58, 100, 8)), "100/100"]
    assert lines[0].endswith("| 00:20, about 01:45 left")


@pytest.mark.parametrize(("done", "steps", "lines"), [(0, 3, 1), (3, 0, 0), (0, 1, 1)])
def test_a_short_run_says_one_line_and_nothing_done_none(
    done: int, steps: int, lines: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with progress("participants", total=3, done=done) as bar:
        for _ in range(steps):
            bar.update()
    said = capsys.readouterr().err
    assert said.count("\n") == lines
    assert not lines or said.startswith(f"participants: {steps}/3 |")


def test_what_is_interrupted_says_how_far_it_came(capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted() -> None:
        with progress("studies", total=9) as bar:
            bar.update(5)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert capsys.readouterr().err.startswith("studies: 5/9 |")
