"""What a goal inference promises. An author's own test file says it in two lines:

from app.contracts.inference import InferenceContract

class TestRecent(InferenceContract):
    inference = "recent.py:Recent"      # a file beside this one; or the name that a package registers
"""

from __future__ import annotations

from typing import ClassVar

from app.autonomy.belief import Belief
from app.contracts.candidate import Candidate
from app.contracts.part import PartContract, each_answer
from app.contracts.verdict import mend


class InferenceContract(PartContract):
    """Deterministic, a distribution over the goals there are, quick, and restored from its memory."""

    kind: ClassVar[str] = "inference"
    inference: ClassVar[str] = ""

    def test_it_answers_with_a_belief_over_the_same_goals(self, part: Candidate) -> None:
        """Belief rows stay comparable: the same goals, in the same order. That it sums to 1, `Belief` sees to."""
        for answer in each_answer(part):
            goals = answer.situation.state.goal_ids
            if not isinstance(answer.value, Belief):
                mend(f"{part} returned {answer.text}; update must return a Belief ({answer.situation})")
            if answer.value.goal_ids != goals:
                mend(
                    f"{part} returned a belief over {', '.join(answer.value.goal_ids)}; the goals are "
                    f"{', '.join(goals)}, in this order: take state.goal_ids ({answer.situation})"
                )
