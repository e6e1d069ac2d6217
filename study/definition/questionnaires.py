"""A study's own questionnaires, and what its participants were asked.

A name in `surveys` that is not built in stands for a questionnaire of the study's own: a file `NAME.toml` beside the
study file, a table `[[questionnaires]]` in it, or what an installed package brings (`packaged_questionnaires`). A file
is copied into the study's text when the study is loaded, so that the text and its hash hold everything: stored,
exported and run again, a study needs no other file. In a study that is not in English, a file with a built-in one's
name holds its words in a validated translation: the same items, recorded and scored as ever.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Annotated, Any, Literal

from pydantic import Field

from study.definition.builtin_questionnaires import INSTRUMENTS, POINTS, Instrument, Item
from study.definition.field_types import Flag, Identifier, Part, Text, number
from study.definition.toml_reader import FieldPath, Problem, StudyFileError, model_problems, parse_toml, report
from study.definition.translations import LanguageTag

FORMS = ("demographics", "comprehension", "debrief")
"""What else leaves answers, under these names; no questionnaire may have them."""


class QuestionnaireItem(Part):
    """One statement or scale. `low` and `high` are the words at its ends, the questionnaire's if left out."""

    id: Identifier
    """Name of the item in the data."""
    text: Text
    """The statement, or the question, as the participant reads it."""
    low: Annotated[str, Field(strict=True)] = ""
    """Words at the low end."""
    high: Annotated[str, Field(strict=True)] = ""
    """Words at the high end."""
    reversed: Flag = False
    """Whether a high answer speaks against what the score measures."""


class QuestionnaireFile(Part):
    """A questionnaire as its own file holds it; its id is the file's name."""

    title: Text
    """Heading of the page."""
    intro: Text
    """What stands above the items."""
    source: Annotated[str, Field(strict=True)] = ""
    """Whose words these are and what was changed; shown with the questionnaire. In a study that is not in English it
    must be there: which validated translation it is, or that the words are your own."""
    language: LanguageTag | Literal[""] = ""
    """Of its words, such as `en`; the study's if left out."""
    points: int = number(default=7, ge=2, le=11)
    """How many points the scale has."""
    low: Annotated[str, Field(strict=True)] = ""
    """Words at the low end of every item that has none of its own."""
    high: Annotated[str, Field(strict=True)] = ""
    """The same at the high end."""
    scoring: Literal["mean", "sum"] = "mean"
    """Of all items, after reversing."""
    score_means: Text
    """What a high score says, such as "more trust"."""
    items: Annotated[tuple[QuestionnaireItem, ...], Field(min_length=1)]


class Questionnaire(QuestionnaireFile):
    """A questionnaire in the study file."""

    id: Identifier
    """Its name in `surveys` and in the data."""

    @property
    def instrument(self) -> Instrument:
        """The questionnaire as pages and scoring take it."""
        turned = [item.id for item in self.items if item.reversed]
        scoring = f"{self.scoring.capitalize()} of the {len(self.items)} items on 1-{self.points}"
        return Instrument(
            id=self.id,
            title=self.title,
            intro=self.intro,
            source=self.source,
            scoring=scoring + (f" after reversing {', '.join(turned)}." if turned else "."),
            score_means=self.score_means,
            items=tuple(
                Item(item.id, item.text, item.low or self.low, item.high or self.high, item.reversed)
                for item in self.items
            ),
            points=self.points,
            method=self.scoring,
            language=self.language,
        )


def file_problems(source: bytes, name: str) -> tuple[str, ...]:
    """Everything wrong with a questionnaire's own file, as `study_file.report` tells it."""
    try:
        data, text = parse_toml(source, name)
    except StudyFileError as error:
        return error.problems
    found = [*model_problems(QuestionnaireFile, data), *_clashes(data, ())]
    return report(name, text, data, found).problems if found else ()


def questionnaire_problems(data: Mapping[str, Any]) -> Iterator[Problem]:
    """What is wrong with the `questionnaires` of a study file's unchecked data beyond single fields."""
    chosen = data.get("surveys")
    for number_, entry in _entries(data.get("questionnaires")):
        place: FieldPath = ("questionnaires", number_)
        name = entry.get("id")
        if isinstance(name, str) and name in INSTRUMENTS:
            if data.get("language", "en") == "en":
                yield Problem((*place, "id"), "is a questionnaire that is built in; choose another id")
            else:
                yield from _other_words(INSTRUMENTS[name], entry, place)
        elif isinstance(name, str) and name in FORMS:
            yield Problem((*place, "id"), f"is taken; ids that are taken: {', '.join(FORMS)}")
        elif isinstance(name, str) and isinstance(chosen, list) and name not in chosen:
            yield Problem((*place, "id"), "is never asked; add it to surveys, or leave the questionnaire out")
        yield from _clashes(entry, place)
    yield from _language_problems(data)


def _language_problems(data: Mapping[str, Any]) -> Iterator[Problem]:
    """Questionnaires whose words are not in the study's language, or whose words are nobody's."""
    tag = data.get("language", "en")
    chosen = data.get("surveys", list(INSTRUMENTS))
    names = [name for name in chosen if isinstance(name, str)] if isinstance(chosen, list) else []
    listed = data.get("english_questionnaires")
    english = [name for name in listed if isinstance(name, str)] if isinstance(listed, list) else []
    own = own_ids(data)
    for position, name in enumerate(english):
        if name not in INSTRUMENTS or name not in names or name in own:
            known = [one for one in INSTRUMENTS if one in names and one not in own]
            place: FieldPath = ("english_questionnaires", position)
            yield Problem(place, f"is not asked in English words; built-in ones that are: {', '.join(known) or 'none'}")
    if not isinstance(tag, str) or tag.partition("-")[0] == "en":
        return
    for position, name in enumerate(names):
        if name in INSTRUMENTS and name not in own and name not in english:
            yield Problem(
                ("surveys", position) if "surveys" in data else ("surveys",),
                f"would be asked in English; put a validated translation with its source into {name}.toml beside this "
                f'file, or say english_questionnaires = ["{name}"]',
            )
    for number_, entry in _entries(data.get("questionnaires")):
        if not entry.get("source") and str(entry.get("language") or tag).partition("-")[0] != "en":
            sentence = "missing; say whose translation these words are, or that they are your own"
            yield Problem(("questionnaires", number_, "source"), sentence)


def _other_words(built_in: Instrument, entry: Mapping[str, Any], place: FieldPath) -> Iterator[Problem]:
    """What makes a translation of a built-in questionnaire another questionnaire, which its score would not fit."""
    items = {item.get("id"): item for _, item in _entries(entry.get("items"))}
    ids = [item.id for item in built_in.items]
    if list(items) != ids:
        yield Problem((*place, "items"), f"must be those of {built_in.id}, in their order: {', '.join(ids)}")
        return
    if entry.get("points", POINTS) != built_in.points:
        yield Problem((*place, "points"), f"must be {built_in.points}, as {built_in.id} has them")
    if entry.get("scoring", "mean") != built_in.method:
        yield Problem((*place, "scoring"), f'must be "{built_in.method}", as {built_in.id} is scored')
    for position, item in enumerate(built_in.items):
        if items.get(item.id, {}).get("reversed", False) != item.reversed:
            where = (*place, "items", position, "reversed")
            yield Problem(where, f"must be {str(item.reversed).lower()} for {item.id}, as {built_in.id} is scored")


def own_ids(data: Mapping[str, Any]) -> tuple[str, ...]:
    """Ids of the questionnaires that stand in a study file's unchecked data."""
    return tuple(entry["id"] for _, entry in _entries(data.get("questionnaires")) if isinstance(entry.get("id"), str))


def own_instruments(data: Mapping[str, Any]) -> dict[str, Instrument]:
    """The study's own questionnaires by id, from a study file's data; what cannot be read is left out."""
    found = {}
    for _, entry in _entries(data.get("questionnaires")):
        if not model_problems(Questionnaire, entry):
            form = Questionnaire.model_validate(entry)
            found[form.id] = form.instrument
    return found


def asked(data: Mapping[str, Any]) -> dict[str, Any]:
    """Questionnaires and forms of a study file's data, as JSON; parts that the file does not have are empty.

    Answers stand in `survey_answers` under the `id` of the questionnaire (or form) and of the item.
    """
    instructions, texts = _table(data, "instructions"), _table(data, "texts")
    forms = {**INSTRUMENTS, **own_instruments(data)}
    return {
        "surveys": [_told(forms[name], data) for name in data.get("surveys", ()) if name in forms],
        "demographics": data.get("demographics", []),
        "comprehension": instructions.get("questions", []),
        "debrief": texts.get("debrief_questions", []),
    }


def _told(instrument: Instrument, study: Mapping[str, Any]) -> dict[str, Any]:
    form = asdict(instrument)
    form["language"] = instrument.language or study.get("language", "en")
    for item in form["items"]:
        item["anchors"] = {"1": item.pop("low"), str(form["points"]): item.pop("high")}
    return form


def _clashes(entry: Mapping[str, Any], place: FieldPath) -> Iterator[Problem]:
    """Item ids that repeat, and items whose ends have no words."""
    first: dict[str, int] = {}
    for position, item in _entries(entry.get("items")):
        name = item.get("id")
        if isinstance(name, str) and first.setdefault(name, position) != position:
            yield Problem((*place, "items", position, "id"), f"repeats entry {first[name] + 1}; ids must be different")
        for end in ("low", "high"):
            if not item.get(end) and not entry.get(end):
                yield Problem((*place, "items", position, end), f"missing; give {end} here or once for all items")


def _entries(value: object) -> list[tuple[int, Mapping[str, Any]]]:
    entries = value if isinstance(value, list) else []
    return [(position, entry) for position, entry in enumerate(entries) if isinstance(entry, dict)]


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = data.get(key)
    return found if isinstance(found, Mapping) else {}
