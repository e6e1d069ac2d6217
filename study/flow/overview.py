"""What a study comes to: trials, tasks, questions, and about how long one participant takes."""

from __future__ import annotations

from study.definition.study import Study, orders
from study.flow.eligibility import checks_of
from study.flow.open_link import open_link
from study.records import TICK_S

TRAVEL_M = 1.7
"""Way of the gripper for one object: there, to the bin, and the detours of a person; simulated participants' mean."""
FORMS_S, FORM_ITEM_S = 240.0, 10.0
"""Consent, set-up and instructions, and each question of a form or questionnaire."""
BETWEEN_TRIALS_S = 60.0


def expected_minutes(study: Study) -> float:
    """About how long a participant takes from the link to the thanks: a guess for planning, not a measurement."""
    robot, distractor = study.robot, study.distractor
    object_s = TRAVEL_M / robot.speed_m_s + TICK_S * (2 * robot.gripper_ticks + robot.reset_ticks)
    if study.task_limit_s:
        object_s = min(object_s, 2 * study.task_limit_s)
    trial_s = study.pickups_per_trial * object_s
    away_s = 0.0
    if distractor.enabled:
        away_s = distractor.away_min_s if distractor.placement == "same_page_away" else distractor.answer_within_s / 2
        trial_s /= max(0.1, 1.0 - away_s / distractor.every_s)
    if study.trial_limit_s:
        trial_s = min(trial_s, study.trial_limit_s)
    questions = sum(len(form.items) for form in study.instruments)
    once = len(study.demographics) + len(study.instructions.questions) + 3 * len(study.texts.debrief_questions)
    practice_s = object_s + (away_s if study.practice_task == "round" else 0.0) if study.practice else 0.0
    each_s = trial_s + BETWEEN_TRIALS_S + FORM_ITEM_S * questions + practice_s
    return (FORMS_S + FORM_ITEM_S * once + len(study.conditions) * each_s) / 60.0


def overview(study: Study) -> str:
    """The study in one line: conditions, orders, trials, tasks, questions, minutes, and who may take part."""
    trials = len(study.conditions)
    questions = sum(len(form.items) for form in study.instruments)
    parts = [
        f"{_count(trials, 'condition')} in {_count(len(orders(study)), 'order')}",
        f"{_count(trials, 'trial')} with {study.tasks_per_trial} tasks each, {trials * study.tasks_per_trial} in all",
        f"{_count(questions, 'question')} after each" if questions else "no questionnaires",
        f"about {round(expected_minutes(study))} minutes",
    ]
    limits = [("a task", study.task_limit_s), ("a trial", study.trial_limit_s)]
    limited = [f"{seconds / 60:.3g} for {what}" for what, seconds in limits if seconds]
    if limited:
        parts.append(f"at most {' and '.join(limited)}")
    checks = checks_of(study.eligibility)
    if checks:
        parts.append(f"asks of the device: {', '.join(checks)}")
    if study.recruitment.open:
        parts.append(f"open to {study.recruitment.quota} over {open_link('', study.recruitment)}")
    return "; ".join(parts)


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")
