"""The paper's inference: people take better actions more often, and Bayes' rule does the rest (III-B, eqs. 1-6)."""

from __future__ import annotations

import numpy as np

from app.autonomy.actions import Direction, index_of
from app.autonomy.arrays import FloatArray
from app.autonomy.belief import Belief, log_softmax
from app.autonomy.hindsight import moves_rewards_m, rewards_of_moves_m
from app.autonomy.interface import GoalInference, Models, State


class Boltzmann(GoalInference):
    """P(phi | xi + (x, u)) proportional to P(u | phi, x) P(phi | xi). No action is no evidence."""

    def update(self, state: State, belief: Belief, user: Direction | None) -> Belief:
        if user is None:
            return belief
        return belief.after(log_likelihood_of(index_of(user), state, self.models))


def log_likelihoods(state: State, models: Models) -> FloatArray:
    """log P(u | phi, x), eqs. 1-3, of every action under every goal: (27, G)."""
    position_m = np.array(state.position_m)
    next_positions_m = position_m + models.transition.displacements(state.momentum)
    rewards_m = rewards_of_moves_m(position_m, next_positions_m, state.goals_m)
    return log_softmax(models.rationality_per_m * rewards_m, axis=0)


def log_likelihood_of(index: int, state: State, models: Models) -> FloatArray:
    """log P(u | phi, x) of one action under every goal, (G,): that row of `log_likelihoods`, bit for bit, in a third of
    the time."""
    scores = moves_rewards_m(state.position_m, models.transition.here_and_next(state.momentum), state.goals_m)
    scores *= models.rationality_per_m
    scores -= np.maximum.reduce(scores)
    row: FloatArray = scores[index].copy()
    row -= np.log(np.add.reduce(np.exp(scores, out=scores)))
    return row
