"""`salab compare-physics`: whether data taken on one robot stay usable on another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.groups import SIMULATE_AND_ANALYSE
from app.commands.options import SeveralValues, choice, file, folder, number, registered
from app.errors import LabError
from app.simulated.presets import PRESET_NAMES
from app.trial.robots import ROBOTS

commands = typer.Typer()


@commands.command(
    "compare-physics",
    cls=SeveralValues,
    rich_help_panel=SIMULATE_AND_ANALYSE,
    epilog="Example: salab compare-physics --studies 4 --workers 2 --out physics",
)
def compare_physics(
    robots: Annotated[
        list[str],
        registered(ROBOTS, "two or more, the first is what the others are held against; all installed if not given"),
    ] = [],  # noqa: B006
    studies: Annotated[int, number("how many studies")] = 1,
    participants: Annotated[int, number("people in each")] = 12,
    seed: Annotated[int, number("of everything random")] = 2020,
    recorded: Annotated[int, number("people whose recorded inputs are run up to first contact")] = 6,
    data: Annotated[
        Path | None,
        folder("an export, whose people's inputs are taken instead of simulated ones, and whose study is simulated"),
    ] = None,
    preset: Annotated[str, choice(PRESET_NAMES, "which study of ours")] = "shipped",
    study: Annotated[Path | None, file("study file, to the preset's numbers")] = None,
    trust: Annotated[bool, options.trust()] = False,
    workers: Annotated[int, number("processes; the results are the same for any number")] = 1,
    out: Annotated[Path | None, folder("folder for report, figure and tables, and for going on later")] = None,
) -> None:
    """Tell whether data taken on one physics stay usable on another.

    Recorded inputs drive all robots in step up to first contact; then the same simulated people do whole studies on
    each. With --out, the same command goes on where an interrupted one was.
    """
    from dataclasses import replace

    from app.physics_comparison.closed_loop import People
    from app.physics_comparison.comparing import Asked, check, chosen_robots, compare_physics
    from app.physics_comparison.files import write
    from app.physics_comparison.recorded import read_export
    from app.physics_comparison.text import on_screen
    from app.replication.replicate import check_place
    from app.simulated.study import make_plan

    chosen = chosen_robots(robots)
    if data is not None and (study is not None or preset != "shipped"):
        raise LabError("--data brings its own study; leave --study and --preset out")
    check(studies, participants, recorded, workers, of_export=data is not None)
    check_place(out, "people")
    export = None if data is None else read_export(data, recorded, trust)
    plan = make_plan(seed, chosen[0], preset, study, trust)
    if export is not None:
        plan = replace(plan, study_text=export.study_text)
    asked = Asked(chosen, People(plan, studies, participants), recorded, export)
    compared = compare_physics(asked, workers, None if out is None else out / "people")
    print(on_screen(compared))
    if out is not None:
        print(f"report: {write(compared, out)}")
