"""A study's facts in its texts: how long it takes, how many rounds there are, and what else a participant is told."""

from __future__ import annotations

from collections.abc import Mapping

from study.definition.sections import Consent, Instructions, Recruitment, Texts
from study.definition.study import Study
from study.definition.text_placeholders import filled_texts
from study.flow.overview import expected_minutes


def facts_of(study: Study) -> Mapping[str, str]:
    """What stands for each name of `study.definition.text_placeholders.FACTS`."""
    return {
        "minutes": str(round(expected_minutes(study))),
        "rounds": str(len(study.conditions)),
        "tasks": str(study.tasks_per_trial),
        "objects": str(study.pickups_per_trial),
        "bins": str(len(study.bins)),
        "answer_seconds": f"{study.distractor.answer_within_s:g}",
    }


def as_read(study: Study) -> Study:
    """The study with its facts in its texts, as participants read them. What they agree to has the hash of that."""
    facts = facts_of(study)
    welcome, full = study.recruitment.welcome, study.recruitment.full
    recruitment = {"welcome": tuple(filled_texts(welcome, facts)), "full": tuple(filled_texts(full, facts))}
    texts: dict[str, Consent | Instructions | Texts | Recruitment] = {
        "consent": Consent.model_validate(filled_texts(study.consent.model_dump(), facts)),
        "instructions": Instructions.model_validate(filled_texts(study.instructions.model_dump(), facts)),
        "texts": Texts.model_validate(filled_texts(study.texts.model_dump(), facts)),
        "recruitment": study.recruitment.model_copy(update=recruitment),
    }
    return study.model_copy(update=texts)
