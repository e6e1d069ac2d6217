"""What `make fuzz` once found is tried again; and each surface is tried a little, so that the tool itself is known to
work."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

from tests.fuzz.files import Files
from tests.fuzz.in_process import InProcessLab
from tests.fuzz.kept_cases import Kept, keep, kept
from tests.fuzz.routes import Routes
from tests.fuzz.sockets import Sockets
from tests.fuzz.surface import Surface

Made = Callable[[Path, contextlib.ExitStack], Surface]
SURFACES: dict[str, tuple[int, Made]] = {
    "files": (60, lambda folder, _: Files(folder)),
    "sockets": (400, lambda folder, stack: Sockets(stack.enter_context(InProcessLab(folder / "data")))),
    "routes": (100, lambda folder, stack: Routes(stack.enter_context(InProcessLab(folder / "data")))),
}
"""How many inputs of each are tried, and how it is made."""


@pytest.mark.parametrize("name", SURFACES)
def test_what_once_went_wrong_and_a_few_more_do_no_harm(name: str, tmp_path: Path) -> None:
    count, make = SURFACES[name]
    with contextlib.ExitStack() as stack:
        surface = make(tmp_path, stack)
        wrong = [f"{file}: {why}" for file, case in kept(name) if (why := surface.problem(case.input))]
        wrong += [
            f"{given}: {why}" for given, _ in surface.inputs(count, Random(11)) if (why := surface.problem(given))
        ]
    assert not wrong, "\n\n".join(wrong[:3])


def test_a_case_is_kept_and_read_again(tmp_path: Path) -> None:
    given: Any = {"frames": [{"text": '{"a": "\\ud800"}'}]}
    file = keep(Kept("sockets", given, "a traceback"), tmp_path)
    assert keep(Kept("sockets", given, "the same"), tmp_path) == file
    assert list(kept("sockets", tmp_path)) == [(file.stem, Kept("sockets", given, "a traceback"))]
    assert list(kept("files", tmp_path)) == []


def test_a_file_that_raises_or_hangs_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = Files(tmp_path)
    given = next(files.inputs(1, Random(1)))[0] | {"kind": "study"}

    def broken(_: Path) -> None:
        raise KeyError("broken")

    monkeypatch.setattr("tests.fuzz.files.open_study", broken)
    assert "KeyError: 'broken'" in files.problem(given)
    monkeypatch.setattr("tests.fuzz.files.WITHIN_S", 1)

    def endless(_: Path) -> None:
        while True:
            pass

    monkeypatch.setattr("tests.fuzz.files.open_study", endless)
    assert "took more than 1 s" in files.problem(given)
