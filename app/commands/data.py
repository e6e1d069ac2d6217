"""`salab export` and `salab erase`: what becomes of a lab's data."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.groups import DATA as GROUP
from app.commands.options import flow_of, folder
from app.config import LabConfig
from app.errors import LabError
from study.store import DataPlace

DATA = LabConfig().data

commands = typer.Typer()


@commands.command(rich_help_panel=GROUP, epilog="Example: salab export --data data --out out --zip")
def export(
    out: Annotated[Path, folder("folder to write into, or the archive with --zip")],
    data: Annotated[DataPlace, options.data("folder of the database, or address of one on a server")] = DATA,
    as_archive: Annotated[
        bool, typer.Option("--zip", help="write one archive instead: OUT, with .zip at its end")
    ] = False,
    pilot: Annotated[bool, typer.Option("--pilot", help="pilot participants too")] = False,
    excel_safe: Annotated[
        bool, typer.Option("--excel-safe", help="no cell of the CSV begins what a spreadsheet would run")
    ] = False,
) -> None:
    """Write the data as a data package (CSV, Parquet, descriptions).

    It is there whole or not at all, in place of an earlier one. Parquet needs the extra `analysis`.
    Demo participants and whatever identifies somebody stay out. A lab may be running on the data.
    """
    from study.export.export import export, export_zip
    from study.export.parquet import csv_alone
    from study.store import open_store

    if as_archive and out.suffix != ".zip":
        out = out.with_name(out.name + ".zip")
    with open_store(data, must_exist=True) as store:
        (export_zip if as_archive else export)(store, out, include_pilot=pilot, excel_safe=excel_safe)
    print(f"exported to {out}{csv_alone()}")


@commands.command(rich_help_panel=GROUP, epilog="Example: salab erase --data data --participant P001 --yes")
def erase(
    context: typer.Context,
    participant: Annotated[str, typer.Option(metavar="ID", help="such as P001")],
    data: Annotated[
        DataPlace, options.data("folder of the database, or address of one on a server; no lab runs on it")
    ] = DATA,
    own_folder: Annotated[Path | None, options.own_folder()] = None,
    yes: Annotated[bool, typer.Option("--yes", help="do it; without this nothing is deleted")] = False,
) -> None:
    """Delete everything about one participant, for good.

    Only a mark is left that there was one. Copies that the lab made of the database before a migration are deleted too.
    Exports made before, and copies made elsewhere, are not reached.
    """
    from app.report import process as reporter
    from study.export.placing import sweep_noted
    from study.records import utc_text
    from study.store import SessionUnreadable, open_store

    data = options.beside(data, own_folder)
    with open_store(data, exclusive=True, must_exist=True, flow=flow_of(context)) as store:
        with contextlib.suppress(SessionUnreadable):  # whoever cannot be read can be erased
            store.session(participant)  # says so when there is none
        if not yes:
            raise LabError(f"{participant} would be erased for good; say --yes to do it")
        overwritten = store.erase(participant, utc_text(time.time()))
    reporter.remove(data.folder)  # of a lab that was killed
    sweep_noted(data.folder)
    print(f"erased {participant}: only the mark that there was one is left")
    if overwritten is None:
        print("The server overwrites the space in its own time; its logs and backups are not reached.")
