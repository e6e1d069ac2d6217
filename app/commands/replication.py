"""`salab fit`, `salab replicate` and `salab power`: many simulated studies, held against the paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.groups import SIMULATE_AND_ANALYSE
from app.commands.options import SeveralValues, choice, file, folder, number, registered
from app.simulated.presets import PRESET_NAMES
from app.trial.robots import ROBOTS

TRANSITIONS = ("both", "replan", "mix")
"""Those that `app.replication.fit.VARIANTS` has, whose module is slow to load, and both."""
SIZES = [6, 12, 18, 24, 36, 48]
PEOPLE_A_STUDY = 12

commands = typer.Typer()


@commands.command(
    rich_help_panel=SIMULATE_AND_ANALYSE, epilog="Example: salab fit --transition replan --workers 2 --out fitted.json"
)
def fit(
    transition: Annotated[str, choice(TRANSITIONS, "how the robot moves")] = "both",
    participants: Annotated[int, number("simulated people an evaluation rests on")] = 24,
    seed: Annotated[int, number("of everything random")] = 1,
    workers: Annotated[int, number("processes")] = 1,
    out: Annotated[Path | None, file("file for the values found; only printed if not given")] = None,
) -> None:
    """Calibrate simulated people on the paper's pure teleoperation."""
    from app.replication.fit import VARIANTS, run

    variants = tuple(VARIANTS) if transition == "both" else (transition,)
    print(run(variants, participants, seed, workers, out))


@commands.command(
    rich_help_panel=SIMULATE_AND_ANALYSE,
    epilog="Example: salab replicate --studies 200 --workers 2 --out replication",
)
def replicate(
    studies: Annotated[int, number("how many studies")] = 200,
    participants: Annotated[int, number("people in each")] = PEOPLE_A_STUDY,
    seed: Annotated[int, number("of everything random")] = 2020,
    workers: Annotated[int, number("processes; the results are the same for any number")] = 1,
    robot: Annotated[str, registered(ROBOTS, "which robot moves")] = "kinematic",
    preset: Annotated[str, choice(PRESET_NAMES, "which study of ours")] = "shipped",
    study: Annotated[Path | None, file("study file with the paper's three conditions, to the preset's numbers")] = None,
    trust: Annotated[bool, options.trust()] = False,
    vary: Annotated[int, number("studies run again for each thing varied; 0 = none, and no reasons for misses")] = 5,
    out: Annotated[Path | None, folder("folder for the report and for going on later")] = None,
) -> None:
    """Run the paper's comparisons in many simulated studies.

    With --out, the same command goes on where an interrupted one was.
    """
    from app.replication.replicate import replicate
    from app.replication.spreadsheets import write
    from app.replication.text import on_screen
    from app.simulated.study import make_plan

    plan = make_plan(seed, robot, preset, study, trust)
    result = replicate(plan, preset, studies, participants, workers, vary, out)
    print(on_screen(result))
    if out is not None:
        write(result, out)
        print(f"report: {out / 'replication.md'}")


@commands.command(
    cls=SeveralValues,
    rich_help_panel=SIMULATE_AND_ANALYSE,
    epilog="Example: salab mechanism --presets shipped ahead --picture mechanism.svg",
)
def mechanism(
    presets: Annotated[list[str], choice(PRESET_NAMES, "studies of ours, one or several")] = ["shipped"],  # noqa: B006
    study: Annotated[Path | None, file("study file, beside them")] = None,
    trust: Annotated[bool, options.trust()] = False,
    studies: Annotated[int, number("how many studies of each")] = 5,
    participants: Annotated[int, number("people in each")] = PEOPLE_A_STUDY,
    seed: Annotated[int, number("of everything random")] = 2020,
    workers: Annotated[int, number("processes; the results are the same for any number")] = 1,
    marked: Annotated[list[str], choice(PRESET_NAMES, "those that the picture points out")] = ["shipped"],  # noqa: B006
    picture: Annotated[Path | None, file("where to draw them, an .svg")] = None,
) -> None:
    """Tell by what information moves the arm: by place or by momentum."""
    from app.replication.mechanism import mechanisms
    from app.replication.mechanism_text import table, write
    from app.simulated.study import make_plan

    plans = [(name, make_plan(seed, "kinematic", name)) for name in presets]
    if study is not None:
        plans.append((study.stem, make_plan(seed, "kinematic", None, study, trust)))
    found = mechanisms(plans, studies, participants, workers)
    print(table(found))
    if picture is not None:
        write(found, marked, picture)
        print(f"picture: {picture}")


@commands.command(
    cls=SeveralValues,
    rich_help_panel=SIMULATE_AND_ANALYSE,
    epilog="Example: salab power --sizes 6 12 18 24 --workers 2 --out replication",
)
def power(
    out: Annotated[Path, folder("folder; studies of `salab replicate` in it are used")],
    sizes: Annotated[list[int], number("numbers of participants, one or several")] = SIZES,
    draws: Annotated[int, number("studies drawn of every size")] = 200,
    studies: Annotated[int, number(f"studies of {PEOPLE_A_STUDY} to draw people from")] = 40,
    seed: Annotated[int, number("of everything random")] = 2020,
    workers: Annotated[int, number("processes")] = 1,
    preset: Annotated[str, choice(PRESET_NAMES, "which study of ours")] = "shipped",
) -> None:
    """Tell the chance of the paper's differences by number of people."""
    from app.replication.power import check_draws, power, table, write
    from app.replication.replicate import check_place
    from app.replication.studies import MAX_STUDIES, run_studies
    from app.simulated.study import check_count, make_plan

    check_count("studies", studies, MAX_STUDIES)
    check_draws(sizes, draws, workers, studies * PEOPLE_A_STUDY)
    check_place(out)
    plan = make_plan(seed, "kinematic", preset)
    values = run_studies(plan, studies, PEOPLE_A_STUDY, workers, out / "studies")
    result = power(values, sizes, draws, seed, workers)
    write(result, out)
    print(f"{table(result)}\nfrom {result.people} simulated people; curves: {out / 'power.svg'}")
