"""`POST /api/arbiter/evaluate`: the paper's equations over HTTP, and what it says to numbers that are none."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from app.autonomy.transition import TransitionModel
from app.trial.setup import study_setup
from app.web.arbiter_api import EvaluateRequest, evaluate_request
from study.definition.study import parse_study
from tests.support.arbiter_cases import ArbiterCase
from tests.support.lab_server import LabServer
from tests.support.literal_reference import evaluate_literal
from tests.support.study_samples import lab_text

GOALS = [[0.80, 0.30, 0.85], [0.78, -0.10, 0.85], [0.84, 0.05, 0.90]]
STATE = {"position_m": [0.70, 0.02, 0.88], "momentum": [0.6, 0.0, -0.8], "goals_m": GOALS}


@pytest.fixture(scope="module")
def client(quick_lab: LabServer) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=quick_lab.base_url, trust_env=False, timeout=30.0) as client:
        yield client


def evaluate(client: httpx.Client, **body: Any) -> dict[str, Any]:
    response = client.post("/api/arbiter/evaluate", json={**STATE, **body})
    assert response.status_code == 200, response.text
    result: dict[str, Any] = response.json()
    return result


CASES: dict[str, dict[str, Any]] = {
    "balanced, nothing known": {"condition": "balanced", "alpha": 0.05},
    "balanced, input": {"condition": "balanced", "alpha": 0.05, "user_action": [1, 1, 0]},
    "staying on purpose": {"condition": "balanced", "alpha": 0.05, "user_action": [0, 0, 0]},
    "a prior": {"condition": "balanced", "alpha": 0.05, "belief": [0.7, 0.2, 0.1]},
    "a sure prior": {"condition": "balanced", "alpha": 0.05, "belief": [0.0, 1.0, 0.0]},
    "goal oriented": {"condition": "goal_oriented", "belief": [0.2, 0.2, 0.6], "user_action": None},
    "teleoperation": {"condition": "teleoperation", "alpha": 0.05, "user_action": [0, -1, 1]},
    "weights only": {"alpha": 0.3, "beta": 0.5, "gamma": 0.01, "user_action": [0, 0, 1]},
    "sharper": {"alpha": 0.1, "rationality_per_m": 40.0, "user_action": [1, -1, 0]},
    "the paper's": {"alpha": 0.1, "rationality_per_m": 1.0, "step_m": 0.05, "planning_delay": 0.0},
    "slow to turn": {"alpha": 0.1, "step_m": 0.02, "planning_delay": 0.8},
    "replan": {"alpha": 0.1, "transition": "replan", "planning_delay": 0.5},
    "one goal": {"alpha": 0.1, "goals_m": [GOALS[0]], "user_action": [1, 0, 0]},
    "coincident goals": {"alpha": 0.1, "goals_m": [GOALS[0], GOALS[0]], "user_action": [1, 0, 0]},
    "at rest": {"alpha": 0.1, "momentum": [0, 0, 0]},
}


@pytest.mark.parametrize("body", CASES.values(), ids=CASES.keys())
def test_it_is_the_literal_equations(client: httpx.Client, body: dict[str, Any]) -> None:
    got = evaluate(client, **body)
    asked = {**STATE, **body}
    parameters = ArbiterCase(
        condition=body.get("condition", "balanced"),
        alpha=body.get("alpha", 0.0),
        beta=body.get("beta", 1.0),
        gamma=body.get("gamma", 1e6),
        rationality_per_m=body.get("rationality_per_m", 5.0),
        transition=TransitionModel(
            body.get("transition", "mix"), body.get("step_m", 0.05), body.get("planning_delay", 0.2)
        ),
    )
    goals = asked["goals_m"]
    prior = body.get("belief") or [1 / len(goals)] * len(goals)
    literal = evaluate_literal(
        asked["position_m"], asked["momentum"], goals, prior, body.get("user_action"), parameters
    )
    assert got["actions"] == [list(action) for action in itertools.product((-1, 0, 1), repeat=3)]
    assert flat(got["likelihood"]) == pytest.approx(flat(literal.likelihood), rel=1e-9, abs=1e-12)
    for name in ("posterior", "information_gain", "hindsight_reward"):
        assert got[name] == pytest.approx(getattr(literal, name), rel=1e-9, abs=1e-12), name
    assert got["entropy"] == pytest.approx(literal.entropy, rel=1e-9, abs=1e-12)
    assert got["score"] == pytest.approx(literal.score, rel=1e-9, abs=1e-9)
    assert got["chosen"] == literal.chosen


def flat(rows: list[list[float]]) -> list[float]:
    return [value for row in rows for value in row]


def test_the_studys_alpha_is_the_default_and_told(client: httpx.Client) -> None:
    by_default = evaluate(client)
    assert by_default["alpha"] > 0
    assert evaluate(client, alpha=by_default["alpha"]) == by_default
    assert evaluate(client, condition="goal_oriented")["alpha"] == 0


def test_what_is_not_named_is_the_studys() -> None:
    text = lab_text()
    changes = {'alpha = "calibrated"': "alpha = 2.0", "rationality_per_m = 5.0": "rationality_per_m = 3.0"}
    for before, after in changes.items():
        assert before in text
        text = text.replace(before, after)
    setup = study_setup(parse_study(text))
    asked = {"position_m": (0.7, 0.0, 0.9), "momentum": (0.0, 0.0, 0.0), "goals_m": GOALS, "user_action": (1, 0, 0)}
    by_default = evaluate_request(EvaluateRequest.model_validate(asked), setup)
    assert by_default.alpha == 2.0
    same = EvaluateRequest.model_validate({**asked, "alpha": 2.0, "rationality_per_m": 3.0})
    assert evaluate_request(same, setup) == by_default
    assert evaluate_request(EvaluateRequest.model_validate({**asked, "rationality_per_m": 4.0}), setup) != by_default


BAD: list[tuple[str, dict[str, Any], str]] = [
    ("NaN", {"position_m": [math.nan, 0, 0]}, "position_m.0"),
    ("infinite", {"goals_m": [[0, math.inf, 0]]}, "goals_m.0.1"),
    ("two coordinates", {"position_m": [0, 0]}, "position_m.2"),
    ("four coordinates", {"position_m": [0, 0, 0, 0]}, "position_m"),
    ("a word", {"momentum": "fast"}, "momentum"),
    ("faster than one step", {"momentum": [1, 1, 0]}, "momentum"),
    ("no goals", {"goals_m": []}, "goals_m"),
    ("a flat goal", {"goals_m": [0, 0, 0]}, "goals_m.0"),
    ("too many goals", {"goals_m": [[0, 0, 0]] * 101}, "goals_m"),
    ("beyond arithmetic", {"goals_m": [[1e200, 0, 0]]}, "goals_m"),
    ("belief of another length", {"belief": [0.5, 0.5]}, "belief"),
    ("belief that is no distribution", {"belief": [0.5, 0.5, 0.5]}, "belief"),
    ("negative belief", {"belief": [1.5, -0.5, 0.0]}, "belief"),
    ("NaN in the belief", {"belief": [math.nan, 0.5, 0.5]}, "belief.0"),
    ("half an action", {"user_action": [0.5, 0, 0]}, "user_action.0"),
    ("no such action", {"user_action": [2, 0, 0]}, "user_action.0"),
    ("unknown condition", {"condition": "magic"}, "condition"),
    ("a weight the condition has not", {"condition": "goal_oriented", "alpha": 0.5}, "alpha"),
    ("negative weight", {"alpha": -1}, "alpha"),
    ("a number in quotes", {"position_m": ["0.7", 0, 0]}, "position_m.0"),
    ("true is no number", {"belief": [True, 0, 0]}, "belief.0"),
    ("a weight beyond arithmetic", {"alpha": 1e308}, "alpha"),
    ("infinite weight", {"gamma": math.inf}, "gamma"),
    ("no step", {"step_m": 0}, "step_m"),
    ("delay beyond the tick", {"planning_delay": 1.5}, "planning_delay"),
    ("not rational", {"rationality_per_m": 0}, "rationality_per_m"),
    ("unknown field", {"goal": 1}, "goal"),
]


@pytest.mark.parametrize(("changes", "field"), [case[1:] for case in BAD], ids=[case[0] for case in BAD])
def test_what_cannot_be_is_named(client: httpx.Client, changes: dict[str, Any], field: str) -> None:
    content = json.dumps({**STATE, **changes})
    response = client.post("/api/arbiter/evaluate", content=content, headers={"Content-Type": "application/json"})
    assert response.status_code == 422
    problems = response.json()["problems"]
    assert field in [problem["field"] for problem in problems]
    assert all(problem["message"] for problem in problems)
    assert len(response.content) < 4000  # what was sent is not sent back
    assert "NaN" not in response.text


@pytest.mark.parametrize("missing", ["position_m", "momentum", "goals_m"])
def test_what_is_missing_is_named(client: httpx.Client, missing: str) -> None:
    body = {name: value for name, value in STATE.items() if name != missing}
    response = client.post("/api/arbiter/evaluate", json=body)
    assert response.status_code == 422
    assert [problem["field"] for problem in response.json()["problems"]] == [missing]


NO_JSON = ["{", "[]", "", "[" * 50_000, '{"position_m": [' + "9" * 5000 + ", 0, 0]}"]


@pytest.mark.parametrize(("content", "status"), [*((text, 422) for text in NO_JSON), ("x" * 1_000_001, 413)])
def test_no_json_and_too_much_of_it(client: httpx.Client, content: str, status: int) -> None:
    response = client.post("/api/arbiter/evaluate", content=content, headers={"Content-Type": "application/json"})
    assert response.status_code == status
    assert len(response.content) < 1000
    if status == 422:
        assert response.json()["problems"][0]["field"] == "body"


def test_a_body_of_unknown_length_is_not_read(client: httpx.Client) -> None:
    assert client.post("/api/arbiter/evaluate", content=iter([b"{}"])).status_code == 411


def test_extremes_give_numbers_or_a_refusal(client: httpx.Client) -> None:
    for goal in ([0.70, 0.02, 0.88], [1e-300, 0, 0], [1e90, 0, 0], [-1e90, 1e90, 1e90]):
        response = client.post("/api/arbiter/evaluate", json={**STATE, "goals_m": [goal, GOALS[0]]})
        assert response.status_code == 200
        assert all(math.isfinite(value) for value in response.json()["score"])
