"""Forms: nothing is skipped silently, and what was typed is never changed."""

from __future__ import annotations

import random
import re
from typing import TYPE_CHECKING

import pytest

from study.flow.typed_number import numerals
from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import CONTENT
from tests.support.participant_page import opened, visible
from tests.support.typed_numbers import ALPHABET, READ, digits

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def test_wrong_comprehension_answers_are_told_beside_their_questions(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "instructions")
    for question in CONTENT["instructions"]["questions"]:
        page.get_by_test_id(f"question-{question['id']}").get_by_role("radio").first.check()
    lab.refuses["instructions"] = [
        {"code": "invalid", "field": f"answers.{name}", "message": "Not quite: please read the text again."}
        for name in ("which_object", "on_sound")
    ]
    page.get_by_test_id("instructions-submit").click()
    for name, wrong in (("which_object", True), ("on_sound", True), ("robot_moves", False)):
        error = page.get_by_test_id(f"question-{name}").locator(".field-error")
        error.wait_for(state="visible" if wrong else "hidden")
    assert page.get_by_test_id("toast-problem").count() == 0
    page.get_by_label("The one named on the page").check()
    page.get_by_label("Type the reading within 20 seconds").check()
    mark = lab.mark()
    page.get_by_test_id("instructions-submit").click()
    given = lab.wait_submit("instructions", after=mark)["data"]["answers"]
    assert given == {"which_object": "named", "on_sound": "log", "robot_moves": "obeys"}
    visible(page, "page-practice_ready")


def test_demographics_asks_for_what_is_required_and_leaves_the_rest(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "demographics")
    page.get_by_label("25 to 34").check()
    page.get_by_test_id("demographics-submit").click()
    missing = page.get_by_test_id("question-gaming_experience")
    missing.locator(".field-error").wait_for(state="visible")
    assert missing.evaluate("(element) => element.contains(document.activeElement)")
    page.get_by_label("Every week").check()
    page.get_by_label(re.compile("Hours of games")).fill("3.5")
    page.get_by_test_id("demographics-submit").click()
    given = lab.wait_submit("demographics")["data"]["answers"]
    assert given == {"age_group": "b", "gaming_experience": "weekly", "hours": "3.5"}


def test_the_pages_read_numbers_as_the_lab_does(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "consent")
    read = """async (all) => {
      const { numerals } = await import("/static/common/typed_number.js");
      return all.map(numerals);
    }"""
    rng = random.Random(1)
    strings = ["".join(rng.choices(ALPHABET, k=rng.randint(1, 9))) for _ in range(3000)]
    every = [*READ, *strings, *(f"{one}.5" for one in digits())]
    assert sum(bool(numerals(one)) for one in strings) > 100
    told = dict(zip(every, page.evaluate(read, every), strict=True))
    assert told == {one: list(numerals(one)) for one in every}


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("12e", "“12e” is not a number. Please write it in digits alone"),
        ("1-2", "“1-2” is not a number."),
        ("1e400", "“1e400” is too large."),
        ("1,234", "“1,234” could be 1234 or 1.234."),
        (" ", "This holds blanks alone."),
        ("-1", "“-1” is below 0, the least that is taken."),
        ("169", "“169” is above 168, the most that is taken."),
    ],
)
def test_a_number_is_never_changed_it_is_taken_or_refused_beside_it(
    page: Page, lab: FakeLab, typed: str, said: str
) -> None:
    opened(page, lab, "demographics")
    page.get_by_label("25 to 34").check()
    page.get_by_label("Every week").check()
    hours = page.get_by_label(re.compile("Hours of games"))
    hours.press_sequentially(typed)
    page.get_by_test_id("demographics-submit").click()
    error = page.get_by_test_id("question-hours").locator(".field-error")
    error.wait_for(state="visible")
    assert said in error.inner_text()
    assert hours.input_value() == typed
    assert not lab.submits("demographics")
    page.reload()
    visible(page, "page-demographics")
    assert hours.input_value() == typed
    hours.fill("")
    hours.press_sequentially("3,5")
    page.get_by_test_id("demographics-submit").click()
    assert lab.wait_submit("demographics")["data"]["answers"]["hours"] == "3,5"


def test_words_are_sent_as_they_stand_and_too_many_are_not_cut_off(page: Page, lab: FakeLab) -> None:
    lab.welcome["words_limit"] = 30
    opened(page, lab, "demographics")
    page.get_by_label("25 to 34").check()
    page.get_by_label("Every week").check()
    job = page.get_by_label(re.compile("What do you do"))
    error = page.get_by_test_id("question-job").locator(".field-error")
    for words, said in (("👍" * 31, "31 characters, and at most 30"), ("a\x1bb", "U+001B"), ("   ", "blanks alone")):
        job.fill(words)
        page.get_by_test_id("demographics-submit").click()
        error.get_by_text(said).wait_for()
        assert job.input_value() == words
    words = f"  {'👍' * 26}  "
    job.fill(words)
    page.get_by_test_id("demographics-submit").click()
    assert lab.wait_submit("demographics")["data"]["answers"]["job"] == words
    page.get_by_test_id("help-button").click()
    box = page.get_by_test_id("help-dialog").get_by_role("textbox")
    box.fill("x" * 31)
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_test_id("help-dialog").get_by_text("31 characters, and at most 30").wait_for()
    box.fill(" two\nlines ")
    page.get_by_test_id("dialog-confirm").click()
    assert lab.wait_submit("help")["data"] == {"text": " two\nlines "}


def test_a_survey_skips_nothing_silently_and_keeps_answers_over_a_reload(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "survey")
    items = [
        (instrument["id"], item["id"])
        for instrument in CONTENT["survey"]["instruments"]
        for item in instrument["items"]
    ]
    for index, (instrument, item) in enumerate(items):
        if index != 3:
            page.locator(f"input[name='{instrument}.{item}'][value='{index % 7 + 1}']").check()
    page.reload()
    visible(page, "page-survey")
    assert page.get_by_test_id("survey-progress").inner_text() == "15 of 16 answered"
    page.get_by_test_id("survey-submit").click()
    assert "One question is not answered yet" in page.get_by_test_id("survey-missing").inner_text()
    gap = page.get_by_test_id(f"item-{items[3][0]}.{items[3][1]}")
    assert gap.get_by_text("Please choose an answer.").is_visible()
    assert gap.evaluate("(element) => element.contains(document.activeElement)")
    page.keyboard.press("ArrowRight")  # from the first, focused and not chosen, to the second: by keyboard alone
    page.get_by_test_id("survey-submit").click()
    answers = lab.wait_submit("survey")["data"]["answers"]
    assert {(instrument, item) for instrument, given in answers.items() for item in given} == set(items)
    for index, (instrument, item) in enumerate(items):
        assert answers[instrument][item] == (2 if index == 3 else index % 7 + 1)
