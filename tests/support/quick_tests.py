"""Which tests `make test-fast` runs: those that took little when they were last timed.

Neither a browser nor physics nor a lab that runs is quick, nor what `not_quick.txt` names: tests with a case that took
longer than `QUICK_S`, or whose cases together took longer than `TOGETHER_S`, written by

    python -m pytest -m "not browser and not long" --durations=0 --durations-min=0.02 > timed.txt
    python -m tests.support.quick_tests timed.txt
"""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

LIST = Path(__file__).with_name("not_quick.txt")
QUICK_S = 0.12
TOGETHER_S = 0.8
MARKS = frozenset({"slow", "long", "browser", "bullet", "mujoco"})
LABS = frozenset({"lab_server", "open_lab", "quick_lab", "start_lab"})
TIMED = re.compile(r"(?P<took_s>[\d.]+)s (?:call|setup|teardown) +(?P<test>\S+?::.*)")


def is_quick(item: pytest.Item) -> bool:
    """Whether a test that was collected belongs to `make test-fast`. Its marks have to be there."""
    marks = {mark.name for mark in item.iter_markers()}
    fixtures = set(getattr(item, "fixturenames", ()))
    return not marks & MARKS and not fixtures & LABS and function_of(item.nodeid) not in not_quick()


def function_of(node_id: str) -> str:
    """A test's id without its case."""
    return node_id.partition("[")[0]


@cache
def not_quick() -> frozenset[str]:
    """The list, as test ids without cases."""
    return frozenset(LIST.read_text(encoding="utf-8").splitlines())


def long_ones(timed: Iterable[str]) -> list[str]:
    """Tests of which a case took longer than QUICK_S, or all TOGETHER_S, from what pytest printed of durations."""
    took_s: defaultdict[str, float] = defaultdict(float)
    for line in timed:
        if found := TIMED.match(line):
            took_s[found["test"].strip()] += float(found["took_s"])
    together_s: defaultdict[str, float] = defaultdict(float)
    for test, seconds in took_s.items():
        together_s[function_of(test)] += seconds
    slow = {function_of(test) for test, seconds in took_s.items() if seconds > QUICK_S}
    return sorted(slow | {test for test, seconds in together_s.items() if seconds > TOGETHER_S})


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as printed:
        LIST.write_text("\n".join(long_ones(printed)) + "\n", encoding="utf-8")
