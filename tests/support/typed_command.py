"""Commands of `salab` as they are typed."""

from __future__ import annotations

import pytest

from app.__main__ import main


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Exit status, stdout and stderr of a command."""
    status = main(arguments)
    printed = capsys.readouterr()
    return status, printed.out, printed.err
