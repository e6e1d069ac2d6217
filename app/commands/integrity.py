"""`salab verify` and `salab certificate`: whether data are as they were recorded, and what shows it elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.groups import DATA
from app.commands.options import number, registered
from app.commands.replay import tell_replays
from app.config import LabConfig
from app.errors import LabError
from app.trial.robots import ROBOTS
from study.store import DataPlace

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
    data: Annotated[
        DataPlace | None, options.data("folder of the database, or address of one; a lab may be running on it")
    ] = None,
    replay: Annotated[
        bool, typer.Option("--replay", help="run every recorded trial and practice again, too (see `salab replay`)")
    ] = False,
    robot: Annotated[str | None, registered(ROBOTS, "with --replay: the robot an older export does not name")] = None,
    trust: Annotated[bool, options.trust()] = False,
    workers: Annotated[int, number("with --replay: processes")] = 1,
) -> None:
    """Find what was changed since it was recorded.

    Compares an export, or a data folder, with its chain: every row, and every file or page. Prints a line for whatever
    does not fit, and then ends with status 1. It reads and changes nothing. Somebody who can write the folder can make
    another chain that fits. With --replay all that was computed in trials and practices is computed again and
    compared: status 1 when it differs, 2 when it cannot be.
    """
    from study.export.verification import verify_export
    from study.store import verify_data

    if (export is None) == (data is None):
        raise LabError("what is to be verified? Name an export, or a data folder with --data")
    if replay and export is None:
        raise LabError("--replay replays an export; write one of the data folder with `salab export`, and name it")
    place = export or data
    verdict = verify_data(data) if data else verify_export(export or Path())
    for note in verdict.notes:
        print(note)
    for finding in verdict.findings[:MOST_TOLD]:
        print(finding)
    if len(verdict.findings) > MOST_TOLD:
        print(f"... and {len(verdict.findings) - MOST_TOLD} more")
    if verdict.findings:
        print(f"{place}: {len(verdict.findings)} findings")
    else:
        print(f"{place}: as recorded: {verdict.participants} participants, {verdict.links} links")
    status = 0
    if replay and export is not None:
        status = tell_replays(export, workers, {}, robot=robot, trust=trust)
    if verdict.findings or status:
        raise typer.Exit(1 if verdict.findings else status)


@commands.command(rich_help_panel=DATA, epilog="Example: salab certificate --data data")
def certificate(
    data: Annotated[
        DataPlace, options.data("folder of the database, or address of one; a lab may be running on it")
    ] = LabConfig().data,
) -> None:
    """Print what shows later that nothing was changed: the end of every chain.

    A line for each participant: how many links, the hash of the last, and whether what their pages were told is saved
    is what is stored. Keep the lines where nobody who can write the data folder can change them: mail them, publish
    them, have them registered. Whoever then changes the record and makes another chain for it no longer fits them.
    """
    from study.integrity.certificate import all_heads, state_of
    from study.store import open_store

    with open_store(data, must_exist=True) as store, store.snapshot() as recorded:
        heads = recorded.heads()
        certified = {row.participant: row for row in recorded.rows("certificates", True, True)}
    for participant, head in heads.items():
        row = certified.get(participant)
        told = f"{state_of(row)}, signed at link {row.links}" if row else "no certificate"
        print(f"{participant}  {head.seq:6d}  {head.hash}  {told}")
    for key in sorted({row.key for row in certified.values()}):
        print(f"key  {key}")
    print(f"all  {len(heads):6d}  {all_heads(heads)}")
