"""Every text that a participant may read goes through the catalogue."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.texts.sources import DOCUMENTS, ROOT, marked, scripts, texts
from app.texts.translating import gaps, template
from study.language.catalogue import read, shipped, shipped_text
from study.language.words import PLACEHOLDER
from tests.texts.literals import keys_in, untranslated


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


def test_every_marked_text_is_found() -> None:
    """Where it stands in a template or an f-string too, which tools may pass over."""
    known = set(texts())
    for path in scripts():
        for line, key in keys_in(path.read_text(encoding="utf-8")):
            assert key in known, f"{path.relative_to(ROOT)}:{line}: {key!r} is marked, and no tool finds it there"
    for folder in ("app", "study"):
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
                    called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                    if called in ("t", "tn", "phrase"):
                        where = f"{path.relative_to(ROOT)}:{node.lineno}"
                        assert node.args[0].value in known, f"{where}: {node.args[0].value!r} is found by no tool"


@pytest.mark.parametrize("tag", shipped())
def test_the_translations_that_ship_are_complete(tag: str) -> None:
    name, text = shipped_text(tag)
    found = read(text, name)
    lacks = gaps(found)
    assert not found.mistakes
    missing = "\n".join(f"{text.places[0]}: {text.one!r}" for text in lacks.missing)
    assert not missing, f"study/language/catalogues/{tag}.po lacks texts (salab texts adds the entries):\n{missing}"
    assert not lacks.unused, f"study/language/catalogues/{tag}.po has texts that nothing shows: {lacks.unused}"
    assert found.reviewed == "", "whoever reviews a translation says so here too"


def test_a_template_keeps_what_is_translated_and_adds_the_rest() -> None:
    before = read(shipped_text("de")[1], "de")
    again = read(template("de"), "de")
    assert (again.texts, again.plurals) == (before.texts, before.plurals)
    french = read(template("fr"), "fr")
    assert french.texts == {} and french.mistakes == () and set(french.lines) == set(texts())


FOR_PARTICIPANTS = ("study/flow", "app/session", "app/web/join_api.py")
FOR_EXPERIMENTERS = {
    *("commands.py", "explanation.py", "notes.py", "quality.py", "overview.py", "roster.py", "contract.py"),
    *("saving.py", "reconcile.py"),
}
"""Modules there whose sentences are shown on the dashboard, told to whoever writes a study, or in the reference."""
SENTENCE = re.compile(r"^[A-Z“][^A-Z]*[a-z]+[,:]? [a-z]")


def sentences(source: str) -> list[tuple[int, str]]:
    """(line, text) of what begins as a sentence does and is neither translated nor a docstring. Problems for whoever
    writes a page go on from a field's name, and begin with a small letter."""
    tree = ast.parse(source)
    passed: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            passed.add(id(node.value))
        if isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in ("t", "tn", "phrase", "column", "Field", "compile") or called.endswith(("Error", "NotNow")):
                passed |= {id(inner) for inner in ast.walk(node)}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr) and id(node) not in passed:
            text = "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
            passed |= {id(part) for part in node.values}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in passed:
            text = node.value
        else:
            continue
        if SENTENCE.match(text):
            found.append((node.lineno, text))
    return found


def test_every_sentence_that_the_lab_says_to_participants_can_be_translated() -> None:
    told = []
    for place in FOR_PARTICIPANTS:
        path = ROOT / place
        for module in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            if module.name not in FOR_EXPERIMENTERS:
                found = sentences(module.read_text(encoding="utf-8"))
                told += [f"{module.relative_to(ROOT)}:{line}: {text!r}" for line, text in found]
    assert not told, "English in every language; put it into words.t(…), or phrase(…) in a table:\n" + "\n".join(told)


def test_a_sentence_that_no_translation_reaches_is_found() -> None:
    assert sentences('x = "The robot stands still."') == [(1, "The robot stands still.")]
    assert sentences('x = f"The {robot} stands still."') == [(1, "The {} stands still.")]
    assert sentences('x = words.t("The robot stands still."); y = phrase("It goes on.")') == []
    assert sentences('"""The robot stands still."""\nraise StudyError("The robot stands still.")') == []
    assert sentences('x = "must be a text"; y = "Content-Type"; z = {"Label": 1}') == []


def test_placeholders_are_spelled_as_both_sides_read_them() -> None:
    for text in texts().values():
        for form in (text.one, text.many or ""):
            assert form.count("{") == form.count("}") == len(PLACEHOLDER.findall(form)), text.places
