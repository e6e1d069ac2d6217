"""When a step holds, what gives way first, and what the verdict is: values in, words out."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.sizing import text
from app.sizing.rule import (
    FILES_OF_LAB,
    FILES_PER_SESSION,
    Bottleneck,
    Room,
    Step,
    Verdict,
    bottleneck,
    capacity,
    verdict,
    why_it_breaks,
    why_not,
)

ROOM = Room(cores=4, lab_cores=4, open_files=10_000)
GOOD = Step(
    sessions=8,
    arrived=8,
    seconds=30.0,
    ticks=480,
    late_p50_ms=0.8,
    late_p99_ms=6.0,
    late_most_ms=14.0,
    late=0,
    missed=0,
    held=0,
    web_cores=0.2,
    worker_cores=0.5,
    people_cores=0.3,
    busiest_people_cores=0.3,
    others_cores=0.1,
    commit_p50_ms=6.0,
    commit_p99_ms=20.0,
    store_queue=1,
    session_queue=1,
    outgoing_queue=0,
    web_mb=150.0,
    workers_mb=400.0,
    resident_mb=1_200.0,
    free_mb=4_000.0,
    scene_kb_s=7.0,
)


def of(sessions: int, **changes: float) -> Step:
    """A good step with so many people, and what is otherwise."""
    driven = {"sessions": sessions, "arrived": sessions, "ticks": 60 * sessions, "workers_mb": 50.0 * sessions}
    made: Step = replace(GOOD, **{**driven, **changes})  # type: ignore[arg-type]
    return made


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, ""),
        ({"late": 4}, ""),  # of 480
        ({"late": 5}, "1.0 % of the ticks began more than 50 ms late or were left out; 1 % may"),
        ({"missed": 6}, "1.2 % of the ticks"),
        ({"ticks": 0}, "100.0 % of the ticks"),
        ({"ticks": 20, "seconds": 1.0, "late": 2}, ""),  # chance, with so few
        ({"ticks": 20, "seconds": 1.0, "late": 3}, "15.0 % of the ticks"),
        ({"ticks": 200}, "robots ran for 42 % of the time; 60 % must be"),
        ({"arrived": 7}, "7 of 8 came as far as driving"),
        ({"held": 5}, "robots stood still 5 times"),
        ({"held": 2}, ""),
    ],
)
def test_a_step_holds_while_nearly_no_tick_is_late(changes: dict[str, float], says: str) -> None:
    told = why_it_breaks(replace(GOOD, **changes))  # type: ignore[arg-type]
    assert told.startswith(says) and bool(told) is bool(says)


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"worker_cores": 2.9, "web_cores": 0.4}, "workers"),
        ({"worker_cores": 0.5, "web_cores": 0.9}, "web"),
        ({"worker_cores": 0.5, "people_cores": 3.0, "busiest_people_cores": 0.4}, "people"),
        ({"busiest_people_cores": 0.95}, "people"),
        ({"free_mb": 120.0}, "memory"),
        ({"others_cores": 2.9}, "others"),
        ({"others_cores": 2.0, "worker_cores": 2.1}, "workers"),
        ({"commit_p99_ms": 800.0}, "writer"),
        ({"commit_p99_ms": 800.0, "worker_cores": 3.5}, "workers"),
        ({"commit_p50_ms": 690.0, "worker_cores": 3.5}, "writer"),
        ({"commit_p50_ms": 690.0, "worker_cores": 0.7, "others_cores": 3.0}, "others"),
        ({"store_queue": 40}, "writer"),
        ({}, "unknown"),
    ],
)
def test_what_gives_way_first_is_named(changes: dict[str, float], name: Bottleneck) -> None:
    assert bottleneck(replace(GOOD, **changes), ROOM) == name  # type: ignore[arg-type]
    assert text.GIVES_WAY[name]


def test_people_on_cores_of_their_own_are_not_what_fills_the_labs() -> None:
    apart = Room(cores=4, lab_cores=1, open_files=10_000)
    step = replace(GOOD, worker_cores=0.7, web_cores=0.25, people_cores=2.5, busiest_people_cores=0.8)
    assert bottleneck(step, apart) == "workers"


def test_a_third_is_kept_in_reserve_and_one_that_holds_is_taken() -> None:
    assert [capacity(held) for held in (0, 1, 2, 3, 24, 60)] == [0, 1, 1, 2, 16, 40]


def test_the_verdict_is_the_last_step_that_held() -> None:
    steps = [of(8), of(16), of(24, late=200, worker_cores=3.5)]
    found = verdict(steps, ROOM)
    assert (found.held, found.capacity, found.bottleneck) == (16, 10, "workers")
    assert found.broke.startswith("13.9 % of the ticks")
    assert verdict([of(8), of(16)], ROOM) == Verdict(16, 10)
    assert verdict([], ROOM) == Verdict(0, 0)
    assert verdict([of(8, late=200)], ROOM).held == 0


def test_a_step_that_was_measured_again_counts_as_it_was_then() -> None:
    assert verdict([of(8), of(16, late=99), of(16), of(24)], ROOM).held == 24
    assert verdict([of(8), of(16, late=99), of(16, late=80)], ROOM).held == 8


def test_a_step_that_was_not_tried_ends_it_with_its_reason() -> None:
    full = of(24, worker_cores=3.2, web_cores=0.4)
    found = verdict([of(8), full], ROOM, "32 at once would want about 9.9 cores, and there are 4 for them")
    assert (found.held, found.bottleneck, found.broke[:10]) == (24, "workers", "32 at once")


def test_what_the_machine_has_too_little_of_is_told_before_it_is_tried() -> None:
    files = FILES_OF_LAB + 40 * FILES_PER_SESSION
    few = replace(ROOM, open_files=files)
    assert why_not(40, few) == ""
    assert why_not(41, few).startswith(
        f"41 at once want about {files + FILES_PER_SESSION} open files, and a process may"
    )
    assert why_not(16, ROOM, GOOD) == ""
    busy = replace(GOOD, worker_cores=2.5, people_cores=0.4, web_cores=0.4)
    assert why_not(16, ROOM, busy) == "16 at once would want about 6.6 cores, and there are 4 for them"
    assert why_not(16, replace(ROOM, lab_cores=1), replace(GOOD, worker_cores=0.9)).endswith("there is 1 for them")
    assert why_not(96, ROOM, GOOD).startswith("96 at once would want about 12")
    light = replace(GOOD, worker_cores=0.01, web_cores=0.01, people_cores=0.01)
    assert why_not(96, ROOM, light) == "96 at once would want 4400 MB more, and 4000 MB are free"


def test_the_table_and_the_verdict_are_lines() -> None:
    heads, row = text.HEAD.splitlines(), text.line(of(24, late=200))
    assert len(heads[1]) == len(text.line(GOOD)) and row.endswith("does not hold")
    assert all(len(line) <= 120 for line in (*heads, row))
    steps = [of(8), of(16), of(24, late=200, worker_cores=3.5)]
    told = text.told(verdict(steps, ROOM), steps, ROOM, True)
    assert told[0] == (
        "This machine holds 10 people at once, with the 3-D view open: 16 held, and 33 % of that is kept in reserve."
    )
    assert told[2].startswith("What gives way first: the processor time of the sessions' processes")
    assert told[3].startswith("Meanwhile 8 % of the processor time went to the scripted people")
    assert "No step broke" in text.told(verdict([of(8)], ROOM), [of(8)], ROOM, True)[0]
    assert "holds 1 person at once" in text.told(verdict([of(1)], ROOM), [of(1)], ROOM, True)[0]
    assert text.told(verdict([of(8, late=99)], ROOM), steps, ROOM, False)[0].startswith("This machine does not hold")
    busy = text.told(verdict([of(8)], ROOM), [of(8, others_cores=1.24)], ROOM, True)
    assert "In the last step other programs took 1.2 of 4 cores: it may hold more." in busy
    apart = text.told(verdict([of(8)], ROOM), [of(8)], Room(4, 3, 10_000), True)
    assert apart[-1] == "Measured with 3 of 4 cores for the lab; the people had the others."
