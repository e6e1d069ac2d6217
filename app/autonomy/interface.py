"""What an arbiter and a goal inference are: the two parts of the loop that a group brings to try its own method.

In every tick in which the arm may move the lab asks, in this order,

    belief = inference.update(state, belief, user)             who wants what, given what the person just did
    action = arbiter.decide(state, belief, user, feasible)     what the arm does about it

Both are made anew at the start of every pick-and-place cycle, with the `memory` they had at the end of the one before.
So whatever a part wants to know later belongs into its memory: it is kept with the cycle, and a worker that is replaced
in mid-cycle makes the same part again and asks it the same questions, for the same rows.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Union

from app.autonomy.actions import Direction
from app.autonomy.arrays import FloatArray, check_rationality
from app.autonomy.belief import Belief
from app.autonomy.transition import TransitionModel

RATIONALITY_PER_M = 5.0
"""kappa where nothing else is said. With the paper's eq. 2 as printed, 1.0 in metres, a belief over six goals hardly
moves in a whole pickup."""

Memory = Any
"""A value of JSON: None, numbers, texts, lists and dicts of these, at most 64 kB."""

Feasible = Callable[[Direction], bool]
"""Whether the arm may take an action from here: it can do it without pushing anything over and, in a study that keeps
the way on, can go on from where that leads to. To stay may always be chosen."""

Explanation = Mapping[str, Union[float, str]]  # noqa: UP007 - evaluated at run time on 3.10 as well
"""What the dashboard shows of a decision: short names and their values."""


@dataclass(frozen=True)
class Models:
    """The models of the person and of the arm that a study reasons with, given to every arbiter and inference.

    Args:
        rationality_per_m: kappa, how sharply people are taken to choose, per metre of progress, in [0, 1e6].
        transition: T(x, u); it is also what the arm does, so a condition's robot moves as its arbiter expects.

    Raises:
        AutonomyError: a value out of bounds.
    """

    rationality_per_m: float = RATIONALITY_PER_M
    transition: TransitionModel = field(default_factory=TransitionModel)

    def __post_init__(self) -> None:
        check_rationality(self.rationality_per_m)


@dataclass(frozen=True, eq=False)
class State:
    """What is known of the world at the start of a tick. World frame, metres.

    Args:
        position_m: the gripper, (3,).
        momentum: direction executed in the last tick, (3,), length <= 1, 0 after any stop.
        goal_ids: names of the candidate goals: the objects on the table, or the bins while something is held.
        goals_m: where they are now, (G, 3), in the order of ``goal_ids``; read-only in a trial.
        held: the object in the gripper, if any.
        tick: number of the tick in its trial, from 0; a tick is half a second.
    """

    position_m: tuple[float, float, float]
    momentum: tuple[float, float, float]
    goal_ids: tuple[str, ...]
    goals_m: FloatArray
    held: str | None = None
    tick: int = 0


@dataclass(frozen=True)
class NoParameters:
    """Nothing to set."""


class Part(ABC):
    """What arbiters and inferences have in common.

    A subclass names a frozen dataclass as `Parameters`: the study file's keys, their bounds (as `annotated_types`, such
    as `Annotated[float, Ge(0)]`), defaults and error messages come from it.

    Attributes:
        parameters: what the study file says, an instance of `Parameters`.
        models: the study's models of the person and of the arm.
        memory: a value of JSON that outlives the cycle, at most 64 kB. Set it in `__init__` to what it is before the
            first cycle, and change it where the part decides.
    """

    Parameters: ClassVar[type[Any]] = NoParameters
    parameters: Any
    memory: Memory = None

    def __init__(self, parameters: Any, models: Models) -> None:
        self.parameters = parameters
        self.models = models


class Arbiter(Part):
    """Decides what the arm does (paper III-E, III-F). One instance lives for one pick-and-place cycle.

    `moves_by_itself` says whether the arm may move while the hands are off; if not, `decide` must stay then.
    """

    moves_by_itself: ClassVar[bool] = True

    @abstractmethod
    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Direction:
        """The action of this tick, three of -1, 0, 1.

        Args:
            state: the world at the start of the tick.
            belief: over ``state.goal_ids``, after the person's action of this tick.
            user: the person's direction; None = hands off.
            feasible: whether the arm can do an action. What cannot be done must not be chosen, unless it is the
                person's own.
        """

    def explain(self, state: State, belief: Belief, user: Direction | None, action: Direction) -> Explanation:
        """What spoke for ``action``, for the experimenter's dashboard. Asked after `decide`, with the same values, and
        only where somebody may look; it must not change the memory."""
        return {}


class GoalInference(Part):
    """What the person seems to want (paper III-B). One instance lives for one pick-and-place cycle."""

    @abstractmethod
    def update(self, state: State, belief: Belief, user: Direction | None) -> Belief:
        """The belief over the same goals, in the same order, after this tick's action of the person.

        ``belief`` is what this returned in the tick before; where the set of goals has changed since (the gripper
        opened or closed, a task ended) it is uniform. ``user`` is None while the hands are off.
        """
