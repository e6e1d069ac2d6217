"""What an arbiter promises. An author's own test file says it in two lines:

from app.contracts.arbiter import ArbiterContract

class TestBlend(ArbiterContract):
    arbiter = "blend.py:Blend"      # a file beside this one; or the name that a package registers
"""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import ClassVar

from app.autonomy.interface import Models
from app.contracts.asking import STAY, ask, made_direction
from app.contracts.candidate import Candidate
from app.contracts.part import PartContract, each_answer
from app.contracts.situations import CYCLES, cycles
from app.contracts.verdict import mend
from app.trial.parts import make_arbiter
from app.trial.reasoning import MAX_EXPLANATION

LONGEST_NAME = 60


class ArbiterContract(PartContract):
    """Deterministic, feasible, quick, and restored from its memory."""

    kind: ClassVar[str] = "arbiter"
    arbiter: ClassVar[str] = ""

    def test_it_answers_with_directions(self, part: Candidate) -> None:
        """Three of -1, 0 and 1."""
        for answer in each_answer(part):
            if made_direction(answer.value) is None:
                mend(
                    f"{part} returned {answer.text}; decide must return three numbers, each -1, 0 or 1 "
                    f"({answer.situation})"
                )

    def test_it_chooses_only_what_can_be_done(self, part: Candidate) -> None:
        """To stay may always be chosen, and so may what the person does."""
        for answer in each_answer(part):
            action, situation = made_direction(answer.value), answer.situation
            if action is None or action in (STAY, situation.user) or situation.feasible(action):
                continue
            mend(f"{part} chose {action}, which the arm cannot do: ask feasible(action) first ({situation})")

    def test_it_stays_with_the_hands_off_unless_it_moves_by_itself(self, part: Candidate) -> None:
        """What the class says and what the arm does must agree: the page may tell the person."""
        if not isinstance(part.loaded.moves_by_itself, bool):
            mend(f"{part}: moves_by_itself is {part.loaded.moves_by_itself!r}; it must be True or False")
        if part.loaded.moves_by_itself:
            return
        for answer in each_answer(part):
            action = made_direction(answer.value)
            if answer.situation.user is None and action not in (None, STAY):
                mend(
                    f"{part} chose {action} with the hands off, but moves_by_itself is False: stay then, or set it to "
                    f"True ({answer.situation})"
                )

    def test_it_explains_in_short_names_and_numbers_or_texts(self, part: Candidate) -> None:
        """What the dashboard can show."""
        for cycle in part.transcript.cycles:
            arbiter = make_arbiter(part.named, Models())
            for answer in cycle:
                action, situation = made_direction(answer.value), answer.situation
                if action is None:
                    continue
                asked = situation.state, situation.prior, situation.user
                try:
                    arbiter.decide(*asked, situation.feasible)
                    told = arbiter.explain(*asked, action)
                except Exception as error:
                    mend(f"{part}: explain raised {type(error).__name__}: {error} ({situation})")
                if not isinstance(told, Mapping):
                    mend(f"{part}: explain returned {told!r:.80}; it must return names and values, as a dict")
                if len(told) > MAX_EXPLANATION:
                    mend(f"{part}: explain returned {len(told)} values; at most {MAX_EXPLANATION} are shown")
                for name, value in told.items():
                    if not isinstance(name, str) or not 0 < len(name) <= LONGEST_NAME:
                        mend(f"{part}: explain names a value {name!r:.80}; names are texts of 1 to {LONGEST_NAME}")
                    if not isinstance(value, (Real, str)):
                        mend(f"{part}: explain gives {name} the value {value!r:.80}; it must be a number or a text")

    def test_explaining_changes_nothing(self, part: Candidate) -> None:
        """Nobody may be looking: then it is not asked."""
        watched = ask(part.named, cycles(CYCLES), explain=True)
        for seen, unseen in zip(watched.answers, part.transcript.answers, strict=False):
            if seen.memory != unseen.memory:
                mend(f"{part}: explain changes the memory: it is not asked where nobody looks ({seen.situation})")
            if seen.text != unseen.text:
                mend(
                    f"{part}: explain changes a later answer, {unseen.text} to {seen.text}: it is not asked where "
                    f"nobody looks ({seen.situation})"
                )
