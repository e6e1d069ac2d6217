"""The arbiter as a function, over HTTP."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, FastAPI, HTTPException, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, Field

from app.autonomy.actions import DIRECTIONS, index_of
from app.autonomy.arbiters.goal_oriented import GoalOriented
from app.autonomy.arbiters.weighing import (
    WeighingArbiter,
    Weights,
    WeightsOfInformation,
    WeightsWithoutInformation,
    number,
)
from app.autonomy.errors import AutonomyError
from app.autonomy.evaluation import evaluate, state_of
from app.autonomy.interface import Models
from app.lab.lab import Lab
from app.limits import BucketsByAddress
from app.trial.parts import make_arbiter
from app.trial.setup import StudySetup
from app.web.access import ErrorReply, RequestBody, StrictRoute, TheLab, has_token, refusals
from app.web.guard import address_of
from app.worker.one_answer import Question
from study.parts.errors import PartError
from study.parts.shelf import Named

Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]


Vector = Annotated[tuple[Number, Number, Number], Field(description="x, y, z in the world frame")]


Axis = Literal[-1, 0, 1]


MAX_GOALS = 100
GOALS_PER_EVALUATION = 10
"""One with more goals counts for several: it takes as long."""


MAX_WEIGHT = 1e15
"""Beyond it a score has no digits left to tell two actions apart, and much beyond it none that is finite."""


Weight = Annotated[float, Field(ge=0, le=MAX_WEIGHT, allow_inf_nan=False, strict=True)]


class EvaluateRequest(RequestBody):
    """A state, a belief, an input, and either a condition or the weights.

    What is left out is as in the study this lab runs. The stickiness of the study's arbiter is not part of this.
    """

    position_m: Vector
    """The gripper, in metres in the world frame."""
    momentum: Vector
    """Direction of the movement under way: x, y, z in the world frame, all 0 at rest."""
    goals_m: Annotated[list[Vector], Field(min_length=1, max_length=MAX_GOALS)]
    """The goals, in metres in the world frame."""
    belief: Annotated[list[Number], Field(min_length=1, max_length=MAX_GOALS)] | None = None
    """Probability of each goal before this action, in the order of `goals_m`; left out, all are as likely."""
    user_action: tuple[Axis, Axis, Axis] | None = None
    """The person's input: x, y, z in the world frame, each -1, 0 or 1; left out, no input."""
    condition: Annotated[str, Field(min_length=1, max_length=100)] = "balanced"
    """Whose weights count where none are given, and who chooses: a condition of this lab's study by its id, or
    an arbiter by its name. Of one that weighs nothing, the weights are those of `goal_oriented`."""
    alpha: Weight | None = None
    """Weight of the expected information; left out, the study's, calibrated where it says so."""
    beta: Weight | None = None
    """Weight of the hindsight reward."""
    gamma: Weight | None = None
    """Weight of agreement with the person's input."""
    step_m: Annotated[float, Field(gt=0, le=1, allow_inf_nan=False, strict=True)] | None = None
    """How far the gripper goes in a tick, in metres."""
    planning_delay: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False, strict=True)] | None = None
    """Share of a tick that a new plan costs, 0 to 1."""
    transition: Literal["mix", "replan"] | None = None
    """What the arm does meanwhile: `mix` follows its earlier direction, `replan` stops."""
    rationality_per_m: Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False, strict=True)] | None = None
    """How surely a person takes the better action: per metre of way saved."""


class EvaluateReply(BaseModel):
    """What the arbiter thinks. Rows and entries follow `actions`; `chosen` is an index into it."""

    actions: list[tuple[int, int, int]]
    """The 27 directions: x, y, z in the world frame."""
    likelihood: list[list[float]]
    """Probability of each action under each goal."""
    posterior: list[float]
    """Probability of each goal after `user_action`, in the order of `goals_m`."""
    entropy: float
    """Of `posterior`, in units of log |goals|: 0 is certain, 1 knows nothing."""
    information_gain: list[float]
    """Expected information of each action, in units of log |goals|: at most 1."""
    hindsight_reward: list[float]
    """Expected approach to the goals by each action, in metres."""
    score: list[float]
    """The weighted sum by which actions are compared."""
    chosen: int
    """Index into `actions` of the one to take."""
    alpha: float
    """The weight of the information that was used."""


def evaluate_request(
    request: EvaluateRequest, setup: StudySetup, ask: Callable[[Question], int] | None = None
) -> EvaluateReply:
    """`POST /api/arbiter/evaluate` as a function; `ask` asks an arbiter that does not ship, and may block. Raises
    `AutonomyError` for values that do not fit together, and for an arbiter that gives no answer."""
    weighing, own = arbiters_of(request, setup)
    prior = None if request.belief is None else np.array(request.belief)
    goals = np.array(request.goals_m)
    result = evaluate(request.position_m, request.momentum, goals, prior, request.user_action, weighing)
    chosen = result.chosen
    if own is not None and ask is not None:
        state = state_of(request.position_m, request.momentum, request.goals_m)
        user = None if request.user_action is None else DIRECTIONS[index_of(request.user_action)]
        try:
            chosen = ask((own, weighing.models, state, tuple(result.posterior.tolist()), user))
        except PartError as error:
            raise AutonomyError(f"condition is {request.condition!r}: {error}") from None
    return EvaluateReply(
        actions=list(DIRECTIONS),
        likelihood=result.likelihood.tolist(),
        posterior=result.posterior.tolist(),
        entropy=result.entropy,
        information_gain=result.information_gain.tolist(),
        hindsight_reward=result.hindsight_reward.tolist(),
        score=result.score.tolist(),
        chosen=chosen,
        alpha=number(weighing.parameters.alpha),
    )


def arbiters_of(request: EvaluateRequest, setup: StudySetup) -> tuple[WeighingArbiter, Named | None]:
    """The arbiter whose weights count, with the request's numbers, and the one that chooses if it is somebody else's.

    Nothing of the latter runs in here.
    """
    if request.condition == "goal_oriented" and request.alpha:
        raise AutonomyError(f"alpha is {request.alpha:g}; it must be 0 or left out with condition 'goal_oriented'")
    try:
        found, models = setup.arbiter_like(request.condition)
    except PartError as error:
        raise AutonomyError(f"condition is {request.condition!r}: {error}") from None
    usual = make_arbiter(found, models) if found.code is None else None
    kind: type[WeighingArbiter] = GoalOriented
    weights: Weights = WeightsWithoutInformation()
    if isinstance(usual, WeighingArbiter):
        kind, weights = type(usual), usual.parameters
    named = request.model_dump(include={"alpha", "beta", "gamma"}, exclude_none=True)
    model = replace(
        models.transition,
        **request.model_dump(include={"step_m", "planning_delay"}, exclude_none=True),
        kind=request.transition or models.transition.kind,
    )
    asked = Models(request.rationality_per_m or models.rationality_per_m, model)
    looks = WeightsOfInformation if isinstance(weights, WeightsOfInformation) else Weights
    weighing = kind(looks(**{**asdict(weights), "stickiness": 0.0, **named}), asked)
    return weighing, None if isinstance(usual, WeighingArbiter) else found


public = APIRouter(prefix="/api", tags=["open"], route_class=StrictRoute)


class Evaluations:
    """Whose turn it is. One is computed at a time, on a thread of its own: ticks and pages do not wait for it."""

    def __init__(self, lab: Lab) -> None:
        limits = lab.config.limits
        self._lab = lab
        self._asked = BucketsByAddress(limits.evaluations_per_s, limits.evaluations_burst, limits.addresses)
        self._most = limits.evaluations_waiting
        self._waiting = 0
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="evaluate")

    async def run(self, body: EvaluateRequest, address: str | None) -> EvaluateReply:
        """Answer it, or refuse with 429. `address` None: whoever asks is not counted."""
        amount = max(1.0, len(body.goals_m) / GOALS_PER_EVALUATION)
        wait_s = 0.0 if address is None else self._asked.take(address, time.monotonic(), amount)
        if wait_s > 0:
            raise self._too_many("too many evaluations from this address", wait_s)
        if self._waiting >= self._most:
            raise self._too_many(f"{self._waiting} evaluations wait already", 1.0)
        self._waiting += 1
        try:
            lab, loop = self._lab, asyncio.get_running_loop()
            return await loop.run_in_executor(self._thread, evaluate_request, body, lab.setup, lab.one_answer)
        finally:
            self._waiting -= 1

    def _too_many(self, text: str, wait_s: float) -> HTTPException:
        self._lab.refusals.add("evaluations")
        seconds = math.ceil(wait_s)
        return HTTPException(429, f"{text}; try again in {seconds} s", headers={"Retry-After": str(seconds)})

    def close(self) -> None:
        """Give the thread back."""
        self._thread.shutdown(wait=False, cancel_futures=True)


TOO_MANY: dict[int | str, dict[str, Any]] = {
    429: {"model": ErrorReply, "description": "too many evaluations are asked for; `Retry-After` has the seconds"}
}


@public.post("/arbiter/evaluate", responses={**refusals(422), **TOO_MANY})
async def arbiter_evaluate(body: EvaluateRequest, request: Request, lab: TheLab) -> EvaluateReply:
    """Update a belief and weigh all 27 actions (paper III). Limits of the arm and stickiness are not part of this."""
    evaluations: Evaluations = request.app.state.evaluations
    try:
        return await evaluations.run(body, None if has_token(request) else address_of(request.scope))
    except AutonomyError as error:
        problem = {"type": "value_error", "loc": ("body", str(error).split()[0]), "msg": str(error)[:300]}
        raise RequestValidationError([problem]) from None


def add_arbiter_api(app: FastAPI, lab: Lab) -> None:
    """Put all routes of this file into an app whose `state.lab` is the lab."""
    app.state.evaluations = Evaluations(lab)
    app.include_router(public)
