"""`salab bench sessions`: how many people this machine holds."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands import options
from app.commands.console import announce
from app.commands.groups import RUN_A_STUDY
from app.commands.options import SeveralValues, file, folder, number, one_of, registered
from app.config import LabConfig
from app.errors import LabError
from app.trial.robots import ROBOTS
from study.records import utc_text

if TYPE_CHECKING:
    from app.simulated.progress import Bar
    from app.sizing.measuring import Run
    from app.sizing.rule import Step, Verdict

WHAT = ("sessions",)
INTERRUPTED = 130

commands = typer.Typer()


@commands.command(
    cls=SeveralValues,
    rich_help_panel=RUN_A_STUDY,
    epilog="Example: salab bench sessions --study my-study.toml --data data --out sizing",
)
def bench(
    what: Annotated[str, typer.Argument(metavar="sessions", parser=one_of(WHAT), help="what is measured")],
    robot: Annotated[
        str | None, registered(ROBOTS, "which robot moves; bullet if not given, or mujoco without pybullet")
    ] = None,
    study: Annotated[Path | None, file("study file; the paper's study if not given")] = None,
    trust: Annotated[bool, options.trust()] = False,
    data: Annotated[
        Path, folder("the lab's data folder: it is measured on the same disk, and what came out is kept in it")
    ] = LabConfig().data_dir,
    steps: Annotated[list[int], number("numbers of people, rising; from 1 on if not given")] = [],  # noqa: B006
    seconds: Annotated[float, typer.Option(metavar="S", help="how long each step is measured")] = 30.0,
    no_views: Annotated[
        bool, typer.Option("--no-views", help="nobody has the 3-D views open; then nothing is kept in the data folder")
    ] = False,
    people_cores: Annotated[
        int, number("cores that the scripted people are kept to, and the lab to the others; 0 = they share them")
    ] = 0,
    out: Annotated[Path | None, folder("folder for sessions.csv, sessions.json and the figure")] = None,
) -> None:
    """Measure how many people this machine holds.

    Starts a lab of its own and lets scripted people drive in it, more with each step, until ticks begin late. Says what
    gives way first and how many people to take; a lab on that data folder warns when there are more, and its open link
    then asks people to come back. Run it while no lab runs: it takes the whole machine. Ctrl+C keeps the steps so far.
    """
    from app.sizing import files, text
    from app.sizing.measuring import STEPS, Asked, Run
    from app.sizing.rule import verdict
    from study.store import is_in_use

    asked = Asked(data, robot, study, trust, tuple(steps) or STEPS, seconds, not no_views, people_cores)
    if is_in_use(data):
        raise LabError(f"{data}: a lab runs on this data folder; measuring would make its people late")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # the lab that was started has to end too
    bars, is_interrupted = _Bars(), False
    found: list[Step] = []
    run = Run(asked, bars)
    try:
        for step in run.steps():
            bars.end()
            if not found:
                announce(text.HEAD)
            found.append(step)
            announce(text.line(step))
            if out is not None:
                files.write_steps(out, found)
    except KeyboardInterrupt:
        is_interrupted = True
    except LabError as error:  # as when the memory is full, and the system ends something
        if not found:
            raise
        run.not_tried = str(error)
    finally:
        bars.end()
    came_out = verdict(found, run.room, run.not_tried)
    for line in text.told(came_out, found, run.room, asked.scene) if found else ():
        announce(line)
    if out is not None and found:
        files.write_all(out, found, came_out, run.room, _about(run))
        announce(f"written to {out}")
        if why := files.no_figure():
            announce(why)
    if is_interrupted:
        announce("Interrupted: the lab keeps what it knew before.")
        raise typer.Exit(INTERRUPTED)
    _keep(run, came_out)


def _about(run: Run) -> dict[str, object]:
    """What was measured, and where."""
    from app.sizing.machine import machine, version

    asked = run.asked
    return {
        "version": version(),
        "measured_utc": utc_text(time.time()),
        "machine": dict(machine()),
        "robot": run.robot,
        "study": str(asked.study or "shipped"),
        "seconds": asked.seconds,
        "views": asked.scene,
        "people_cores": asked.people_cores,
    }


def _keep(run: Run, came_out: Verdict) -> None:
    """Put the number where the lab finds it."""
    from app.sizing import capacity
    from app.sizing.machine import machine, version

    if not run.asked.scene:
        announce("Not kept: people who take part look at the robot. Without --no-views it is.")
    elif came_out.bottleneck == "others":
        announce("Not kept: other programs took the machine, and the number is none of the lab's.")
    elif came_out.capacity:
        kept = capacity.Capacity(
            sessions=came_out.capacity,
            held=came_out.held,
            robot=run.robot,
            scene=True,
            measured_utc=utc_text(time.time()),
            version=version(),
            machine=machine(),
        )
        path = capacity.write(run.asked.data, kept)
        announce(f"Kept in {path}: a lab on this data folder takes {kept.sessions} at once (--capacity sets another).")


class _Bars:
    """How far it is, on stderr."""

    def __init__(self) -> None:
        self._bar: Bar | None = None
        self._of: tuple[str, int] = ("", 0)

    def coming(self, sessions: int, arrived: int) -> None:
        """So many drive of those who come."""
        self._show("coming", sessions, sessions, arrived)

    def measuring(self, sessions: int, done_s: float, of_s: float) -> None:
        """So much of a step is over."""
        self._show("measured, s", sessions, round(of_s), round(done_s))

    def end(self) -> None:
        """Leave the line to what is printed next."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def _show(self, what: str, sessions: int, total: int, done: int) -> None:
        from app.simulated.progress import progress
        from app.sizing import text

        if self._bar is None or self._of != (what, sessions):
            self.end()
            self._bar, self._of = progress(f"{text.people(sessions)} {what}", total), (what, sessions)
        self._bar.update(done - self._bar.n)
