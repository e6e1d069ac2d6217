"""What every distractor has to keep to, tried out on the first stimuli before anybody is asked to take part."""

from __future__ import annotations

from typing import Any, get_args

from study.flow.distractors.interface import (
    MAX_ANSWER_CHARACTERS,
    MAX_TEXT_CHARACTERS,
    Distractor,
    Entry,
    Stimulus,
    Words,
)
from study.parts.errors import one_line

TRIED = 12
"""Stimuli that are tried out."""
SEED, TRIAL = 1, 1
MAX_CHOICES = 9
MAX_PROMPT_CHARACTERS = 120


def broken_promise(distractor: Distractor[Any]) -> str | None:
    """The first thing this distractor does wrong, in one line; None when it may be used."""
    try:
        return _words_problem(distractor.words) or _stimuli_problem(distractor)
    except (Exception, SystemExit) as error:  # a distractor of somebody's own may raise whatever it likes
        return f"raises {type(error).__name__}: {one_line(error)}"


def _words_problem(words: object) -> str | None:
    if isinstance(words, Words) and all(isinstance(word, str) and word.strip() for word in (words.one, words.many)):
        return None
    return f"words is {words!r}; it must be Words(one, many), such as Words('reading', 'readings')"


def _stimuli_problem(distractor: Distractor[Any]) -> str | None:
    shown: list[Stimulus] = []
    for number in range(1, TRIED + 1):
        due_s, deadline_s, next_s = (
            distractor.due_s(number),
            distractor.deadline_s(number),
            distractor.due_s(number + 1),
        )
        if not 0.0 <= due_s < min(deadline_s, next_s):
            return (
                f"stimulus {number} is due at {due_s!r} s, ends at {deadline_s!r} s, and the next one is due at "
                f"{next_s!r} s; these times must be at least 0, and the first of them the smallest"
            )
        stimulus = distractor.stimulus(SEED, TRIAL, number)
        problem = _stimulus_problem(stimulus)
        if problem is None and distractor.stimulus(SEED, TRIAL, number) != stimulus:
            problem = "is another one when it is asked for again; draw from stimulus_rng(seed, trial, number) alone"
        if problem is not None:
            return f"stimulus {number} {problem}"
        shown.append(stimulus)
        right = distractor.right_answer(shown)
        if not isinstance(right, str) or not 1 <= len(right.strip()) <= MAX_ANSWER_CHARACTERS:
            return f"the right answer {right!r} to stimulus {number} must be 1 to {MAX_ANSWER_CHARACTERS} characters"
        if not stimulus.takes(right):
            ids = ", ".join(choice.id for choice in stimulus.choices)
            kind = f"none of its choices: {ids}" if stimulus.choices else "no number, which its entry asks for"
            return f"the right answer {right!r} to stimulus {number} is {kind}"
        if not distractor.is_right(right, tuple(shown)):
            return f"its own right answer {right!r} to stimulus {number} does not count as right"
    return None


def _stimulus_problem(stimulus: object) -> str | None:
    if not isinstance(stimulus, Stimulus):
        return f"is {stimulus!r}; it must be a Stimulus"
    if not isinstance(stimulus.text, str) or not 1 <= len(stimulus.text.strip()) <= MAX_TEXT_CHARACTERS:
        return f"shows {stimulus.text!r}; it must be a text of 1 to {MAX_TEXT_CHARACTERS} characters"
    if not isinstance(stimulus.prompt, str) or len(stimulus.prompt) > MAX_PROMPT_CHARACTERS:
        return f"has the prompt {stimulus.prompt!r}; it must be a text of at most {MAX_PROMPT_CHARACTERS} characters"
    if stimulus.entry not in get_args(Entry):
        return f"has the entry {stimulus.entry!r}; choices are {', '.join(get_args(Entry))}"
    choices = stimulus.choices
    if not isinstance(choices, tuple) or len(choices) == 1 or len(choices) > MAX_CHOICES:
        return f"has the choices {choices!r}; they must be none (the answer is typed), or a tuple of 2 to {MAX_CHOICES}"
    for choice in choices:
        if not choice.label.strip() or not 1 <= len(choice.id.strip()) <= MAX_ANSWER_CHARACTERS:
            return f"has {choice!r}; it must have a label and an id of 1 to {MAX_ANSWER_CHARACTERS} characters"
        if len(choice.key) != 1 or not choice.key.isprintable() or choice.key == " ":
            return f"has {choice!r}; its key must be one character that can be typed, and not a space"
    for what, values in (
        ("ids", [choice.id for choice in choices]),
        ("keys", [choice.key.casefold() for choice in choices]),
    ):
        if len(set(values)) < len(values):
            return f"has choices with the {what} {', '.join(values)}; they must be different"
    return None
