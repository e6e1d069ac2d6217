"""`salab simulate`, `salab analyze` and `salab bot`: a study without people, and what any study's data say."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.groups import SIMULATE_AND_ANALYSE
from app.commands.options import choice, file, flow_of, folder, number, registered
from app.simulated.presets import PRESET_NAMES
from app.trial.robots import ROBOTS

commands = typer.Typer()


@commands.command(
    rich_help_panel=SIMULATE_AND_ANALYSE,
    epilog="Example: salab simulate --participants 12 --seed 7 --workers 2 --out pilot",
)
def simulate(
    context: typer.Context,
    out: Annotated[Path, folder("folder to write into, laid out as by `salab export`")],
    participants: Annotated[int, number("how many")] = 12,
    seed: Annotated[int, number("of everything random")] = 7,
    robot: Annotated[str, registered(ROBOTS, "which robot moves")] = "kinematic",
    preset: Annotated[
        str | None,
        choice(
            PRESET_NAMES,
            "put another set of arbiter, robot speed and readings' place into the study file; the study file as it "
            "stands if not given",
        ),
    ] = None,
    study: Annotated[Path | None, file("study file; the paper's study if not given")] = None,
    trust: Annotated[bool, options.trust()] = False,
    workers: Annotated[int, number("processes; the data are the same for any number")] = 1,
) -> None:
    """Run a study with simulated participants.

    When it is interrupted, the same command goes on where it was.
    """
    from app.simulated.study import make_plan, simulate

    plan = make_plan(seed, robot, preset, study, trust, flow_of(context))
    rows = simulate(plan, participants, workers, out, preset)
    print(f"{participants} simulated participants, {rows['ticks']} ticks: {out}")


@commands.command(rich_help_panel=SIMULATE_AND_ANALYSE, epilog="Example: salab analyze pilot --out report")
def analyze(
    directory: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            parser=options.place,
            help="folder that `salab export` or `salab simulate` wrote",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option(metavar="REPORT", parser=options.place, help="folder to write the report into")],
    changed: Annotated[
        bool, typer.Option("--changed", help="take files as they are that were changed since the export")
    ] = False,
) -> None:
    """Analyse an export: report, figures, tables, measures.json.

    An export whose files do not fit its `SHA256SUMS` is refused, so that no accident gets into the results unseen.
    """
    from app.report.figure2 import heatmap_of
    from study.analysis.analysis import analyse
    from study.analysis.dataset import load
    from study.analysis.report import claim, write_report
    from study.export.verification import refuse_changed

    if directory.is_dir() and not changed:
        refuse_changed(directory)
    data = load(directory)
    claim(out)  # before the work, not after it
    print(f"report: {write_report(analyse(data), out, heatmap_of(data))}")


@commands.command(
    rich_help_panel=SIMULATE_AND_ANALYSE, epilog="Example: salab bot --url http://127.0.0.1:8000/p/TOKEN --quiet"
)
def bot(
    context: typer.Context,
    url: Annotated[str, typer.Option(metavar="URL", help="a participant's link")],
    panel_url: Annotated[
        str | None, typer.Option(metavar="URL", help="the second device's link, if the study uses one")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="no progress")] = False,
    clumsy: Annotated[
        bool, typer.Option("--clumsy", help="drive into things, slip and press at random, and tell what must not be")
    ] = False,
    seed: Annotated[int, number("of what a clumsy one does")] = 7,
) -> None:
    """Complete a whole study over a participant's link.

    The participant must be in lockstep: `salab serve --pace lockstep`. A clumsy bot exits with status 1 when it found
    something that must not be, such as an arm that does not come free.
    """
    import asyncio

    from app.simulated.bot import run_bot

    report = asyncio.run(
        run_bot(
            url,
            panel_url=panel_url,
            say=None if quiet else print,
            flow=flow_of(context),
            clumsy_seed=seed if clumsy else None,
        )
    )
    print(f"done: {report.ticks} ticks, {report.alerts} alerts answered, {report.surveys} surveys")
    for finding in report.findings:
        print(finding)
    if report.findings:
        raise typer.Exit(1)
