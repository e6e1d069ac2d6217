"""Strangers in a process of their own, so that they cost the lab and not whoever looks on.

`python -m tests.faults.strangers ADDRESS SECONDS` asks for pages and for what the arbiter would do, forty at a time, as
fast as they are answered, and prints how often each status came, as JSON.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import time

import httpx

STRANGERS = 40
PAGES = ("/", "/join", "/p/no-such-link")
ANSWERED_WITHIN_S = 20.0
QUESTION = {
    "condition": "balanced",
    "position_m": [0.7, 0.0, 0.88],
    "momentum": [0.0, 0.0, 0.0],
    "goals_m": [[0.8, 0.3, 0.85], [0.8, -0.3, 0.85]],
}


async def flood(address: str, for_s: float) -> dict[int, int]:
    """How often each status was answered."""
    answered: dict[int, int] = {}
    ends_s = time.monotonic() + for_s

    async def ask(number: int) -> None:
        url = f"http://{address}"
        async with httpx.AsyncClient(trust_env=False, timeout=ANSWERED_WITHIN_S, base_url=url) as client:
            while time.monotonic() < ends_s:
                with contextlib.suppress(httpx.HTTPError):
                    if number % 4:
                        answer = await client.get(PAGES[number % len(PAGES)])
                    else:
                        answer = await client.post("/api/arbiter/evaluate", json=QUESTION)
                    answered[answer.status_code] = answered.get(answer.status_code, 0) + 1

    await asyncio.gather(*(ask(number) for number in range(STRANGERS)))
    return answered


if __name__ == "__main__":
    print(json.dumps(asyncio.run(flood(sys.argv[1], float(sys.argv[2])))))
