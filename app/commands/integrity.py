"""`salab verify`: whether data are as they were recorded."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.groups import DATA
from app.commands.options import folder
from app.errors import LabError

MOST_TOLD = 200
"""Findings that are printed: whoever has more of them reads no further."""
commands = typer.Typer()


@commands.command(rich_help_panel=DATA, epilog="Example: salab verify out")
def verify(
    export: Annotated[
        Path | None,
        typer.Argument(
            metavar="EXPORT",
            parser=options.place,
            help="folder that `salab export` or `salab simulate` wrote",
            show_default=False,
        ),
    ] = None,
    data: Annotated[Path | None, folder("folder of the database; a lab may be running on it")] = None,
) -> None:
    """Find what was changed since it was recorded.

    Compares an export, or a data folder, with its chain: every row, and every file or page. Prints a line for whatever
    does not fit, and then ends with status 1. It reads and changes nothing. Somebody who can write the folder can make
    another chain that fits.
    """
    from study.export.verification import verify_export
    from study.store import verify_data

    if (place := export or data) is None or (export and data):
        raise LabError("what is to be verified? Name an export, or a data folder with --data")
    verdict = verify_export(export) if export else verify_data(place)
    for note in verdict.notes:
        print(note)
    for finding in verdict.findings[:MOST_TOLD]:
        print(finding)
    if len(verdict.findings) > MOST_TOLD:
        print(f"... and {len(verdict.findings) - MOST_TOLD} more")
    if verdict.findings:
        print(f"{place}: {len(verdict.findings)} findings")
        raise typer.Exit(1)
    print(f"{place}: as recorded: {verdict.participants} participants, {verdict.links} links")
