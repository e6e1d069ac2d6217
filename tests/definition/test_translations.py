"""The language of a study, and its own translation in a file beside it: told wrong with the line, kept in its text."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from app.session.pages import page
from study.definition import questionnaires
from study.definition.builtin_questionnaires import SUS_MODIFIED
from study.definition.study import DEFAULT_STUDY, StudyFileError, load_study, parse_study
from study.definition.toml_reader import parse_toml
from study.definition.translations import MOST_BYTES
from study.flow.answers import score
from study.flow.page import PageContext
from study.flow.protocol import Session

KEYS = re.compile(r"^(?:language|translation|english_questionnaires) = .*\n", re.MULTILINE)
SOURCE = KEYS.sub("", DEFAULT_STUDY.read_text(encoding="utf-8"))
TITLE = 'title = "Moving objects with a robot arm"\n'
OWN = """
msgid ""
msgstr ""
"Language: de\\n"
"Plural-Forms: nplurals=2; plural=(n != 1);\\n"

msgid "Agree and continue"
msgstr "Ich bin dabei"
"""


def write(folder: Path, keys: str, **files: str) -> Path:
    """A study with these keys, and files beside it."""
    for name, text in files.items():
        (folder / f"{name}.po").write_text(text, encoding="utf-8")
    file = folder / "study.toml"
    if "language" in keys and 'language = "en"' not in keys:
        keys += 'english_questionnaires = ["sus_modified", "tlx_raw"]\n'
    file.write_text(SOURCE.replace(TITLE, TITLE + keys), encoding="utf-8")
    return file


def problems(file: Path) -> tuple[str, ...]:
    with pytest.raises(StudyFileError) as error:
        load_study(file)
    return tuple(problem.replace(str(file.parent) + "/", "") for problem in error.value.problems)


def test_a_study_is_english_unless_it_says_otherwise() -> None:
    study = parse_study(SOURCE)
    assert (study.language, study.words.language, study.words.direction) == ("en", "en", "ltr")
    assert study.words.t("Agree and continue") == "Agree and continue"


def test_a_translation_beside_the_study_file_becomes_a_part_of_it(tmp_path: Path) -> None:
    study = load_study(write(tmp_path, 'language = "de"\ntranslation = "own.po"\n', own=OWN))
    assert study.words.t("Agree and continue") == "Ich bin dabei"
    (tmp_path / "own.po").unlink()
    again = parse_study(study.source_text)
    assert again.hash == study.hash
    assert again.words.t("Agree and continue") == "Ich bin dabei"
    changed = write(tmp_path, 'language = "de"\ntranslation = "own.po"\n', own=OWN.replace("dabei", "hier"))
    assert load_study(changed).hash != study.hash


def test_english_can_be_worded_anew(tmp_path: Path) -> None:
    own = OWN.replace("Language: de", "Language: en").replace("Ich bin dabei", "I am in")
    study = load_study(write(tmp_path, 'translation = "own.po"\n', own=own))
    assert study.words.t("Agree and continue") == "I am in"


@pytest.mark.parametrize(
    ("keys", "direction"),
    [
        ('language = "de"\n', "ltr"),
        ('language = "en-GB"\n', "ltr"),
        ('language = "ar"\n', "rtl"),
        ('language = "ar"\ndir = "ltr"\n', "ltr"),
    ],
)
def test_the_direction_is_the_languages_unless_the_file_says_otherwise(
    tmp_path: Path, keys: str, direction: str
) -> None:
    assert load_study(write(tmp_path, keys)).words.direction == direction


@pytest.mark.parametrize(
    ("keys", "own", "problem"),
    [
        ('language = "xx"\n', None, 'study.toml:10: language = "xx": not known; give a tag such as de, ar or pt-BR'),
        ('language = "German"\n', None, 'study.toml:10: language = "German": '),
        ('language = "fr"\n', None, 'study.toml:10: language = "fr": no translation into it ships with the lab'),
        ('dir = "up"\n', None, 'study.toml:10: dir = "up": '),
        (
            'language = "de"\ntranslation = "gone.po"\n',
            None,
            'study.toml:11: translation = "gone.po": no such file beside this one; salab texts --language de',
        ),
        ('translation = "../own.po"\n', OWN, 'study.toml:10: translation = "../own.po": '),
        ('language = "fr"\ntranslation = "own.po"\n', OWN, "own.po:1: its header says Language: de, and the study"),
        (
            'language = "de"\ntranslation = "own.po"\n',
            OWN + '\nmsgid "From the experimenter: {text}"\nmsgstr "Von der Leitung: {txt}"\n',
            "own.po:10: 'Von der Leitung: {txt}' lacks {text}",
        ),
        ('language = "de"\ntranslation = "own.po"\n', OWN + "# " + "x" * MOST_BYTES, "own.po: is larger than 1 MB"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, keys: str, own: str | None, problem: str) -> None:
    told = problems(write(tmp_path, keys, **({} if own is None else {"own": own})))
    assert any(one.startswith(problem) for one in told), told


def test_a_stored_translation_that_was_changed_by_hand_is_told(tmp_path: Path) -> None:
    study = load_study(write(tmp_path, 'language = "de"\ntranslation = "own.po"\n', own=OWN))
    with pytest.raises(StudyFileError, match=r"(?s)translations\[1\]\.text.*line 7: 'Ich \{x\}' has \{x\}"):
        parse_study(study.source_text.replace("Ich bin dabei", "Ich {x}"))
    with pytest.raises(StudyFileError, match=r'"other.po": no such file beside this one'):
        parse_study(study.source_text.replace('translation = "own.po"', 'translation = "other.po"'))


# ---- questionnaires: nobody is asked in two languages without the file saying so

GERMAN = SOURCE.replace(TITLE, TITLE + 'language = "de"\n')
SUS = """
title = "Zum System"
intro = "Wie sehr stimmen Sie zu?"
source = "A validated translation, authors and year"
low = "Stimme gar nicht zu"
high = "Stimme voll zu"
score_means = "more usable"
""" + "".join(
    f"""
[[items]]
id = "{item.id}"
text = "Wortlaut {number}"
reversed = {str(item.reversed).lower()}
"""
    for number, item in enumerate(SUS_MODIFIED.items, start=1)
)
ASKED = 'surveys = ["sus_modified", "tlx_raw"]'


def german(folder: Path, asked: str, sus: str | None = None) -> Path:
    (folder / "study.toml").write_text(GERMAN.replace(ASKED, asked), encoding="utf-8")
    if sus is not None:
        (folder / "sus_modified.toml").write_text(sus, encoding="utf-8")
    return folder / "study.toml"


@pytest.mark.parametrize(("asked", "place"), [(ASKED, "surveys[1] = "), ("", "surveys: ")])
def test_english_words_in_another_language_have_to_be_meant(tmp_path: Path, asked: str, place: str) -> None:
    told = problems(german(tmp_path, asked))
    assert len(told) == 2
    assert place in told[0]
    assert told[0].endswith('english_questionnaires = ["sus_modified"]')
    assert told[1].endswith('english_questionnaires = ["tlx_raw"]')


def test_english_words_that_are_meant_are_marked_on_the_page(tmp_path: Path) -> None:
    asked = ASKED + '\nenglish_questionnaires = ["tlx_raw", "sus_modified"]'
    study = load_study(german(tmp_path, asked))
    session = Session("P001", 3, "survey")
    forms = page(session, PageContext(study)).content["instruments"]
    assert [(form["id"], form["language"], form["dir"]) for form in forms] == [
        ("sus_modified", "en", "ltr"),
        ("tlx_raw", "en", "ltr"),
    ]
    english = page(session, PageContext(load_study(None))).content["instruments"]
    assert not any("language" in form for form in english)
    told = questionnaires.asked(parse_toml(study.source_text.encode(), "study")[0])
    assert [form["language"] for form in told["surveys"]] == ["en", "en"]


def test_a_validated_translation_is_recorded_and_scored_as_ever(tmp_path: Path) -> None:
    study = load_study(german(tmp_path, 'surveys = ["sus_modified"]', SUS))
    (form,) = study.instruments
    assert (form.title, form.items[1].text, form.source) == (
        "Zum System",
        "Wortlaut 2",
        "A validated translation, authors and year",
    )
    points = {item.id: 2 + number % 3 for number, item in enumerate(SUS_MODIFIED.items)}
    assert score(form, points) == score(SUS_MODIFIED, points)
    stored = parse_study(study.source_text)
    assert stored.instruments == study.instruments
    told = questionnaires.asked(parse_toml(study.source_text.encode(), "study")[0])
    assert [form["language"] for form in told["surveys"]] == ["de"]


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('id = "sus_02"', 'id = "sus_2"', "must be those of sus_modified, in their order: sus_01, sus_02"),
        ("reversed = true", "reversed = false", "reversed = false: must be true for sus_02"),
        ("score_means", "points = 5\nscore_means", "points = 5: must be 7"),
        ("score_means", 'scoring = "sum"\nscore_means', 'scoring = "sum": must be "mean"'),
        ('source = "A validated translation, authors and year"\n', "", "source: missing; say whose translation"),
    ],
)
def test_other_words_cannot_make_another_questionnaire(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    told = problems(german(tmp_path, 'surveys = ["sus_modified"]', SUS.replace(old, new, 1)))
    assert any(sentence in one for one in told), told


def test_a_file_with_a_built_in_name_means_nothing_in_english(tmp_path: Path) -> None:
    (tmp_path / "sus_modified.toml").write_text(SUS, encoding="utf-8")
    (tmp_path / "study.toml").write_text(SOURCE, encoding="utf-8")
    assert load_study(tmp_path / "study.toml").instruments[0] == SUS_MODIFIED


def test_what_is_named_in_english_has_to_be_asked(tmp_path: Path) -> None:
    asked = 'surveys = ["sus_modified"]\nenglish_questionnaires = ["sus_modified", "tlx_raw"]'
    told = problems(german(tmp_path, asked))
    assert len(told) == 1
    assert (
        'english_questionnaires[2] = "tlx_raw": is not asked in English words; built-in ones that are: sus_' in told[0]
    )
