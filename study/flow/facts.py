"""A study's facts in its texts: how long it takes, how many rounds there are, and what else a participant is told."""

from __future__ import annotations

from collections.abc import Mapping

from study.definition.sections import Consent, Instructions, Recruitment, Texts
from study.definition.study import Study
from study.definition.text_placeholders import filled_texts
from study.flow.overview import expected_minutes


def facts_of(study: Study) -> Mapping[str, str]:
    """What stands for each name of `study.definition.text_placeholders.FACTS`."""
    number = study.words.number
    return {
        "minutes": number(round(expected_minutes(study))),
        "rounds": number(len(study.conditions)),
        "tasks": number(study.tasks_per_trial),
        "objects": number(study.pickups_per_trial),
        "bins": number(len(study.bins)),
        "answer_seconds": number(study.distractor.answer_within_s),
    }


def as_read(study: Study) -> Study:
    """The study with its facts in its texts, as participants read them. What they agree to has the hash of that."""
    facts = facts_of(study)
    lines, texts = study.words.lines, study.texts  # what a study leaves as it is, is in its language
    welcome, full = lines(study.recruitment.welcome), lines(study.recruitment.full)
    ends = {"aborted": lines(texts.aborted), "screened_out": lines(texts.screened_out)}
    recruitment = {"welcome": tuple(filled_texts(welcome, facts)), "full": tuple(filled_texts(full, facts))}
    read: dict[str, Consent | Instructions | Texts | Recruitment] = {
        "consent": Consent.model_validate(filled_texts(study.consent.model_dump(), facts)),
        "instructions": Instructions.model_validate(filled_texts(study.instructions.model_dump(), facts)),
        "texts": Texts.model_validate(filled_texts({**texts.model_dump(), **ends}, facts)),
        "recruitment": study.recruitment.model_copy(update=recruitment),
    }
    return study.model_copy(update=read)
