"""`salab texts`, and what `salab check` says of a translation: the lab's texts in the participants' language."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.groups import STUDY_FILE
from app.commands.options import file as file_option
from app.errors import LabError

if TYPE_CHECKING:
    from study.definition.study import Study

commands = typer.Typer()

LISTED = 40
"""So many lines of what a translation lacks are told."""


@commands.command(rich_help_panel=STUDY_FILE, epilog="Example: salab texts --language fr --out my-study.fr.po")
def texts(
    language: Annotated[str, typer.Option(metavar="TAG", help="the language, such as fr or pt-BR")],
    out: Annotated[Path | None, file_option("where; texts.TAG.po if not given")] = None,
) -> None:
    """Write the participant's texts as a gettext file to translate.

    What the file translates already stays, and what is new is added. Name it in the study file with `translation`,
    beside `language`.
    """
    from app.texts.translating import gaps, template
    from study.definition.translations import MOST_BYTES
    from study.language import locales
    from study.language.catalogue import read
    from study.text_file import read_text

    known = locales.language(language)
    if known is None:
        raise LabError(f"--language {language}: no such language is known; give a tag such as fr or pt-BR")
    file = out or Path(f"texts.{language}.po")
    try:
        before = read_text(file, MOST_BYTES) if os.path.lexists(file) else ""
        mistakes = read(before, language).mistakes if before else ()
        if mistakes:
            lines = "; ".join(f"line {mistake.line}: {mistake.sentence}" for mistake in mistakes)
            raise LabError(f"{file}: {lines}. Mend it first")
        text = template(language, before)
        file.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise LabError(f"{file}: cannot be written: {error.strerror or error}") from None
    left = len(gaps(read(text, language)).missing)
    print(
        f"wrote {file}: the lab's texts in {known.name}, {left} of them still to translate. Next:\n"
        f"  translate them with any editor for PO files, such as Poedit\n"
        f'  language = "{language}" and translation = "{file.name}" in the study file beside it\n'
        f"  salab check on that study file tells what is missing or wrong"
    )


def notes_on_texts(study: Study, file: Path) -> Iterator[str]:
    """What the study's translation lacks or has too much, and whether anybody has checked it. Nothing for English."""
    from app.texts.translating import gaps
    from study.language.catalogue import Catalogue, read, shipped_text

    name, text = shipped_text(study.language)
    if not text and not study.translations:
        return
    ships = read(text, name) if name else Catalogue()
    own = next((read(one.text, study.language) for one in study.translations), Catalogue())
    where = str(file.with_name(study.translation)) if study.translation else f"the translation into {name} that ships"
    lacks = gaps(ships, own)
    told = []
    if study.language.partition("-")[0] != "en":
        for missing in lacks.missing:
            told.append(f"{where}: {missing.one!r} ({missing.places[0]}) is not translated, and is shown in English")
    for key, line in lacks.unused:
        told.append(f"{where}:{line}: {key!r} is no text of this version of the lab")
    yield from told[:LISTED]
    if len(told) > LISTED:
        yield f"{where}: and {len(told) - LISTED} more like these"
    shown = {*ships.texts, *ships.plurals} - {*own.texts, *own.plurals}
    is_checked = (own.reviewed or not own.lines) and (ships.reviewed or not shown)
    if not is_checked:
        yield (
            f"{where}: not reviewed for data. Have somebody whose first language it is read every page, then say so in "
            f"the header of a file of your own, which salab texts --language {study.language} writes: "
            "X-Reviewed-For-Data: NAME, DATE"
        )
