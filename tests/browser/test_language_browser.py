"""The pages in the language of a study: both sides put the same words and numbers together."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from study.language.catalogue import words_for
from study.language.words import Words
from tests.support.fake_lab import FakeLab

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")

ENTRIES = """
msgid "{n} of {all}"
msgstr "{all}: {n}"

msgctxt "direction"
msgid "left"
msgstr "<nach> links"

msgid "one"
msgid_plural "{n} things"
"""
FORMS = {
    "de": "nplurals=2; plural=(n != 1)",
    "ar-EG": "nplurals=6; plural=(n==0 ? 0 : n==1 ? 1 : n==2 ? 2 : n%100>=3 && n%100<=10 ? 3 : n%100>=11 ? 4 : 5)",
    "fa": "nplurals=2; plural=(n > 1)",
}


def own_words(tag: str) -> Words:
    count = int(FORMS[tag].removeprefix("nplurals=")[0])
    forms = "".join(f'msgstr[{place}] "form {place}: {{n}}"\n' for place in range(count))
    return words_for(tag, own=f'msgid ""\nmsgstr ""\n"Plural-Forms: {FORMS[tag]};\\n"\n{ENTRIES}{forms}')


@pytest.fixture
def lab() -> Iterator[FakeLab]:
    with FakeLab() as running:
        yield running


@pytest.mark.parametrize("tag", sorted(FORMS))
def test_a_page_says_what_the_lab_would_say(page: Page, lab: FakeLab, tag: str) -> None:
    words = lab.words = own_words(tag)
    page.goto(lab.participant_url)
    page.get_by_test_id("page-consent").wait_for()
    html = page.locator("html")
    assert (html.get_attribute("lang"), html.get_attribute("dir")) == (tag, words.direction)
    numbers = [*range(12), 99, 100, 101, 1000, 12345]
    said: dict[str, Any] = page.evaluate(
        """async (numbers) => {
          const { t, tn, tc, number, numeral } = await import("/static/common/language.js");
          return {
            filled: t("{n} of {all}", { n: 1.5, all: "USB" }),
            open: t("{n} of {all}", {}),
            unknown: t("no such text {n}", { n: -3 }),
            context: tc("direction", "left"),
            counted: numbers.map((n) => tn("one", "{n} things", n)),
            unknown_count: numbers.map((n) => tn("a", "{n} b", n)),
            written: [number(-601.7, 2), number(12345), number(0.25)],
            numerals: ["0482.10", "-5", "B", "1.2.3"].map(numeral),
          };
        }""",
        numbers,
    )
    assert said == {
        "filled": words.t("{n} of {all}", n=1.5, all="USB"),
        "open": words.t("{n} of {all}"),
        "unknown": words.t("no such text {n}", n=-3),
        "context": "<nach> links",
        "counted": [words.tn("one", "{n} things", n) for n in numbers],
        "unknown_count": [words.tn("a", "{n} b", n) for n in numbers],
        "written": [words.number(-601.7, 2), words.number(12345), words.number(0.25)],
        "numerals": [words.signs.written("0482.10"), words.signs.written("-5"), "B", "1.2.3"],
    }, json.dumps(said, ensure_ascii=False)
