"""What a translation lacks, and a file to fill in."""

from __future__ import annotations

import io
from dataclasses import dataclass

from app.texts.sources import Text, texts
from study.language.catalogue import REVIEWED, Catalogue, read, shipped_text
from study.language.locales import Language, language
from study.language.words import CONTEXT_END


@dataclass(frozen=True)
class Gaps:
    """What stands between a translation and the texts there are."""

    missing: tuple[Text, ...]
    """Texts that are shown in English."""
    unused: tuple[tuple[str, int], ...]
    """(text, line) of entries of none of the lab's texts: worded otherwise now, or shown by a part of one's own."""


def gaps(*catalogues: Catalogue) -> Gaps:
    """What the last of these translations, with those before it to fall back on, lacks and has too much."""
    known = {key for found in catalogues for key in (*found.texts, *found.plurals)}
    lines = catalogues[-1].lines if catalogues else {}
    missing = tuple(text for key, text in texts().items() if key not in known)
    unused = tuple((key.rpartition(CONTEXT_END)[2], line) for key, line in lines.items() if key not in texts())
    return Gaps(missing, unused)


def template(tag: str, before: str = "") -> str:
    """A translation into this language to fill in: PO, with all texts. `before` is one of an earlier version: what it
    translates stays, at the end what is none of the lab's texts, which a part of one's own may show. Without one,
    the translation that ships is there to be changed."""
    from babel import Locale
    from babel.messages.catalog import Catalog
    from babel.messages.pofile import read_po, write_po

    known = language(tag)
    assert known is not None, tag
    locale = Locale.parse(tag, sep="-")
    made = Catalog(locale=locale)
    text = before or shipped_text(tag)[1]
    old = read_po(io.BytesIO(text.encode()), locale=locale) if text else Catalog(locale=locale)
    made.mime_headers = [("Plural-Forms", old.plural_forms)]  # a file may count fewer forms than the language has
    for entry in texts().values():
        ids = entry.one if entry.many is None else (entry.one, entry.many)
        there = old.get(entry.one, entry.context)
        fits = there is not None and isinstance(there.id, str) == isinstance(ids, str)
        places = [(place.rpartition(":")[0] or place, 0) for place in entry.places]
        made.add(
            ids,
            there.string if there is not None and fits else None,
            locations=list(dict.fromkeys(places)),
            flags=there.flags if there is not None and fits else (),
            user_comments=there.user_comments if there is not None else (),
            context=entry.context,
        )
    for there in old:
        if there.id and made.get(there.id, there.context) is None:
            made.add(
                there.id, there.string, flags=there.flags, user_comments=there.user_comments, context=there.context
            )
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
