"""What is left to `make test-long` has an example in `make test`."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.lab_server import ROOT
from tests.support.long_cases import KEPT, ON_A_FILE, is_long


@pytest.mark.slow
def test_of_each_kind_some_stay_and_some_are_left() -> None:
    files = sorted({*ON_A_FILE, *(test.partition("::")[0] for test in KEPT)})
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", *files]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()
    for test, kept in KEPT.items():
        cases = [line for line in listed if line.startswith(f"{test}[")]
        assert any(map(is_long, cases)), f"{test}: nothing of it is left out"
        for case in kept:
            assert any(line.startswith(f"{test}[{case}") for line in cases), f"{test}: no case {case}"
    for file in ON_A_FILE:
        left_out = [line for line in listed if line.startswith(f"{file}::") and is_long(line)]
        assert left_out, f"{file}: nothing of it is left out"
        assert {line.replace("postgres", "sqlite") for line in left_out} <= set(listed), f"{file}: no example is left"
