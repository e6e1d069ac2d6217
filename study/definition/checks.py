"""What no single field of a study file can know: ids that repeat, names the simulated world lacks, fields that clash.

The checks read unchecked data, so that one pass over a file tells everything that is wrong with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from study.definition.builtin_questionnaires import INSTRUMENTS
from study.definition.layout_checks import known_bins, known_objects, known_places, layout_problems
from study.definition.layouts import WorldCheck
from study.definition.link_placeholders import placeholders
from study.definition.questionnaires import own_ids, questionnaire_problems
from study.definition.sections import DistractorSettings, Recruitment
from study.definition.toml_reader import Problem, choices_sentence
from study.definition.translations import language_problems
from study.parts.shelf import Shelf


def cross_problems(data: Mapping[str, Any], world: WorldCheck | None, shelf: Shelf | None = None) -> Iterator[Problem]:
    """Every clash in the data; `world` tells what the robot cannot reach or hold, `shelf` which parts there are."""
    places = known_places(data)
    layout = data.get("layout")
    is_layout_known = isinstance(layout, str) and layout in places
    if isinstance(layout, str) and not is_layout_known:
        yield Problem(("layout",), choices_sentence(layout, places, "layouts") + _or_own(layout))
    known: dict[str, Sequence[str]] = {"surveys": (*INSTRUMENTS, *own_ids(data))}
    if is_layout_known or layout is None:  # whose objects and bins an unknown one has, nobody can tell
        known = {"objects": known_objects(data), "bins": known_bins(data), **known}
    for field in ("objects", "bins", "surveys"):
        names = _texts(data.get(field))
        for position, name in names:
            if field not in known or name in known[field]:
                continue
            if field == "surveys":  # what packages bring takes a while to look up
                there_are = dict.fromkeys((*known[field], *(shelf.registries["questionnaire"].names if shelf else ())))
                yield Problem((field, position), choices_sentence(name, there_are, field) + _or_own(name))
            else:
                yield Problem((field, position), choices_sentence(name, known[field], field))
        yield from _repeated(field, [(position, name, (field, position)) for position, name in names])
    chosen = len(_texts(data.get("objects")))
    room = places.get(layout) if isinstance(layout, str) else None
    if room is not None and chosen > room:
        yield Problem(("objects",), f"has {chosen} entries, layout {layout!r} has room for {room}")
    pickups = data.get("pickups_per_trial", 3)
    if isinstance(pickups, int) and chosen and pickups > chosen:
        yield Problem(("pickups_per_trial",), f"must be at most {chosen}, the number of objects")
    instructions = data.get("instructions")
    questions = instructions.get("questions") if isinstance(instructions, dict) else None
    texts = data.get("texts")
    open_questions = texts.get("debrief_questions") if isinstance(texts, dict) else None
    for place, entries in (
        (("conditions",), data.get("conditions")),
        (("demographics",), data.get("demographics")),
        (("questionnaires",), data.get("questionnaires")),
        (("layouts",), data.get("layouts")),
        (("instructions", "questions"), questions),
        (("texts", "debrief_questions"), open_questions),
    ):
        ids = [(number, entry.get("id"), (*place, number, "id")) for number, entry in _tables(entries)]
        yield from _repeated("ids", ids)
        for number, entry in _tables(entries):
            yield from _option_problems((*place, number), entry)
    yield from _distractor_problems(data.get("distractor"))
    yield from _limit_problems(data)
    yield from _recruitment_problems(data.get("recruitment"))
    yield from questionnaire_problems(data)
    yield from layout_problems(data, world)
    yield from language_problems(data)


def _or_own(name: str) -> str:
    return f", or your own in {name}.toml beside this file"


def _option_problems(place: tuple[Any, ...], entry: Mapping[str, Any]) -> Iterator[Problem]:
    options = [
        (number, option.get("id"), (*place, "options", number, "id"))
        for number, option in _tables(entry.get("options"))
    ]
    yield from _repeated("option ids", options)
    ids = [str(option_id) for _, option_id, _ in options]
    if "correct" in entry and entry["correct"] not in ids:
        yield Problem((*place, "correct"), choices_sentence(entry["correct"], ids, "options"))
    if place[0] == "demographics":
        kind = entry.get("kind", "choice")
        if kind == "choice" and len(ids) < 2:
            yield Problem((*place, "options"), f"has {len(ids)} entries, a choice must have at least 2")
        if kind in ("text", "number") and ids:
            yield Problem((*place, "options"), f"must be left out with kind {kind!r}")
        if kind != "number":
            for name in ("whole", "least", "most"):
                if name in entry:
                    yield Problem((*place, name), f"must be left out with kind {kind!r}; only a number has it")
        least: Any = entry.get("least")
        most: Any = entry.get("most")
        if _both_numbers(least, most) and least > most:
            yield Problem((*place, "least"), f"must be at most most, which is {most}")


def _distractor_problems(distractor: object) -> Iterator[Problem]:
    if not isinstance(distractor, dict):
        return
    chosen = {**DistractorSettings().model_dump(), **distractor}
    every, within, away = chosen["every_s"], chosen["answer_within_s"], chosen["away_min_s"]
    if _both_numbers(within, every) and within > every:
        yield Problem(("distractor", "answer_within_s"), f"must be at most every_s, which is {every}")
    if _both_numbers(away, within) and away > within:
        yield Problem(("distractor", "away_min_s"), f"must be at most answer_within_s, which is {within}")


def _limit_problems(data: Mapping[str, Any]) -> Iterator[Problem]:
    """A limit that is none of the time that a task or a reading needs; 0 is none."""
    task_s, trial_s = data.get("task_limit_s", 0), data.get("trial_limit_s", 0)
    if _both_numbers(task_s, trial_s) and 0 < trial_s < task_s:
        yield Problem(("task_limit_s",), f"must be at most trial_limit_s, which is {trial_s:g}, or 0 for no limit")
    given = data.get("distractor", {})
    settings = {**DistractorSettings().model_dump(), **(given if isinstance(given, dict) else {})}
    bounds = [("task_limit_s", task_s, "answer_within_s"), ("trial_limit_s", trial_s, "first_s")]
    for field, limit_s, bound in bounds if settings["enabled"] is True else ():
        needed_s = settings[bound]
        if _both_numbers(limit_s, needed_s) and 0 < limit_s <= needed_s:
            why = "one stimulus could take all of it" if field == "task_limit_s" else "no stimulus would ever appear"
            yield Problem(
                (field,), f"must be above distractor.{bound}, which is {needed_s:g}, or 0 for no limit: {why}"
            )


_LINKS = ("completion_link", "screened_out_link", "full_link")


def _recruitment_problems(recruitment: object) -> Iterator[Problem]:
    if not isinstance(recruitment, dict):
        return
    table = "recruitment"
    if recruitment.get("open") is True and recruitment.get("quota", 0) == 0:
        yield Problem((table, "quota"), "must be at least 1 when open is true")
    given = _texts(recruitment.get("id_parameters", list(Recruitment().id_parameters)))
    names = [name for _, name in given]
    yield from _repeated("parameters", [(place, name, (table, "id_parameters", place)) for place, name in given])
    person = recruitment.get("person", Recruitment().person)
    if isinstance(person, str) and names and person not in names:
        yield Problem((table, "person"), choices_sentence(person, names, "id_parameters"))
    for field in _LINKS:
        link = recruitment.get(field)
        for name in placeholders(link) if isinstance(link, str) else ():
            if name not in names:
                yield Problem((table, field), f"{{{name}}} is none of the id_parameters: {', '.join(names)}")


def _both_numbers(*values: object) -> bool:
    return all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)


def _texts(value: object) -> list[tuple[int, str]]:
    entries = value if isinstance(value, list) else []
    return [(position, entry) for position, entry in enumerate(entries) if isinstance(entry, str)]


def _tables(value: object) -> list[tuple[int, Mapping[str, Any]]]:
    entries = value if isinstance(value, list) else []
    return [(position, entry) for position, entry in enumerate(entries) if isinstance(entry, dict)]


def _repeated(what: str, entries: Sequence[tuple[int, object, tuple[Any, ...]]]) -> Iterator[Problem]:
    first: dict[object, int] = {}
    for position, name, path in entries:
        if isinstance(name, str) and first.setdefault(name, position) != position:
            yield Problem(path, f"repeats entry {first[name] + 1}; {what} must be different")
