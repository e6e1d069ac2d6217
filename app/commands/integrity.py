"""`salab verify`: whether data are as they were recorded."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands.groups import DATA
from app.commands.options import folder
from app.errors import LabError

commands = typer.Typer()


@commands.command(rich_help_panel=DATA, epilog="Example: salab verify --data data")
def verify(
    data: Annotated[Path | None, folder("folder of the database; a lab may be running on it")] = None,
) -> None:
    """Find what was changed since it was recorded.

    Compares the database with its chain: each row, each page. Prints a line for whatever does not fit, and then ends
    with status 1. It reads and changes nothing. Somebody who can write the folder can make another chain that fits.
    """
    from study.store import verify_data

    if data is None:
        raise LabError("what is to be verified? Name a data folder with --data")
    verdict = verify_data(data)
    for note in verdict.notes:
        print(note)
    for finding in verdict.findings:
        print(finding)
    if verdict.findings:
        print(f"{data}: {len(verdict.findings)} findings")
        raise typer.Exit(1)
    print(f"{data}: as recorded: {verdict.participants} participants, {verdict.links} links")
