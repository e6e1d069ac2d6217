"""Random states, goals and beliefs for the tests of ``app.autonomy``."""

from __future__ import annotations

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from app.autonomy.actions import DIRECTIONS, UNIT_DIRECTIONS
from app.autonomy.arrays import FloatArray
from app.autonomy.belief import Belief, bayes_update
from app.autonomy.transition import TransitionModel

without_deadline = settings(deadline=None)
"""Decorates every property: a busy machine must not fail one that holds."""

_coordinates = st.floats(-1.0, 1.0, width=32)

points_m = st.tuples(_coordinates, _coordinates, _coordinates)
momenta = st.sampled_from([tuple(float(component) for component in row) for row in UNIT_DIRECTIONS])
user_actions = st.none() | st.sampled_from(DIRECTIONS)
models = st.builds(
    TransitionModel,
    kind=st.sampled_from(["mix", "replan"]),
    step_m=st.floats(0.01, 0.1),
    planning_delay=st.floats(0.0, 1.0),
)
rationalities = st.floats(0.0, 60.0)


def goal_sets(smallest: int = 1, largest: int = 7) -> st.SearchStrategy[FloatArray]:
    """(G, 3) arrays, coincident goals among them."""
    return st.lists(points_m, min_size=smallest, max_size=largest).map(lambda rows: np.array(rows, dtype=float))


@st.composite
def goals_and_beliefs(draw: st.DrawFn, smallest: int = 1, impossible: bool = True) -> tuple[FloatArray, FloatArray]:
    """Goals (G, 3) and a belief (G,) over them, zeros among its entries unless ``impossible`` is False."""
    goals_m = draw(goal_sets(smallest))
    count = goals_m.shape[0]
    weights = draw(st.lists(st.integers(0 if impossible else 1, 50), min_size=count, max_size=count).filter(any))
    belief = np.array(weights, dtype=float)
    return goals_m, belief / belief.sum()


def updated(belief: Belief, log_likelihood_row: FloatArray) -> Belief:
    """The belief after one observed action, whose row of `log_likelihood` (G,) this is."""
    return Belief(belief.goal_ids, bayes_update(belief.probabilities, np.asarray(log_likelihood_row, dtype=float)))
