"""What `make test-fast` leaves out is there."""

from __future__ import annotations

import ast

from tests.support.lab_server import ROOT
from tests.support.quick_tests import not_quick

DEFINED = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def test_what_is_not_quick_is_there() -> None:
    found: dict[str, set[str]] = {}
    for test in sorted(not_quick()):
        file, first, *_ = test.split("::")  # a class may have a test from elsewhere
        if file not in found:
            assert (ROOT / file).is_file(), (
                f"{test}: no such file; name it as it is in tests/support/not_quick.txt, or time anew"
            )
            parsed = ast.parse((ROOT / file).read_text(encoding="utf-8"))
            found[file] = {node.name for node in parsed.body if isinstance(node, DEFINED)}
        assert first in found[file], (
            f"{test}: no such test; name it as it is in tests/support/not_quick.txt, or time anew"
        )
