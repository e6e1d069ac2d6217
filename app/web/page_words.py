"""The documents of our pages in the language of a study: their own texts, and the catalogue that their modules read.

A text in a document stands as `{{text}}`. The catalogue is data in the document itself, so that every module has it
when it runs and no request can go missing.
"""

from __future__ import annotations

import json
import re
from html import escape, unescape

from study.language.words import Words

TEXT = re.compile(r"\{\{(.+?)\}\}")
_CATALOGUE = ('    <script type="application/json" id="catalogue">', "</script>\n  </head>")


def in_language(html: str, words: Words) -> str:
    """The document with its texts in this language. A page with modules gets the catalogue too."""
    text = TEXT.sub(lambda match: escape(words.t(unescape(match[1]))), html)
    opening = f'<html lang="{escape(words.language)}" dir="{words.direction}">'
    text = text.replace('<html lang="en">', opening, 1)
    if words.texts or words.plurals or words.language != "en" or words.direction != "ltr":
        data = json.dumps(words.page(), ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
        text = text.replace("  </head>", data.join(_CATALOGUE), 1)
    return text
