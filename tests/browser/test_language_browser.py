"""The pages in the language of a study: both sides put the same words and numbers together."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from app.texts.sources import texts
from study.language.catalogue import words_for
from study.language.words import Words
from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import alert, instruction, tick

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


# ---- nothing on any page is English when the study is not

MARKED = re.compile(r"⟦[^⟦⟧]*⟧")
NOT_WORDS = {"type", "kind", "id", "object", "bin", "name", "hash", "placement", "scene", "status", "entry", "gripper"}
"""Keys of messages whose values nobody reads."""
TEXTS = """() => {
  const found = [["title", document.title]];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT | NodeFilter.SHOW_ELEMENT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    if (node.nodeType === Node.TEXT_NODE) {
      if (!node.parentElement.closest("script, style, noscript, .boot")) found.push(["text", node.data]);
      continue;
    }
    for (const name of ["aria-label", "title", "placeholder", "alt"])
      if (node.hasAttribute(name)) found.push([name, node.getAttribute(name)]);
  }
  return found.map(([where, text]) => [where, text.trim()]).filter(([, text]) => text);
}"""


def marked_words() -> Words:
    """Every text there is, in marks instead of a language."""
    singular = {key: f"⟦{text.one}⟧" for key, text in texts().items() if text.many is None}
    counted = {key: {"one": f"⟦{text.one}⟧", "other": f"⟦{text.many}⟧"} for key, text in texts().items() if text.many}
    return Words("de", "ltr", singular, counted)


def marked(value: Any, key: str = "") -> Any:
    """A message whose words are marked as the study's own."""
    if isinstance(value, dict):
        return {name: marked(inner, name) for name, inner in value.items()}
    if isinstance(value, list):
        return [marked(inner, key) for inner in value]
    return f"⟦{value}⟧" if isinstance(value, str) and key not in NOT_WORDS and " " in value.strip() + " " else value


NAMES = re.compile(r"\b(?:Enter|PgUp|PgDn|Tab|Ctrl|Chrome|Edge|Firefox|WebGL|JavaScript|HTTPS|https|VPN|QR)\b")
"""What has this name in every language."""


def english_on(page: Page) -> list[tuple[str, str]]:
    """What on the page stands in no marks, is no name, and has two letters of English in a row."""
    left = []
    for where, text in page.evaluate(TEXTS):
        rest, before = text, ""
        while rest != before:  # a text within a text
            rest, before = MARKED.sub("", rest), rest
        if re.search(r"[A-Za-z]{2,}", NAMES.sub("", rest)):
            left.append((where, text))
    return left


@pytest.fixture
def marked_lab(page: Page) -> Iterator[FakeLab]:
    with FakeLab() as running:
        running.words = marked_words()
        running.welcome["study_title"] = "⟦study⟧"
        running.content = {
            state: {**marked(content), **{key: content[key] for key in ("checks", "causes", "views") if key in content}}
            for state, content in running.content.items()
        }
        for content in running.content.values():
            for view in content.get("views", ()):
                view["label"] = f"⟦{view['label'].strip('⟦⟧')}⟧"
        yield running


STATES = [
    *("eligibility", "consent", "demographics", "setup", "instructions", "practice_ready", "practice", "trial_ready"),
    *("trial", "survey", "break", "paused", "debrief", "done", "withdrawn", "aborted", "screened_out"),
]


@pytest.mark.parametrize("tag", ["", "ar"], ids=["marked", "ar"])
def test_no_page_has_a_word_of_its_own(page: Page, marked_lab: FakeLab, tag: str) -> None:
    lab = marked_lab
    if tag:
        lab.words = words_for(tag)
    lab.state = "eligibility"
    page.goto(lab.participant_url)
    found: dict[str, list[tuple[str, str]]] = {}

    def look(name: str) -> None:
        left = english_on(page)
        if left:
            found[name] = left

    for state in STATES:
        lab.show(state)
        driving = state.startswith(("practice", "trial")) or state == "paused"
        page.get_by_test_id("page-drive" if driving and state != "paused" else f"page-{state}").wait_for()
        look(state)
        if state in ("consent", "demographics", "instructions", "survey"):
            page.locator("form button[type=submit]").first.click()
            look(f"{state}, nothing answered")
        if state == "setup":
            page.get_by_test_id("setup-submit").click()
            look("setup, nothing chosen")
            for device in ("keyboard", "gamepad"):
                page.get_by_test_id(f"device-{device}").click()
                look(f"setup, {device}")
        if state == "trial":
            task = marked(instruction("dropoff", "spray_bottle", "left_bin"))
            for cause, ways in (("touches", ["up", "open"]), ("limit", ["back"])):
                hint = {"cause": cause, "ways": ways}
                lab.send(tick(1, blocked=True, hint=hint, gripper="closed", assisting=True, instruction=task))
                page.locator("[data-testid=drive-hint].shown").wait_for()
                look(f"hint, {cause}")
            for status in ("held", "recovering", "starting", "running"):
                lab.send({"type": "status", "status": status})
                page.locator(f"[data-testid=state-sign][data-state={status}]").wait_for()
                look(f"status, {status}")
            lab.send(alert(1))
            page.get_by_test_id("alert-input").wait_for()
            look("a reading")
            page.get_by_test_id("alert-submit").click()
            look("a reading, nothing typed")
            page.get_by_test_id("alert-input").fill("12x")
            page.get_by_test_id("alert-submit").click()
            look("a reading, no number")
            lab.send({"type": "alert_closed", "alert": 1, "status": "expired", "release_in_s": 0.0})
            page.get_by_test_id("alert").wait_for(state="hidden")
            look("a reading, too late")
            for button in ("help-button", "stop-button"):
                page.get_by_test_id(button).click()
                look(button)
                page.get_by_test_id("dialog-back").click()
    assert not found, json.dumps(found, indent=1, ensure_ascii=False)


def test_no_word_of_the_second_device_or_of_a_refused_link_is_its_own(page: Page, marked_lab: FakeLab) -> None:
    lab = marked_lab
    lab.welcome["placement"] = "second_device"
    lab.state = "trial"
    page.goto(lab.panel_url)
    page.get_by_test_id("panel-locked").wait_for()
    assert not english_on(page)
    page.get_by_test_id("panel-start").click()
    page.locator("[data-testid=connection][data-state=open]").wait_for()
    assert not english_on(page)
    lab.send(alert(1), "panel")
    page.get_by_test_id("alert-input").wait_for()
    assert not english_on(page)
    lab.show("done")
    page.get_by_test_id("panel-ended").wait_for()
    assert not english_on(page)
    page.goto(f"{lab.base_url}/forbidden")
    assert [text for _, text in english_on(page)] == ["Shared Autonomy Lab"]


def test_a_reading_is_written_as_the_language_does(page: Page, lab: FakeLab) -> None:
    lab.words = words_for("ar-EG")
    lab.state = "trial"
    page.goto(lab.participant_url)
    page.get_by_test_id("page-drive").wait_for()
    lab.send(tick(0))
    lab.send(alert(1, "0482.10"))
    page.get_by_test_id("alert-input").wait_for()
    assert page.get_by_test_id("alert-reading").inner_text() == "٠٤٨٢٫١٠"
    page.get_by_test_id("alert-input").fill("٤٨٢٫١")
    page.get_by_test_id("alert-submit").click()
    assert lab.wait_submit("alert_answer")["data"] == {"alert": 1, "value": "٤٨٢٫١"}


def test_left_stays_left_and_time_runs_the_other_way(page: Page, lab: FakeLab) -> None:
    lab.words = words_for("ar")
    lab.state = "trial"
    page.goto(lab.participant_url)
    page.get_by_test_id("page-drive").wait_for()
    lab.send(tick(0))
    box = page.get_by_test_id("scene").bounding_box()
    side = page.locator(".side").bounding_box()
    assert box is not None and side is not None and side["x"] < box["x"]
    keys = page.locator(".legend-box tr", has_text="A").first.locator("kbd")
    left, right = keys.nth(0).bounding_box(), keys.nth(1).bounding_box()
    assert left is not None and right is not None and left["x"] < right["x"]
    page.locator(".drive-scene").focus()
    page.keyboard.down("KeyA")
    pushed = lab.wait_for(lambda m: m["type"] == "input" and m["direction"] is not None)
    page.keyboard.up("KeyA")
    assert pushed["direction"] == [0, 1, 0]
    lab.send(alert(1))
    page.get_by_test_id("alert-input").wait_for()
    assert page.locator(".bar-fill").evaluate("bar => getComputedStyle(bar).transformOrigin.split(' ')[0] !== '0px'")
