"""What a text is in a language, from translations as people write them."""

from __future__ import annotations

import pickle

import pytest

from study.language.catalogue import Mistake, read, shipped, words_for
from study.language.locales import language
from study.language.words import ENGLISH, NumberSigns, Words

GERMAN = """
msgid ""
msgstr ""
"Language: de\\n"
"Content-Type: text/plain; charset=utf-8\\n"
"Plural-Forms: nplurals=2; plural=(n != 1);\\n"

msgid "Pick up the {object}."
msgstr "Nehmen Sie auf: {object}."

msgctxt "direction"
msgid "left"
msgstr "nach links"

msgid "One question is left."
msgid_plural "{n} questions are left."
msgstr[0] "Eine Frage ist offen."
msgstr[1] "{n} Fragen sind offen."

msgid "empty"
msgstr ""

#, fuzzy
msgid "unsure"
msgstr "unsicher"
"""


def test_english_is_its_own_key() -> None:
    assert ENGLISH.t("Pick up the {object}.", object="can") == "Pick up the can."
    assert ENGLISH.t("{n} of {all}", n=3) == "3 of {all}"
    assert ENGLISH.tn("One question.", "{n} questions.", 1) == "One question."
    assert ENGLISH.tn("One question.", "{n} questions.", 0) == "0 questions."


def test_a_translation_is_used_where_it_has_something() -> None:
    words = words_for("de", own=GERMAN)
    assert words.t("Pick up the {object}.", object="Dose") == "Nehmen Sie auf: Dose."
    assert words.tn("One question is left.", "{n} questions are left.", 1) == "Eine Frage ist offen."
    assert words.tn("One question is left.", "{n} questions are left.", 12) == "12 Fragen sind offen."
    assert words.texts["direction\x04left"] == "nach links"
    assert words.t("empty") == "empty"
    assert words.t("unsure") == "unsure"
    assert words.t("in no catalogue") == "in no catalogue"
    assert pickle.loads(pickle.dumps(words)).tn("One question is left.", "", 1) == "Eine Frage ist offen."


@pytest.mark.parametrize(
    ("tag", "direction", "written"),
    [
        ("en", "ltr", "-601.70"),
        ("de", "ltr", "-601,70"),
        ("pt-BR", "ltr", "-601,70"),
        ("ar", "rtl", "\u200e-601.70"),
        ("ar-EG", "rtl", "\u061c-٦٠١٫٧٠"),
        ("fa", "rtl", "\u200e−۶۰۱٫۷۰"),
        ("hi", "ltr", "-601.70"),
        ("mr", "ltr", "-६०१.७०"),
    ],
)
def test_numbers_are_written_as_the_language_does(tag: str, direction: str, written: str) -> None:
    known = language(tag)
    assert known is not None
    assert known.direction == direction
    assert known.signs.written("-601.70") == written
    assert Words(tag, signs=known.signs).number(-601.7, 2) == written
    assert Words(tag, signs=known.signs).t("{x}", x=-601.7) == written[:-1]


def test_what_is_no_language() -> None:
    assert language("xx") is None
    assert language("klingon") is None
    assert language("PT") is None


def test_plurals_are_the_languages_own() -> None:
    arabic = words_for(
        "ar",
        own='msgid ""\nmsgstr ""\n"Plural-Forms: nplurals=6; plural=(n==0 ? 0 : n==1 ? 1 : n==2 ? 2 : n%100>=3 && '
        'n%100<=10 ? 3 : n%100>=11 ? 4 : 5);\\n"\n\nmsgid "one"\nmsgid_plural "many"\n'
        + "".join(f'msgstr[{place}] "{name}"\n' for place, name in enumerate(("0", "1", "2", "3-10", "11-99", "100"))),
    )
    numbers = {0: "0", 1: "1", 2: "2", 7: "3-10", 11: "11-99", 99: "11-99", 100: "100", 103: "3-10", 202: "100"}
    assert {n: arabic.tn("one", "many", n) for n in numbers} == numbers


def test_a_value_does_not_reorder_the_text_around_it() -> None:
    hebrew = Words("he", "rtl", {"{a}!": "!{a}"})
    assert hebrew.t("{a}!", a="USB pad") == "!\u2068USB pad\u2069"
    assert hebrew.t("{a}!", a=3) == "!3"


@pytest.mark.parametrize(
    ("text", "mistake"),
    [
        ('msgid "a {x} b"\nmsgstr "a b"', "'a b' lacks {x}"),
        ('msgid "a {x}"\nmsgstr "a {x} {y}"', "'a {x} {y}' has {y}, which nothing fills; there are: {x}"),
        ('msgid "a"\nmsgid_plural "{n} a"\nmsgstr[0] "b"\nmsgstr[1] ""', "'a' has 1 plural forms, German has 2"),
        ('msgid "a"\nmsgid_plural "{n} a"\nmsgstr[0] "b"', "has 1 plural forms, German has 2"),
        ('msgid "a"\nmsgstr "b\n', "begin and end with a quotation mark"),
        ('msgid "a"\nmsgstr b\n', "begin and end with a quotation mark"),
        ('msgid "a"\nhello', "not a valid PO file: Unknown or misformatted keyword"),
    ],
)
def test_mistakes_are_told_with_their_line(text: str, mistake: str) -> None:
    header = 'msgid ""\nmsgstr ""\n"Language: de\\n"\n"Plural-Forms: nplurals=2; plural=(n != 1);\\n"\n\n'
    found = read(header + text + "\n", "de").mistakes
    assert len(found) == 1
    assert mistake in found[0].sentence
    assert 6 <= found[0].line <= 8


def test_a_file_for_another_language_is_a_mistake() -> None:
    assert [one.sentence for one in read(GERMAN, "fr").mistakes if "header" in one.sentence]
    assert read(GERMAN, "de-AT").mistakes == ()


def test_plural_forms_have_to_be_those_of_the_language() -> None:
    text = GERMAN.replace("plural=(n != 1)", "plural=(n > 1)")
    assert read(text, "de").mistakes == (
        Mistake(1, "Plural-Forms puts 2 elsewhere than other numbers that German treats like it"),
    )


def test_a_header_may_go_on_in_another_line_as_editors_break_it() -> None:
    plural, reviewed = (
        '"Plural-Forms: nplurals=2; plural=(n "\n"!= 1);\\n"',
        '"x-reviewed-for-data: A. Person, "\n"2026\\n"',
    )
    found = read(GERMAN.replace('"Plural-Forms: nplurals=2; plural=(n != 1);\\n"', f"{plural}\n{reviewed}"), "de")
    assert found.mistakes == ()
    assert found.plurals == read(GERMAN, "de").plurals
    assert found.reviewed == "A. Person, 2026"


def test_a_form_for_numbers_that_never_come_may_be_left_empty() -> None:
    french = (
        'msgid ""\nmsgstr ""\n"Plural-Forms: nplurals=3; plural=(n == 0 || n == 1) ? 0 : n != 0 && n % 1000000 == 0 ? '
        '1 : 2;\\n"\n\nmsgid "one"\nmsgid_plural "{n}"\nmsgstr[0] "un"\nmsgstr[1] ""\nmsgstr[2] "{n} x"\n'
    )
    assert read(french, "fr").mistakes == ()
    words = words_for("fr", own=french)
    assert [words.tn("one", "{n}", n) for n in (0, 1, 2, 1_000_000)] == ["un", "un", "2 x", "1000000 x"]


def test_signs_leave_what_is_no_digit() -> None:
    assert NumberSigns("٠١٢٣٤٥٦٧٨٩", "٫").written("B-12.5") == "B-١٢٫٥"


def test_translations_ship_for_a_left_to_right_and_a_right_to_left_language() -> None:
    directions = {known.direction for tag in shipped() if (known := language(tag)) is not None}
    assert directions == {"ltr", "rtl"}
