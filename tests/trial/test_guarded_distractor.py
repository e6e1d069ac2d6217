"""Whatever a distractor does when it is asked becomes a fault that names it, and takes no longer than it may."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest

from app.trial.guarded_distractor import GuardedDistractor
from app.trial.parts import make_distractor
from app.trial.reasoning import PartFault
from app.worker.time_limit import TimeLimit
from study.definition.sections import DistractorSettings
from study.flow.distractors.interface import Stimulus


def leave(*given: object) -> Any:
    raise SystemExit(3)


def think(*given: object) -> Any:
    time.sleep(30.0)


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (leave, "raised SystemExit: 3"),
        (think, "took longer than 100 ms"),
        (lambda *given: None, "raised TypeError: stimulus 1 is of type NoneType; it must be a Stimulus"),
        (lambda *given: Stimulus("a\ud800"), "raised ValueError: stimulus 1 has a text that cannot be shown"),
    ],
)
def test_what_it_does_wrong_is_a_fault(
    answer: Callable[..., Any], reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    inner = make_distractor(DistractorSettings())
    monkeypatch.setattr(inner, "stimulus", answer)
    with pytest.raises(PartFault) as caught:
        GuardedDistractor(inner, TimeLimit).stimulus(1, 1, 1)
    assert str(caught.value) == f"distractor 'readings' {reason}"


def test_what_it_does_right_goes_through() -> None:
    inner = make_distractor(DistractorSettings())
    guarded = GuardedDistractor(inner, TimeLimit)
    shown = guarded.stimulus(1, 1, 1)
    assert shown == inner.stimulus(1, 1, 1)
    assert (guarded.due_s(2), guarded.deadline_s(2)) == (inner.due_s(2), inner.deadline_s(2))
    assert guarded.is_right(guarded.right_answer([shown]), [shown])
    assert guarded.words == inner.words
