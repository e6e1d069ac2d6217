"""The rows of a trial's ticks: who decides what, and what of it stands in the record."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from app.autonomy.actions import Direction
from app.autonomy.belief import Belief
from app.autonomy.interface import State
from app.trial.goals import Goals, belief_text
from app.trial.motion import unit_direction
from app.trial.tasks import TaskProgress
from app.trial.values import Press, TrialSetup, UserInput
from sim.interface import TICK_S, WorldState
from study.records import TickRow, row_of

RETURNING = ("reset", "free")
"""Sources of ticks in which the arm goes back: they belong to no task."""
_NO_DIRECTION: tuple[int | None, int | None, int | None] = (None, None, None)


class Decision(NamedTuple):
    """Who decides a tick, and what: what the person asked for, what was chosen, the button that was obeyed."""

    source: str
    user: Direction | None = None
    action: Direction | None = None
    pressed: Press | None = None

    @property
    def departure(self) -> float | None:
        """How far the action is from what the person asked for: the length of the difference of the two unit
        directions; None when they asked for nothing."""
        if self.user is None or self.action is None:
            return None
        return 0.0 if self.action == self.user else math.dist(unit_direction(self.action), unit_direction(self.user))


class TickRows:
    """Makes them, for one trial."""

    def __init__(self, setup: TrialSetup) -> None:
        self._setup = setup
        self._text: tuple[Belief | None, str] = (None, "")

    def begun(
        self,
        decision: Decision,
        user_input: UserInput,
        progress: TaskProgress,
        state: State,
        goals: Goals,
        belief: Belief | None,
    ) -> dict[str, Any]:
        """What is known at the start of the tick."""
        returning = decision.source in RETURNING
        belief = belief or Belief.uniform(goals.ids)
        p_x, p_y, p_z = state.position_m
        m_x, m_y, m_z = state.momentum
        user_x, user_y, user_z = decision.user or _NO_DIRECTION
        action_x, action_y, action_z = decision.action or _NO_DIRECTION
        return {  # all columns, in their order
            "participant": self._setup.participant,
            "condition": self._setup.condition,
            "trial": self._setup.trial,
            "task": None if returning else progress.task,
            "kind": None if returning else progress.kind,
            "tick": state.tick,
            "cycle": progress.cycle,
            "trial_s": state.tick * TICK_S,
            "goal": None if returning else progress.goal,
            "p_x": p_x,
            "p_y": p_y,
            "p_z": p_z,
            "m_x": m_x,
            "m_y": m_y,
            "m_z": m_z,
            "user_x": user_x,
            "user_y": user_y,
            "user_z": user_z,
            "action_x": action_x,
            "action_y": action_y,
            "action_z": action_z,
            "source": decision.source,
            "blocked": 0,
            "blocked_reason": None,
            "gripper_input": decision.pressed,
            "gripper": "",
            "held": None,
            "after_pause": int(user_input.after_pause),
            "goals": goals.text,
            "belief": self._text_of(belief),
            "entropy": belief.entropy,
            "input_seq": user_input.seq,
            "started_utc": None,
            "late_ms": None,
            "digest": "",
            "departure": decision.departure,
            "attempt": progress.attempt,
        }

    @staticmethod
    def ended(begun: dict[str, Any], world: WorldState, blocked: bool, reason: str | None) -> TickRow:
        """The row, with what came of the tick; it takes `begun` over."""
        begun["blocked"], begun["blocked_reason"] = int(blocked), reason
        begun["gripper"], begun["held"], begun["digest"] = world.gripper, world.held, world.digest()
        return row_of(TickRow, begun)

    def _text_of(self, belief: Belief) -> str:
        """JSON: goal id to probability. Ticks without evidence keep their belief, and its text."""
        if self._text[0] is not belief:
            self._text = belief, belief_text(belief)
        return self._text[1]
