"""What a translation lacks, and a file to fill in."""

from __future__ import annotations

import io
from dataclasses import dataclass

from app.texts.sources import Text, texts
from study.language.catalogue import REVIEWED, Catalogue, read, shipped_text
from study.language.locales import Language, language


@dataclass(frozen=True)
class Gaps:
    """What stands between a translation and the texts there are."""

    missing: tuple[Text, ...]
    """Texts that are shown in English."""
    unused: tuple[tuple[str, int], ...]
    """(text, line) of entries that nothing shows: the text is worded otherwise now, or a part of one's own shows it."""


def gaps(*catalogues: Catalogue) -> Gaps:
    """What the last of these translations, with those before it to fall back on, lacks and has too much."""
    known = {key for found in catalogues for key in (*found.texts, *found.plurals)}
    lines = catalogues[-1].lines if catalogues else {}
    missing = tuple(text for key, text in texts().items() if key not in known)
    unused = tuple((key.rpartition("\x04")[2], line) for key, line in lines.items() if key not in texts())
    return Gaps(missing, unused)


def template(tag: str, before: str = "") -> str:
    """A translation into this language to fill in: PO, with all texts. `before` is one of an earlier version, whose
    translations stay; else those of the translation that ships are there to be changed."""
    from babel import Locale
    from babel.messages.catalog import Catalog
    from babel.messages.pofile import read_po, write_po

    known = language(tag)
    assert known is not None, tag
    locale = Locale.parse(tag, sep="-")
    made = Catalog(locale=locale)
    text = before or shipped_text(tag)[1]
    old = read_po(io.BytesIO(text.encode()), locale=locale) if text else None
    for key, entry in texts().items():
        ids = entry.one if entry.many is None else (entry.one, entry.many)
        there = old.get(entry.one, entry.context) if old is not None else None
        fits = there is not None and isinstance(there.id, str) == isinstance(ids, str)
        places = [(place.rpartition(":")[0] or place, 0) for place in entry.places]
        made.add(
            ids,
            there.string if there is not None and fits else None,
            locations=list(dict.fromkeys(places)),
            flags=there.flags - {"python-format"} if there is not None and fits else (),
            context=entry.context,
        )
        assert key
    out = io.BytesIO()
    write_po(out, made, width=0, omit_header=True, include_lineno=False)
    return _header(known, read(text, tag).reviewed if text else "", made.plural_forms) + out.getvalue().decode()


def _header(known: Language, reviewed: str, plural_forms: str) -> str:
    return f"""\
# The lab's texts for participants in {known.name}. {{name}} stands for something that is filled in: keep it as it is.
# An empty translation is shown in English. Whoever has checked the file for use with participants writes their name
# and the date into {REVIEWED}; until then salab check warns.
msgid ""
msgstr ""
"Project-Id-Version: Shared Autonomy Lab\\n"
"Language: {known.tag}\\n"
"MIME-Version: 1.0\\n"
"Content-Type: text/plain; charset=utf-8\\n"
"Content-Transfer-Encoding: 8bit\\n"
"Plural-Forms: {plural_forms}\\n"
"{REVIEWED}: {reviewed or "no"}\\n"

"""
