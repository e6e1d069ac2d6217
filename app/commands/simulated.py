"""`salab simulate`, `salab analyze`, `salab figure2` and `salab bot`: a study without people, what any data
say, and what an arbiter wants."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.groups import SIMULATE_AND_ANALYSE
from app.commands.options import choice, file, flow_of, folder, number, registered
from app.errors import LabError
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
    from study.export.parquet import csv_alone

    plan = make_plan(seed, robot, preset, study, trust, flow_of(context))
    rows = simulate(plan, participants, workers, out, preset)
    print(f"{participants} simulated participants, {rows['ticks']} ticks: {out}{csv_alone()}")


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
    from concurrent.futures import ThreadPoolExecutor

    from app.processes import without_collections
    from study.export.verification import refuse_changed

    with without_collections(), ThreadPoolExecutor(1) as beside:
        looked = beside.submit(refuse_changed, directory) if directory.is_dir() and not changed else None
        # Meanwhile, which takes as long: they load the statistics and the plotting.
        from app.report.figure2 import heatmap_of
        from study.analysis.analysis import analyse
        from study.analysis.dataset import load
        from study.analysis.report import claim, write_report

        if looked is not None:
            looked.result()
        data = load(directory, as_written=not changed)
        claim(out)  # before the work, not after it
        analysis = analyse(data)
    print(f"report: {write_report(analysis, out, heatmap_of(data))}")


@commands.command(rich_help_panel=SIMULATE_AND_ANALYSE, epilog="Example: salab figure2 --preset fitted --out maps")
def figure2(
    study: Annotated[Path | None, file("study file; the paper's study if not given")] = None,
    preset: Annotated[
        str | None,
        choice(PRESET_NAMES, "put another set of arbiter into the study file; the file as it stands if not given"),
    ] = None,
    condition: Annotated[
        str, typer.Option(metavar="ID", help="whose arbiter; the one that weighs information most without it")
    ] = "",
    likely: Annotated[
        float, typer.Option(metavar="P", help="probability of each of the two likely goals; the others share the rest")
    ] = 0.34,
    momentum: Annotated[
        str | None,
        choice(
            ("best", "rest", "averaged"),
            "with which momentum a place is come to: the best move's, none, or that of the person's next action; as "
            "the arbiter looks if not given",
        ),
    ] = None,
    trust: Annotated[bool, options.trust()] = False,
    out: Annotated[Path, file("where to: FILE.svg, FILE.png and FILE.csv")] = Path("figure2"),
) -> None:
    """Draw what each reward wants, the paper's Fig. 2.

    Prints what the two maps say of places near the likely goals, and writes the values as a table.
    """
    from app.report.figure2 import fig2_heatmap, gathering
    from app.simulated.variants import changed_study, preset_changes
    from app.trial.setup import study_setup
    from app.trial.world import open_study
    from study.analysis.figures import heatmap_figure
    from study.definition.toml_reader import parse_toml

    chosen = changed_study(open_study(study, trust), preset_changes(preset), trust)
    setup = study_setup(chosen, trust)
    parameters = {each.id: setup.parameters_json(each.id) for each in chosen.conditions}
    if condition and condition not in parameters:
        raise LabError(f"no condition {condition!r}; conditions are {', '.join(parameters)}")
    settings, _ = parse_toml(chosen.source_text.encode(), "study.toml")
    heatmap = fig2_heatmap(settings, parameters[condition or gathering(parameters)], momentum, likely)
    picture = heatmap_figure(heatmap)
    base = out.with_suffix("") if out.suffix in (".svg", ".png", ".csv") else out
    try:
        base.parent.mkdir(parents=True, exist_ok=True)
        picture.write(base.parent, base.name)
    except OSError as error:
        raise LabError(f"{base}: cannot be written: {error.strerror or error}") from None
    print(f"{picture.caption}\nwrote {base}.svg, {base}.png and {base}.csv")


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
