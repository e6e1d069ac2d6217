"""The event loop that the lab serves on: uvloop where uvicorn brings it (not on Windows), else asyncio's own."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Coroutine
from typing import Any


def run_on_quick_loop(work: Coroutine[Any, Any, None]) -> None:
    """As `asyncio.run`."""
    try:
        import uvloop
    except ImportError:
        asyncio.run(work)
        return
    if sys.version_info >= (3, 11):
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            runner.run(work)
    else:
        uvloop.install()
        asyncio.run(work)
