"""The paper's inference: people take better actions more often, and Bayes' rule does the rest (III-B, eqs. 1-6)."""

from __future__ import annotations

import numpy as np

from app.autonomy.actions import Direction, index_of
from app.autonomy.arrays import FloatArray
from app.autonomy.belief import Belief, bayes_update, log_softmax
from app.autonomy.hindsight import rewards_of_moves_m
from app.autonomy.interface import GoalInference, Models, State


class Boltzmann(GoalInference):
    """P(phi | xi + (x, u)) proportional to P(u | phi, x) P(phi | xi). No action is no evidence."""

    def update(self, state: State, belief: Belief, user: Direction | None) -> Belief:
        if user is None:
            return belief
        log_likelihood = log_likelihoods(state, self.models)[index_of(user)]
        return Belief(state.goal_ids, bayes_update(belief.probabilities, log_likelihood))


def log_likelihoods(state: State, models: Models) -> FloatArray:
    """log P(u | phi, x), eqs. 1-3, of every action under every goal: (27, G)."""
    position_m = np.array(state.position_m)
    next_positions_m = position_m + models.transition.displacements(state.momentum)
    rewards_m = rewards_of_moves_m(position_m, next_positions_m, state.goals_m)
    return log_softmax(models.rationality_per_m * rewards_m, axis=0)
