"""The API's document is true, and every number that comes with a request has a bound that a database can hold."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from tests.fuzz.api_cases import Asked, answered, operations, tried, wrong_with
from tests.fuzz.in_process import TOKEN, InProcessLab

pytestmark = pytest.mark.slow

EXAMPLES = 4
"""Of each operation; `make fuzz` tries many more."""
HEADERS = {"Authorization": f"Bearer {TOKEN}", "Content-Type": "application/json"}


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[InProcessLab]:
    with InProcessLab(tmp_path_factory.mktemp("openapi") / "data") as running:
        running.invite()
        yield running


def test_whatever_is_asked_the_answer_is_what_the_document_says(lab: InProcessLab) -> None:
    wrong = [
        f"{name}: {asked}\n{problem}"
        for name, operation in operations(lab).items()
        for asked, problem in tried(lab, operation, EXAMPLES, 7, "P001")
        if problem
    ]
    assert not wrong, "\n\n".join(wrong[:5])


def test_an_answer_that_the_document_does_not_know_is_found(lab: InProcessLab) -> None:
    operation = operations(lab)["GET /api/report"]
    asked = Asked("GET", "/api/report", HEADERS, "")
    truth = answered(lab, asked)
    assert wrong_with(operation.Case(), truth, asked) == ""
    assert "418" in wrong_with(operation.Case(), replace(truth, status=418), asked)
    assert "state" in wrong_with(operation.Case(), replace(truth, body=b"{}"), asked)


def whole_numbers(schema: Any, place: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every schema of a whole number within a schema, with its place."""
    if isinstance(schema, list):
        for number, part in enumerate(schema):
            yield from whole_numbers(part, f"{place}[{number}]")
    elif isinstance(schema, dict):
        if schema.get("type") == "integer" and "enum" not in schema and "const" not in schema:
            yield place, schema
        for key, part in schema.items():
            yield from whole_numbers(part, f"{place}.{key}")


def test_every_whole_number_of_a_request_and_of_a_message_has_bounds(lab: InProcessLab) -> None:
    document = lab.app.openapi()
    asked: dict[str, Any] = {}
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            asked[f"{method} {path}"] = [operation.get("parameters", []), operation.get("requestBody", {})]
    told = json.dumps(asked)
    bodies = {name: schema for name, schema in document["components"]["schemas"].items() if f"schemas/{name}" in told}
    messages = lab.lab.client_message.json_schema()
    found = list(whole_numbers([asked, bodies, messages], "request"))
    assert len(found) > 5
    unbounded = [
        place
        for place, schema in found
        if not (
            schema.get("minimum", schema.get("exclusiveMinimum", -(2**64))) >= -(2**63)
            and schema.get("maximum", schema.get("exclusiveMaximum", 2**64)) < 2**63
        )
        and ".data." not in place  # what a note may hold is bounded by the reader of messages
    ]
    assert not unbounded, unbounded


@pytest.mark.parametrize("number", ["9" * 30, "-" + "9" * 30, "9" * 5_000, "0", "-1", str(2**63), "1e3", "NaN", "١"])
@pytest.mark.parametrize(
    ("method", "path"),
    [("POST", "/api/quality/P001/{}"), ("GET", "/api/quality?offset={}"), ("GET", "/api/roster?limit={}&offset={}")],
)
def test_a_number_that_no_database_holds_is_refused(lab: InProcessLab, method: str, path: str, number: str) -> None:
    from urllib.parse import quote

    body = b'{"verdict": "good", "reason": "why"}'
    answer = lab.ask(method, path.format(*[quote(number)] * 2), HEADERS, body if method == "POST" else b"")
    is_fine = number == "0" and path == "/api/quality?offset={}"
    assert (answer.status, answer.raised, lab.complaints.take()) == (200 if is_fine else 422, "", [])


@pytest.mark.parametrize(
    "body",
    [
        *(b'{"count": %s}' % number for number in (b"9" * 30, b"9" * 5_000, b"NaN", b"1e400", b"-0", b"1.5")),
        *(b'{"label": %s}' % text for text in (b'"\\ud800"', b'"\\u0000"', b'"\xff"', b"[" * 100_000)),
        *(b"\xef\xbb\xbf{}", b"\xff\xfe{\x00}\x00", b"", b"null", b"[]", b"{", b"\x00"),
    ],
)
def test_a_body_that_no_database_holds_is_refused(lab: InProcessLab, body: bytes) -> None:
    answer = lab.ask("POST", "/api/participants", HEADERS, body)
    assert answer.status in (201, 422) and (answer.raised, lab.complaints.take()) == ("", [])
    assert answer.status == 422 or body in (b'{"label": "\\u0000"}', b"\xef\xbb\xbf{}", b"\xff\xfe{\x00}\x00")


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/api/participants", b'{"kind": "pilot", "kind": "demo"}'),
        ("/join", b'{"parameters": {"a": "1", "a": "2"}}'),
        ("/api/arbiter/evaluate", b'{"condition": "\\ud800"}'),
    ],
)
def test_json_that_means_two_things_or_none_is_refused(lab: InProcessLab, path: str, body: bytes) -> None:
    answer = lab.ask("POST", path, HEADERS, body)
    assert (answer.status, json.loads(answer.body)["detail"]) == (422, "body: cannot be read as JSON")
