"""How a check fails: with one line that says what the author has to mend, and without a traceback."""

from __future__ import annotations

import functools
import linecache
from collections.abc import Callable
from typing import Any, NoReturn, TypeVar

Check = TypeVar("Check", bound=Callable[..., Any])

try:
    import pytest
except ModuleNotFoundError as missing:
    raise ModuleNotFoundError(
        "the contract suite runs under pytest, which a lab that only runs studies does not need; "
        "install it beside the lab: pip install pytest",
        name=missing.name,
    ) from None

fixture = pytest.fixture
parametrize = pytest.mark.parametrize
approx = pytest.approx
raises = pytest.raises
Failed = pytest.fail.Exception
CollectError = pytest.Collector.CollectError


def mend(what: str) -> NoReturn:
    """The check failed; `what` has to be mended."""
    pytest.fail(what, pytrace=False)


def promises(what: str) -> Callable[[Check], Check]:
    """A check whose failed assertions, and whatever the part raises, are told in one line: the promise, and where it
    was broken."""

    def of(check: Check) -> Check:
        @functools.wraps(check)
        def told(self: Any, **given: Any) -> None:
            try:
                check(self, **given)
            except (Exception, Failed) as error:
                robot = given.get("robot") or given["make_robot"]
                name = getattr(robot, "__name__", type(robot).__name__)
                mend(f"robot {name} must keep this: {what}. {_broken(error)}")

        return told  # type: ignore[return-value]

    return of


def _broken(error: BaseException) -> str:
    trace = error.__traceback__
    text = " ".join(str(error).split())
    line = ""
    while trace is not None:
        code = trace.tb_frame.f_code
        own = "_pytest" not in code.co_filename
        line = linecache.getline(code.co_filename, trace.tb_lineno).strip() if own else line
        trace = trace.tb_next
    if isinstance(error, (AssertionError, Failed)):
        return f"Broken at `{line}`" + (f": {text[:200]}" if text else "")
    return f"It raised {type(error).__name__}: {text[:200]}, at `{line}`"
