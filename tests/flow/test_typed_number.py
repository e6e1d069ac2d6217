"""What somebody typed is read as the number it is, in any script, or refused in words; it is never made another."""

from __future__ import annotations

from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from study.flow.typed_number import Asked, number_of, numerals, same_number, sentence
from study.language.catalogue import words_for
from tests.support.typed_numbers import ALPHABET, READ, digits


@pytest.mark.parametrize(("typed", "expected"), READ.items())
def test_a_number_is_read_as_what_it_can_be(typed: str, expected: tuple[str, ...]) -> None:
    assert numerals(typed) == expected


def test_digits_of_every_script_count() -> None:
    every = digits()
    assert len(every) > 600
    assert {one: numerals(f"{one}.5") for one in every} == {one: (f"{plain}.5",) for one, plain in every.items()}


@given(st.text(ALPHABET, max_size=12))
def test_what_is_read_is_a_plain_number_with_the_digits_that_were_typed(typed: str) -> None:
    for numeral in numerals(typed):
        assert numerals(numeral)[0] == numeral
        assert same_number(typed, numeral)
        mantissa = numeral.partition("e")[0]
        plain = "".join(digits().get(one, one) for one in typed).lower().partition("e")[0]
        shown = [one for one in plain if one in "0123456789"]
        kept = [one for one in mantissa if one in "0123456789"]
        assert Decimal("".join(kept)) == Decimal("".join(shown))


@given(st.decimals(allow_nan=False, allow_infinity=False, places=3, min_value=-(10**9), max_value=10**9))
def test_a_number_written_plainly_is_that_number(number: Decimal) -> None:
    assert same_number(str(number), str(number))
    assert same_number(str(number).replace(".", ","), str(number))


@pytest.mark.parametrize(
    ("typed", "asked", "numeral", "flaw"),
    [
        ("1,234", Asked(), None, "ambiguous"),
        ("1.234", Asked(), "1.234", None),
        ("1,234", Asked(mark=","), "1.234", None),
        ("1.234", Asked(mark=","), None, "ambiguous"),
        ("\uff11\uff0c\uff12\uff13\uff14", Asked(), None, "ambiguous"),
        ("1,234.5", Asked(), "1234.5", None),
        ("12e", Asked(), None, "no_number"),
        ("1e400", Asked(), None, "too_large"),
        ("-1e400", Asked(), None, "too_large"),
        ("1e99999999999999999999", Asked(), None, "too_large"),
        ("1e-400", Asked(), None, "too_small"),
        ("0e5", Asked(), "0e5", None),
        ("3,5", Asked(whole=True), None, "not_whole"),
        ("3,0", Asked(whole=True), "3.0", None),
        ("17", Asked(least=18), None, "below"),
        ("18", Asked(least=18, most=99), "18", None),
        ("100", Asked(most=99), None, "above"),
    ],
)
def test_a_question_takes_one_number_or_says_why_not(
    typed: str, asked: Asked, numeral: str | None, flaw: str | None
) -> None:
    assert number_of(typed, asked) == (numeral, flaw)
    if flaw is not None:
        said = sentence(flaw, typed, asked)  # type: ignore[arg-type]  # one of the flaws
        assert f"“{typed}”" in said


def test_an_ambiguous_number_is_told_both_ways_and_how_to_write_it() -> None:
    said = sentence("ambiguous", "1,234", Asked())
    assert said == "“1,234” could be 1234 or 1.234. Please write . for decimals, and no mark between thousands."


def test_the_words_write_numbers_as_the_language_does() -> None:
    said = sentence("ambiguous", "1.234", Asked(mark="٫"), words_for("fa"))
    assert "۱۲۳۴" in said and "۱٫۲۳۴" in said
