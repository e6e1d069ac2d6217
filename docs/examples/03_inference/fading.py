"""A goal inference that forgets: what people did long ago says little about what they want now.

The paper's inference keeps all evidence of a task. This one takes a share of it back with each new decision, so that a
person who changes their mind is understood sooner. The arbiter stays what it is: inference is a part of its own, and
any arbiter works with any inference. `study.toml` runs the same arbiter with both:

    salab check study.toml --trust
    salab simulate --study study.toml --trust --participants 2 --out pilot

Beliefs stay comparable: the columns `belief` and `entropy` of the exported ticks mean the same under each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from annotated_types import Ge, Le

from app.autonomy.actions import Direction, index_of
from app.autonomy.belief import Belief, bayes_update
from app.autonomy.inference.boltzmann import log_likelihoods
from app.autonomy.interface import GoalInference, State


@dataclass(frozen=True)
class Forgetting:
    """How fast evidence fades."""

    forget: Annotated[float, Ge(0.0), Le(1.0)] = 0.1
    """Share of the evidence so far that each decision takes back; 0 is the paper's inference, 1 knows the last only."""


class Fading(GoalInference):
    """P(phi | xi + (x, u)) proportional to P(u | phi, x) P(phi | xi) ^ (1 - forget)."""

    Parameters: ClassVar[type[Any]] = Forgetting
    parameters: Forgetting

    def update(self, state: State, belief: Belief, user: Direction | None) -> Belief:
        if user is None:
            return belief  # no decision, no evidence, nothing forgotten
        faded = belief.probabilities ** (1.0 - self.parameters.forget)
        # log P(u | phi, x) of eqs. 1-3 under every goal: (G,).
        log_likelihood = log_likelihoods(state, self.models)[index_of(user)]
        return Belief(state.goal_ids, bayes_update(faded / faded.sum(), log_likelihood))
