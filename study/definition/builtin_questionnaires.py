"""The questionnaires as data: wording, scale, anchors, direction and source of every item.

Wording of the instruments is their authors', quoted and attributed; "modified" is what we changed: 7 points instead
of the original 5 (SUS) or 21 (TLX), as in the paper (IV-C.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

POINTS = 7


@dataclass(frozen=True)
class Item:
    """One statement or scale, answered from 1 (`low`) to the questionnaire's `points` (`high`)."""

    id: str
    text: str
    low: str
    high: str
    reversed: bool = False
    """Whether a high answer speaks against what the score measures; scoring takes `points + 1 - answer`."""


@dataclass(frozen=True)
class Instrument:
    """One questionnaire. The score is the mean (or the sum) of its items after reversing."""

    id: str
    title: str
    intro: str
    source: str
    """Whose words these are and what was changed; shown with the questionnaire."""
    scoring: str
    """How the score is made; not for those who answer."""
    score_means: str
    """What a high score says."""
    items: tuple[Item, ...]
    points: int = POINTS
    method: Literal["mean", "sum"] = "mean"
    language: str = "en"
    """Of its words; empty = the study's."""

    @property
    def score_range(self) -> tuple[int, int]:
        """The lowest and the highest score there can be."""
        return (1, self.points) if self.method == "mean" else (len(self.items), len(self.items) * self.points)


def _agreement(number: int, text: str, reversed_: bool) -> Item:
    return Item(f"sus_{number:02d}", text, "Strongly disagree", "Strongly agree", reversed_)


SUS_MODIFIED = Instrument(
    id="sus_modified",
    title="About the system you just used",
    intro="How much do you agree with each statement about controlling the robot in this trial?",
    source=(
        "System Usability Scale, modified: 7 points instead of 5. Items: J. Brooke, "
        '"SUS: A quick and dirty usability scale", in Usability Evaluation in Industry (eds. Jordan, Thomas, '
        "Weerdmeester, McClelland), Taylor & Francis, 1996, pp. 189-194. (c) Digital Equipment Corporation, 1986."
    ),
    scoring="Mean of the 10 items on 1-7 after reversing the even ones, instead of the original 0-100.",
    score_means="more usable",
    items=(
        _agreement(1, "I think that I would like to use this system frequently", False),
        _agreement(2, "I found the system unnecessarily complex", True),
        _agreement(3, "I thought the system was easy to use", False),
        _agreement(
            4, "I think that I would need the support of a technical person to be able to use this system", True
        ),
        _agreement(5, "I found the various functions in this system were well integrated", False),
        _agreement(6, "I thought there was too much inconsistency in this system", True),
        _agreement(7, "I would imagine that most people would learn to use this system very quickly", False),
        _agreement(8, "I found the system very cumbersome to use", True),
        _agreement(9, "I felt very confident using the system", False),
        _agreement(10, "I needed to learn a lot of things before I could get going with this system", True),
    ),
)

TLX_RAW = Instrument(
    id="tlx_raw",
    title="About how demanding it was",
    intro="Think of the whole trial, both moving the objects and logging the readings.",
    source=(
        "NASA Task Load Index, raw (unweighted) and modified: 7 points instead of 21. Scales: "
        'S. G. Hart and L. E. Staveland, "Development of NASA-TLX (Task Load Index): Results of empirical and '
        'theoretical research", in Human Mental Workload (eds. Hancock, Meshkati), North-Holland, 1988, pp. 139-183.'
    ),
    scoring=(
        "Mean of the 6 scales on 1-7. Performance runs from Perfect (1) to Failure (7) as in the original, so no scale "
        "is reversed."
    ),
    score_means="more workload",
    items=(
        Item("mental_demand", "Mental demand: How mentally demanding was the task?", "Very low", "Very high"),
        Item("physical_demand", "Physical demand: How physically demanding was the task?", "Very low", "Very high"),
        Item(
            "temporal_demand",
            "Temporal demand: How hurried or rushed was the pace of the task?",
            "Very low",
            "Very high",
        ),
        Item(
            "performance",
            "Performance: How successful were you in accomplishing what you were asked to do?",
            "Perfect",
            "Failure",
        ),
        Item(
            "effort",
            "Effort: How hard did you have to work to accomplish your level of performance?",
            "Very low",
            "Very high",
        ),
        Item(
            "frustration",
            "Frustration: How insecure, discouraged, irritated, stressed, and annoyed were you?",
            "Very low",
            "Very high",
        ),
    ),
)

INSTRUMENTS: dict[str, Instrument] = {item.id: item for item in (SUS_MODIFIED, TLX_RAW)}
"""The questionnaires that are built in; a study file may bring its own (`study.definition.questionnaires`)."""


def built_in(name: str, distractor: str) -> Instrument:
    """The questionnaire of that name as a study with this kind of distractor asks it: only the readings are logged."""
    instrument = INSTRUMENTS[name]
    if distractor == "readings":
        return instrument
    return replace(instrument, intro=instrument.intro.replace("logging the readings", "the other task"))
