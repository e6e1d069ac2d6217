"""What holds of every page: it fits the screen, and makes no markup from strings."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from tests.support.fake_lab import STATIC, FakeLab
from tests.support.fake_pages import CONTENT
from tests.support.participant_page import visible

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.usefixtures("no_script_errors")


def test_pages_fit_both_screens_without_scrolling_sideways(page: Page, lab: FakeLab) -> None:
    page.goto(lab.participant_url)
    for width, height in ((1280, 720), (1920, 1080)):
        page.set_viewport_size({"width": width, "height": height})
        for state in CONTENT:
            lab.show(state)
            name = "page-drive" if state in ("practice", "trial") else f"page-{state}"
            visible(page, name)
            if state == "practice":  # the longest words
                longest = "Practice: move the practice block to another place on the table and let go."
                told = {**CONTENT["practice"]["instruction"], "text": longest}
                lab.send(told)
                page.get_by_text(longest).wait_for()
            wide, tall, side = page.evaluate(
                """() => { const e = document.documentElement, s = document.querySelector(".side");
                     return [e.scrollWidth, e.scrollHeight, s ? s.scrollHeight - s.clientHeight : 0]; }"""
            )
            assert wide <= width, f"{state} is {wide} wide"
            if page.get_by_test_id("page-drive").count():
                assert tall <= height and side <= 0, f"{state} does not fit {width}x{height}"


def test_no_page_makes_markup_from_strings_or_asks_another_host() -> None:
    for path in sorted(path for path in STATIC.rglob("*") if path.is_file()):
        text = path.read_text(encoding="utf-8")
        assert len(text.splitlines()) < 400, path.name
        found = re.findall(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(", text)
        assert found == [], path.name
        hosts = set(re.findall(r"https?://([\w.-]+)", text)) - {"www.w3.org"}
        assert hosts == set(), path.name
