"""Every text that a participant may read goes through the catalogue."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.texts.sources import DOCUMENTS, ROOT, marked, scripts, texts
from study.language.words import PLACEHOLDER
from tests.texts.literals import untranslated


@pytest.mark.parametrize("path", scripts(), ids=lambda path: str(path.relative_to(ROOT / "static")))
def test_every_visible_word_of_a_page_can_be_translated(path: Path) -> None:
    found = untranslated(path.read_text(encoding="utf-8"))
    listed = "\n".join(f"{path.relative_to(ROOT)}:{line}: {text!r}" for line, text in found)
    assert not found, f"these words are English in every language; put them into t(…), tn(…) or tc(…):\n{listed}"


@pytest.mark.parametrize(
    ("source", "seen"),
    [
        ('h("p", {}, "Press any button")', True),
        ('h("p", {}, t("Press any button"))', False),
        ('h("p", { class: "field inline", title: "Press any button" })', True),
        ('h("p", { class: now ? "stage now" : "stage" })', False),
        ("setText(words, `Round ${trial} of ${trials}`)", True),
        ('setText(words, t("Round {trial}", { trial }))', False),
        ('const label = on ? "Saved" : "Saving";', True),
        ('const label = on ? t("Saved") : t("Saving");', False),
        ('button.className = past ? "dot past" : "dot";', False),
        ('throw new Error("a sentence for developers");', False),
        ('console.warn("a sentence for developers")', False),
        ('document.querySelector("dialog[open] button");', False),
        ('tn("One question.", "{n} questions.", count)', False),
        ('h("path", { d: "M4 3 L5 6Z" })', False),
    ],
)
def test_words_that_no_translation_reaches_are_found(source: str, seen: bool) -> None:
    assert bool(untranslated(source)) is seen


def test_documents_have_no_words_of_their_own() -> None:
    """Beside those in `{{…}}`, and the name of the lab."""
    for name in DOCUMENTS:
        assert not list(_words_in((ROOT / "static" / name).read_text(encoding="utf-8"))), name


def _words_in(html: str) -> Iterator[str]:
    from html.parser import HTMLParser

    found: list[str] = []

    class Reader(HTMLParser):
        def handle_data(self, data: str) -> None:
            text = data.strip()
            if text and text != "Shared Autonomy Lab" and not (text.startswith("{{") and text.endswith("}}")):
                found.append(text)

    Reader().feed(html)
    yield from found


def test_texts_are_read_from_all_kinds_of_sources(tmp_path: Path) -> None:
    keys = texts()
    title, heading = keys["This link does not work"].places
    assert title == "static/forbidden.html:6" and heading.startswith("static/forbidden.html:")
    assert any(place.startswith("static/participant/views/consent.js:") for place in keys["Agree and continue"].places)
    assert keys["spray bottle"].places == ("study/definition/shipped_objects.toml",)
    assert "left bin" in keys
    assert keys["You are taken there in one second."].many == "You are taken there in {n} seconds."
    assert "Open the dashboard" not in keys  # English, for the experimenter
    module = tmp_path / "module.js"
    module.write_text('tc("direction", "left"); t("a\\"b");\n tn(\n  "one",\n  "{n} of {all}", n);', encoding="utf-8")
    assert [(text.key, text.many, text.context) for text in marked("javascript", module)] == [
        ("direction\x04left", None, "direction"),
        ('a"b', None, None),
        ("one", "{n} of {all}", None),
    ]


def test_placeholders_are_spelled_as_both_sides_read_them() -> None:
    for text in texts().values():
        for form in (text.one, text.many or ""):
            assert form.count("{") == form.count("}") == len(PLACEHOLDER.findall(form)), text.places
