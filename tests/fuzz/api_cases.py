"""Requests that the OpenAPI document allows, and such that it does not; answers held against it, by schemathesis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, cast

import httpx
import requests
import schemathesis
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from schemathesis import GenerationMode
from schemathesis.checks import CHECKS, load_all_checks
from schemathesis.core.failures import Failure, FailureGroup

from tests.fuzz.in_process import TOKEN, Answer, InProcessLab

HELD = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_schema_conformance",
    "response_headers_conformance",
)
"""What is checked of each answer. Who may ask, and what has to be refused, have tests of their own."""
MOST_INVITED = 3
"""Of one request: each of the others is one more of the same."""


@dataclass(frozen=True)
class Asked:
    """A request as it goes over the wire."""

    method: str
    path: str
    headers: dict[str, str]
    body: str
    """Bytes, each as the character of its number."""


def operations(lab: InProcessLab) -> dict[str, Any]:
    """Every operation of the lab's document, by method and path."""
    document = schemathesis.openapi.from_dict(_with_lists(lab.app.openapi()))
    found: list[Any] = [cast("Any", result).ok() for result in document.get_all_operations()]
    return {f"{operation.method.upper()} {operation.path}": operation for operation in found}


def _with_lists(schema: Any) -> Any:
    """The document with tuples of one type written as lists of a fixed length: schemathesis reads `prefixItems` as an
    older draft's `items`, and then refuses what it wrote itself."""
    if isinstance(schema, list):
        return [_with_lists(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    whole = {key: _with_lists(part) for key, part in schema.items()}
    parts = whole.pop("prefixItems", None)
    if parts is not None:
        whole["items"] = parts[0] if all(part == parts[0] for part in parts) else {"anyOf": parts}
    return whole


def asked_of(case: Any) -> Asked:
    """The request of a case."""
    if isinstance(case.body, dict) and isinstance(case.body.get("count"), int):
        case.body["count"] = min(case.body["count"], MOST_INVITED)
    prepared = requests.Request(**case.as_transport_kwargs(base_url="http://127.0.0.1")).prepare()
    body: Any = prepared.body or b""
    raw = body.encode("utf-8", "surrogatepass") if isinstance(body, str) else bytes(body)
    headers = {
        (name if isinstance(name, str) else name.decode("latin-1")): (
            value if isinstance(value, str) else value.decode("latin-1")
        )
        for name, value in prepared.headers.items()
    }
    return Asked(prepared.method or "GET", prepared.path_url, headers, raw.decode("latin-1"))


def answered(lab: InProcessLab, asked: Asked) -> Answer:
    """Ask the lab."""
    return lab.ask(asked.method, asked.path, asked.headers, asked.body.encode("latin-1"))


def problem_of(lab: InProcessLab, answer: Answer) -> str:
    """What is wrong with an answer by itself: the lab raised, or complained."""
    told = lab.complaints.take()
    if answer.raised or told:
        return answer.raised or "\n".join(told)
    return f"answered {answer.status}: {answer.body[:300]!r}" if answer.status >= 500 else ""


def wrong_with(case: Any, answer: Answer, asked: Asked) -> str:
    """What the document says otherwise; "" for nothing."""
    load_all_checks()
    response = httpx.Response(
        answer.status,
        headers=list(answer.headers),
        content=answer.body,
        request=httpx.Request(asked.method, f"http://127.0.0.1{asked.path.partition('?')[0]}"),
    )
    response.elapsed = timedelta()
    try:
        case.validate_response(response, checks=[CHECKS.get_one(name) for name in HELD])
    except FailureGroup as group:
        return "; ".join(str(failure) for failure in group.exceptions)
    except Failure as failure:
        return str(failure)
    return ""


def tried(
    lab: InProcessLab, operation: Any, examples: int, start: int, participant: str
) -> Iterator[tuple[Asked, str]]:
    """That many cases of an operation and what was wrong with the answer to each, "" for nothing."""
    known = {"participant": participant} if "{participant}" in operation.path else {}
    headers = {"Authorization": f"Bearer {TOKEN}"}
    strategies = [
        operation.as_strategy(mode, headers=headers, path_parameters=fixed)
        for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)
        for fixed in ((None, known) if known and operation.path.count("{") == 1 else (None,))
    ]
    found: list[tuple[Asked, str]] = []

    @seed(start)
    @settings(
        max_examples=examples,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=st.one_of(strategies))
    def ask(case: Any) -> None:
        asked = asked_of(case)
        answer = answered(lab, asked)
        found.append((asked, problem_of(lab, answer) or wrong_with(case, answer, asked)))

    ask()
    yield from found
