"""`salab backup` and `salab restore`: a copy of the data while a lab runs, and the way back."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.console import shown
from app.commands.groups import DATA
from app.commands.options import folder
from app.config import LabConfig
from app.errors import LabError
from study.store import DataPlace

DATA_DIR = LabConfig().data_dir
COPIED = "as recorded; every chain ends as in the original"

commands = typer.Typer()


@commands.command(rich_help_panel=DATA, epilog="Example: salab backup backups/monday --data data")
def backup(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", parser=options.place, help="folder to make", show_default=False)
    ],
    data: Annotated[
        DataPlace, options.data("folder of the database, or address of one; a lab may be running on it")
    ] = LabConfig().data,
    own_folder: Annotated[Path | None, options.own_folder()] = None,
) -> None:
    """Copy the data, as of one moment, while a lab runs.

    A backup is a data folder, whatever kind of database the data are in.

    The copy is checked as by `salab verify`. It holds everybody's data and what identifies them, and is its owner's
    alone. Whoever is erased later is still in it.
    """
    from study.records import utc_text
    from study.store import back_up

    verdict = back_up(options.beside(data, own_folder), out, utc_text(time.time()))
    for finding in verdict.findings:
        print(finding)
    print(f"backed up to {shown(str(out))}: {verdict.participants} participants, {verdict.links} links")
    if verdict.findings:
        print("The data are not as they were recorded, and neither is the copy.")
        raise typer.Exit(1)


@commands.command(rich_help_panel=DATA, epilog="Example: salab restore backups/monday --data data")
def restore(
    copy: Annotated[
        Path,
        typer.Argument(metavar="BACKUP", parser=options.place, help="what `salab backup` made", show_default=False),
    ],
    data: Annotated[Path, folder("folder to make; nothing may be there")] = DATA_DIR,
) -> None:
    """Make a data folder of a backup.

    A backup that was changed since, and a folder that holds anything, are refused.
    """
    from study.store import restore

    verdict = restore(copy, data)
    print(f"restored to {shown(str(data))}: {verdict.participants} participants, {verdict.links} links, as recorded")


@commands.command(rich_help_panel=DATA, epilog="Example: salab copy data postgresql+psycopg://lab@db.example/study")
def copy(
    source: Annotated[
        DataPlace,
        typer.Argument(
            metavar="FROM", parser=options.data_place, help="data folder, or URL of a database", show_default=False
        ),
    ],
    target: Annotated[
        DataPlace,
        typer.Argument(
            metavar="TO", parser=options.data_place, help="the same, where nothing is yet", show_default=False
        ),
    ],
    own_folder: Annotated[Path | None, options.own_folder()] = None,
) -> None:
    """Copy everything into a database on a server, or back.

    No lab may run on either. The copy is whole or not made, verified by its chains, and has the same certificates; FROM
    stays as it is. Its lab goes on with --data TO. The key that certificates are signed with is copied too.
    """
    from study.store import copy

    if source.url is None and target.url is None:
        raise LabError("one of the two must be the URL of a database; `salab backup` copies a folder into a folder")
    copied = copy(*(place if place.url is None else options.beside(place, own_folder) for place in (source, target)))
    verdict = copied.verdict
    print(
        f"copied to {shown(str(target))}: {copied.rows} rows, {verdict.participants} participants, {verdict.links} "
        f"links, {COPIED}"
    )
