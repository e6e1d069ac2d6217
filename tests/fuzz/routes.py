"""Routes: requests that the API's document allows or does not, and addresses, headers and bodies of any kind."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from random import Random
from typing import Any

from app.web.dashboard_frames import COOKIE
from tests.fuzz.api_cases import Asked, answered, operations, problem_of, tried
from tests.fuzz.in_process import TOKEN, InProcessLab
from tests.fuzz.mutations import NASTY_TEXTS, mutated, mutated_json, spelled_json
from tests.fuzz.surface import Surface

PATHS = (
    *("/", "/dashboard", "/join", "/join?PROLIFIC_PID=5f3", "/p/TOKEN", "/d/TOKEN", "/s/ID/", "/s/ID/panel/"),
    *("/s/ID/scene/", "/s/ID/why", "/s/ID/panel/why", "/s/ID/second-device.svg", "/favicon.ico", "/docs"),
    *("/openapi.json", "/static/base.css", "/static/../app/config.py", "/static/participant/main.js"),
    *("/dashboard/report/", "/dashboard/report/figures/x.svg", "/dashboard/scene/P001/", "/join/offer?a=b"),
)
METHODS = ("GET", "GET", "POST", "HEAD", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "", "get")
BODIES: tuple[Any, ...] = (
    *({"kind": "pilot", "count": 2}, {"reason": "why"}, {"verdict": "good", "reason": "why"}, {"text": "note"}),
    *({"confirm": "P001"}, {"link": "http://127.0.0.1/p/x"}, {"parameters": {"PROLIFIC_PID": "5f3"}}, {}),
    {
        "position_m": [0.7, 0.0, 0.9],
        "momentum": [0.0, 0.0, 0.0],
        "goals_m": [[0.8, 0.1, 0.85], [0.8, -0.1, 0.85]],
        "belief": [0.5, 0.5],
        "user_action": [1, 0, 0],
    },
)


class Routes(Surface):
    """Everything that is asked over HTTP."""

    name = "routes"

    def __init__(self, lab: InProcessLab) -> None:
        self._lab = lab
        self._tried: dict[str, str] = {}
        self._link = lab.invite()["link"].rpartition("/")[2]

    def inputs(self, count: int, random: Random) -> Iterator[tuple[Any, int]]:
        """Half from the document, in turns through its operations, half of any kind."""
        known = operations(self._lab)
        each, done = max(1, count // 2 // len(known)), 0
        for operation in known.values():
            for asked, wrong in tried(self._lab, operation, each, random.randrange(2**32), "P001"):
                given = asdict(asked)
                self._tried[_key(given)] = wrong
                done += 1
                yield given, 1
        paths = [operation.path for operation in known.values()]
        for _ in range(count - done):
            yield self._any(paths, random), 1

    def _any(self, paths: list[str], random: Random) -> dict[str, Any]:
        path = random.choice((*paths, *PATHS)).replace("{participant}", random.choice(("P001", "P999", "%00", "ü")))
        path = path.replace("{trial}", random.choice(("1", "0", "9" * 30, "-1", "x"))).replace("TOKEN", self._link)
        if random.random() < 0.5:
            raw = mutated(path.encode(), random).decode("utf-8", "surrogateescape")
            path = "/" + raw.lstrip("/")[:8_000]
        if random.random() < 0.4:
            names = ("offset", "limit", "show", "search", "kind", "include_pilot", "a", "PROLIFIC_PID")
            path += (
                f"?{random.choice(names)}={random.choice(('1', '-1', '9' * 30, '%00', '%ff', '%ud800', '', '&&=='))}"
            )
        headers = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"}
        if random.random() < 0.5:
            text = random.choice(NASTY_TEXTS).encode("utf-8", "replace").decode("latin-1")
            more = ("Authorization", "Cookie", "Origin", "Salab-Who", "Content-Type", "Content-Length", "Host")
            headers[random.choice((*more, "If-None-Match", "Accept-Encoding", "Range", "X-Forwarded-Proto"))] = text
        if random.random() < 0.2:
            headers["Cookie"] = f"salab={self._link}; {COOKIE}=x; {random.choice(('=', ';;', 'salab=', 'a'))}"
        body = spelled_json(mutated_json(random.choice(BODIES), random), random).encode("utf-8", "surrogatepass")
        if random.random() < 0.2:
            body = mutated(body, random)
        return asdict(Asked(random.choice(METHODS), path, headers, body[:200_000].decode("latin-1")))

    def problem(self, given: Any) -> str:
        """A 5xx, something raised or logged as an error, an answer that the document does not know."""
        known = self._tried.pop(_key(given), None)
        if known is not None:
            return known
        asked = Asked(**given)
        return problem_of(self._lab, answered(self._lab, asked))


def _key(given: dict[str, Any]) -> str:
    return json.dumps(given, sort_keys=True)
