"""Every text that a participant may read, with the places where it stands."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from html import unescape
from pathlib import Path

from app.static_folder import STATIC
from sim.view.viewpoints import VIEWS
from study.definition.layouts import all_shipped_objects, shipped_layouts
from study.language.words import CONTEXT_END

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("common", "wire", "hands", "readings", "participant", "panel", "join")
"""Of static/: the pages that participants see. The dashboard is the experimenter's, and English."""
DOCUMENTS = ("participant.html", "panel.html", "join.html", "forbidden.html")
KEYWORDS = {"t": None, "tn": (1, 2), "tc": ((1, "c"), 2), "phrase": None}
"""What marks a text, as Babel's extraction takes it."""
_IN_DOCUMENT = re.compile(r"\{\{(.+?)\}\}")


@dataclass(frozen=True)
class Text:
    """One text to be translated."""

    one: str
    """The text; of one about a number, the singular."""
    many: str | None = None
    """The plural."""
    context: str | None = None
    places: tuple[str, ...] = ()
    """`file:line` from the root of the repository."""

    @property
    def key(self) -> str:
        """As catalogues have it."""
        return f"{self.context}{CONTEXT_END}{self.one}" if self.context else self.one


def scripts() -> list[Path]:
    """The modules of the participant's pages."""
    return sorted(path for room in ROOMS for path in (STATIC / room).rglob("*.js"))


@lru_cache(maxsize=1)
def texts() -> dict[str, Text]:
    """All of them by key, in the order of the sources."""
    found: dict[str, Text] = {}
    for text in _all():
        known = found.setdefault(text.key, text)
        if known is not text:
            found[text.key] = replace(known, many=known.many or text.many, places=(*known.places, *text.places))
    return found


def _all() -> Iterator[Text]:
    for name in DOCUMENTS:
        source = (STATIC / name).read_text(encoding="utf-8")
        for match in _IN_DOCUMENT.finditer(source):
            line = source.count("\n", 0, match.start()) + 1
            yield Text(unescape(match[1]), places=(f"static/{name}:{line}",))
    for path in scripts():
        yield from marked("javascript", path)
    for folder in ("study", "app"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield from marked("python", path)
    yield from _labels()


def marked(language: str, path: Path) -> Iterator[Text]:
    """The texts marked in one source."""
    from babel.messages.extract import extract_from_file

    where = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
    how = {"parse_template_string": True} if language == "javascript" else {}
    for line, message, _, context in extract_from_file(language, path, keywords=KEYWORDS, options=how):
        one, many = message if isinstance(message, tuple) else (message, None)
        yield Text(one, many, context, (f"{where}:{line}",))


def _labels() -> Iterator[Text]:
    """The words for what ships: objects, bins and camera views."""
    objects = all_shipped_objects().values()
    yield from _of("study/definition/shipped_objects.toml", (item.label for item in objects))
    for name, layout in shipped_layouts().items():
        yield from _of(f"study/definition/shipped_layouts/{name}.toml", (item.label for item in layout.bins))
    yield from _of("sim/view/viewpoints.py", (view.label for view in VIEWS.values()))


def _of(place: str, labels: Iterable[str]) -> Iterator[Text]:
    for label in labels:
        yield Text(label, places=(place,))
