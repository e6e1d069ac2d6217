"""`salab replay`: recorded trials run again and compared with their record."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from app.commands import options
from app.commands.groups import DATA
from app.commands.options import number, registered
from app.trial.robots import ROBOTS

commands = typer.Typer()

SAME, DIFFERENT, CANNOT = 0, 1, 2
"""How the command ends; a difference weighs more than what could not be replayed."""


def tolerance(text: str | float) -> float:
    """A bound from 0 on."""
    try:
        bound = float(text)
    except ValueError:
        bound = -1.0
    if not 0.0 <= bound < float("inf"):
        raise typer.BadParameter(f"{text!r} is not a bound; 0 is bit for bit, 1e-6 a micrometre")
    return bound


@commands.command(
    rich_help_panel=DATA,
    epilog="Example: salab replay out --participant P001 --trial 2",
)
def replay(
    export: Annotated[
        Path,
        typer.Argument(metavar="EXPORT", help="folder that `salab export` or `salab simulate` wrote"),
    ],
    participant: Annotated[str | None, typer.Option(metavar="ID", help="such as P001; everybody if not given")] = None,
    trial: Annotated[int | None, number("of the trial, from 1; all if not given")] = None,
    practice: Annotated[
        bool, typer.Option("--practice", help="the practice before the trial instead of the trial")
    ] = False,
    robot: Annotated[
        str | None, registered(ROBOTS, "another robot than was recorded, or the one an older export does not name")
    ] = None,
    bound: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            metavar="X",
            parser=tolerance,
            help="how far apart numbers may be; 0, bit for bit, on the machine that recorded them, else 1e-6",
        ),
    ] = None,
    trust: Annotated[bool, options.trust()] = False,
    workers: Annotated[int, number("processes")] = 1,
) -> None:
    """Run recorded trials again from an export alone, and compare every tick.

    The first difference is named: tick, column, what was recorded and what came of it now. Columns of the clock
    (started_utc, late_ms) are not compared. It ends with status 0 when all is the same, 1 when something differs, 2
    when something cannot be replayed.
    """
    from app.trial.values import PhaseKind

    phases: tuple[PhaseKind, ...] = ("practice",) if practice else ("trial",)
    if not practice and participant is None and trial is None:
        phases = ("trial", "practice")
    which = {"participant": participant, "trial": trial, "phases": phases}
    status = tell_replays(export, workers, which, robot=robot, tolerance=bound, trust=trust)
    if status:
        raise typer.Exit(status)


def tell_replays(export: Path, workers: int, which: Mapping[str, Any], **asked: Any) -> int:
    """Replay, and print what comes of each as it is known; how the command ends. `which` are the recordings, as of
    `replay_all`, `asked` is how."""
    from app.errors import LabError
    from app.replay.replaying import Asked, replay_all
    from app.simulated.study import MAX_WORKERS, check_count
    from study.records import StudyError

    counts, ticks = {"same": 0, "different": 0, "cannot": 0}, 0
    try:
        check_count("workers", workers, MAX_WORKERS)
        for told in replay_all(export, Asked(**asked), workers=workers, **which):
            print(told, flush=True)
            counts[told.state] += 1
            ticks += told.ticks
    except (LabError, StudyError) as error:
        print(f"salab: {error}", file=sys.stderr)
        return CANNOT
    if sum(counts.values()) > 1:
        parts = {"same": "the same", "different": "different", "cannot": "not replayed"}
        said = ", ".join(f"{count} {parts[state]}" for state, count in counts.items() if count)
        print(f"{ticks} ticks replayed: {said}")
    return DIFFERENT if counts["different"] else CANNOT if counts["cannot"] else SAME
