"""The language of a study, and its own translation in a file beside it: told wrong with the line, kept in its text."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.definition.study import DEFAULT_STUDY, StudyFileError, load_study, parse_study
from study.definition.translations import MOST_BYTES

SOURCE = DEFAULT_STUDY.read_text(encoding="utf-8")
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
    [('language = "de"\n', "ltr"), ('language = "ar"\n', "rtl"), ('language = "ar"\ndir = "ltr"\n', "ltr")],
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
