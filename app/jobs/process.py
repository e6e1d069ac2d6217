"""A job in a process of its own, from the lab's side (`app.jobs.work` is the other)."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from app.errors import LabError

ROOT = Path(__file__).resolve().parents[2]
MOST_LINE_BYTES = 1 << 20


class JobLost(LabError):
    """The job's process ended without a word: it was killed, or broke."""


async def run_job(
    module: str,
    arguments: Sequence[str],
    told: Callable[[dict[str, Any]], None],
    environment: Mapping[str, str] = MappingProxyType({}),
) -> dict[str, Any]:
    """Run `python -m MODULE ARGUMENTS` and return what it says at the end, `made` or `cannot`; `told` gets its steps.
    What others must not see is in its `environment`.

    Returns and raises when the process is gone and not before: until then another one could not be told from it. To
    cancel is to end it. Raises `JobLost`.
    """
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", module, *arguments),
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", **environment},
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        limit=MOST_LINE_BYTES,
    )
    assert process.stdout is not None
    end: dict[str, Any] | None = None
    try:
        async for line in process.stdout:
            said = json.loads(line)
            if "made" in said or "cannot" in said:
                end = said
            else:
                told(said)
        code = await process.wait()
    except BaseException:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()
        raise
    if end is None:
        raise JobLost(f"process ended with {code}; the lab's console says why")
    return end
