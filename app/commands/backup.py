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

DATA_DIR = LabConfig().data_dir

commands = typer.Typer()


@commands.command(rich_help_panel=DATA, epilog="Example: salab backup backups/monday --data data")
def backup(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", parser=options.place, help="folder to make", show_default=False)
    ],
    data: Annotated[Path, folder("folder of the database; a lab may be running on it")] = DATA_DIR,
) -> None:
    """Copy the data folder, as of one moment, while a lab runs.

    The copy is checked as by `salab verify`. It holds everybody's data and what identifies them, and is its owner's
    alone. Whoever is erased later is still in it.
    """
    from study.records import utc_text
    from study.store import back_up

    verdict = back_up(data, out, utc_text(time.time()))
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
