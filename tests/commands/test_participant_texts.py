"""`salab texts`, and what `salab check` says of a study in another language, as typed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from app.texts.sources import texts
from study.definition.study import DEFAULT_STUDY
from study.language.catalogue import read
from tests.support.typed_command import run

SOURCE = DEFAULT_STUDY.read_text(encoding="utf-8")


pytestmark = pytest.mark.usefixtures("own_folder")


def write_study(tag: str, translation: str = "") -> None:
    text = SOURCE.replace('language = "en"', f'language = "{tag}"', 1)
    text = text.replace('translation = ""', f'translation = "{translation}"', 1)
    english = 'english_questionnaires = ["sus_modified", "tlx_raw"]' if tag != "en" else "english_questionnaires = []"
    Path("study.toml").write_text(text.replace("english_questionnaires = []", english, 1), encoding="utf-8")


def test_a_translation_is_written_filled_in_and_brought_up(capsys: pytest.CaptureFixture[str]) -> None:
    status, said, _ = run(capsys, "texts", "--language", "fr")
    assert status == 0
    assert f"{len(texts())} of them still to translate" in said
    file = Path("texts.fr.po")
    empty = file.read_text(encoding="utf-8")
    entry = 'msgid "Agree and continue"\nmsgstr ""'
    own = '\n# of our distractor\nmsgid "What is no text of the lab"\nmsgstr "Un texte"\n'
    two_forms = re.sub(r"nplurals=3; .*;", "nplurals=2; plural=(n > 1);", empty).replace('\nmsgstr[2] ""', "")
    file.write_text(two_forms.replace(entry, entry[:-1] + 'Accepter"') + own, encoding="utf-8")
    status, said, _ = run(capsys, "texts", "--language", "fr")
    assert status == 0 and f"{len(texts()) - 1} of them still to translate" in said
    brought_up = file.read_text(encoding="utf-8")
    again = read(brought_up, "fr")
    assert again.texts == {"Agree and continue": "Accepter", "What is no text of the lab": "Un texte"}
    assert set(again.lines) == {*texts(), "What is no text of the lab"}
    assert own in brought_up and "Plural-Forms: nplurals=2; plural=(n > 1);" in brought_up
    assert run(capsys, "texts", "--language", "fr")[0] == 0
    assert file.read_text(encoding="utf-8") == brought_up


@pytest.mark.parametrize(
    ("text", "problem"),
    [('msgid "a {x}"\nmsgstr "b"\n', "line 1: 'b' lacks {x}. Mend it first"), ("x", "not a valid PO")],
)
def test_a_broken_translation_is_not_written_over(capsys: pytest.CaptureFixture[str], text: str, problem: str) -> None:
    Path("texts.fr.po").write_text(text, encoding="utf-8")
    status, _, wrong = run(capsys, "texts", "--language", "fr")
    assert status == 1 and problem in wrong
    assert Path("texts.fr.po").read_text(encoding="utf-8") == text


def test_what_is_no_language_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, wrong = run(capsys, "texts", "--language", "xx")
    assert status == 1 and "no such language is known" in wrong


def test_check_says_what_a_translation_lacks_and_has_too_much(capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "texts", "--language", "fr", "--out", "own.fr.po")
    file = Path("own.fr.po")
    text = file.read_text(encoding="utf-8")
    text += '\nmsgid "What a text of mine says"\nmsgstr "Ce que dit mon texte"\n'
    filled = text.replace('msgid "Help"\nmsgstr ""', 'msgid "Help"\nmsgstr "Aide"')
    assert filled != text
    file.write_text(filled, encoding="utf-8")
    write_study("fr", "own.fr.po")
    status, said, _ = run(capsys, "check", "study.toml")
    assert status == 0
    lines = said.splitlines()
    assert "own.fr.po: 'This page needs JavaScript. Please turn it on and reload the page.' (static/" in lines[1]
    assert not any("'Help'" in line for line in lines)
    assert any(line.endswith("more like these") for line in lines)
    assert any(line.startswith("own.fr.po: not reviewed for data") for line in lines)


def test_check_says_that_what_ships_is_not_reviewed(capsys: pytest.CaptureFixture[str]) -> None:
    write_study("de")
    status, said, _ = run(capsys, "check", "study.toml")
    assert status == 0
    assert "the translation into de that ships: not reviewed for data" in said
    assert "is not translated" not in said


def test_a_reviewed_translation_leaves_nothing_to_say(capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "texts", "--language", "de", "--out", "own.de.po")
    file = Path("own.de.po")
    text = file.read_text(encoding="utf-8")
    assert "X-Reviewed-For-Data: no" in text
    file.write_text(text.replace("Data: no", "Data: A. Person, 2026-11-26"), encoding="utf-8")
    write_study("de", "own.de.po")
    status, said, _ = run(capsys, "check", "study.toml")
    assert status == 0
    assert "reviewed" not in said and "translat" not in said


def test_english_needs_no_translation(capsys: pytest.CaptureFixture[str]) -> None:
    write_study("en")
    status, said, _ = run(capsys, "check", "study.toml")
    assert status == 0 and "reviewed" not in said and "translat" not in said
