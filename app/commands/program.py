"""The program `salab`: its commands in the order of its help, and how its arguments become an exit status."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer.core import TyperGroup
from typer.main import get_command

from app.commands import (
    backup,
    data,
    integrity,
    participant_texts,
    physics_comparison,
    recruitment,
    replay,
    replication,
    serve,
    simulated,
    sizing,
    study_file,
)
from app.commands.console import shown
from app.commands.groups import GroupedHelp

if TYPE_CHECKING:
    from study.flow.flow import Flow

NAME = "salab"
DISTRIBUTION = "shared-autonomy-lab"
PROJECT_FILE = Path(__file__).resolve().parents[2] / "pyproject.toml"


def program() -> TyperGroup:
    """The whole command line. Nothing of rich: it would double the time that the help takes."""
    salab = typer.Typer(
        cls=GroupedHelp,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        # The default of --help is said because the library loads a validator for an unsaid one.
        context_settings={"help_option_names": ["-h", "--help"], "default_map": {"help": False}},
        subcommand_metavar="COMMAND ...",
        options_metavar="[--version]",
    )
    salab.callback(epilog="`salab COMMAND --help` has the options of a command, and an example.")(_options)
    for room in (
        *(serve, sizing, recruitment, study_file, participant_texts),
        *(data, backup, integrity, replay, simulated, replication, physics_comparison),
    ):
        salab.add_typer(room.commands)
    command = get_command(salab)
    assert isinstance(command, TyperGroup)
    return command


def run(arguments: Sequence[str], flow: Flow | None = None) -> int:
    """Run the command that was typed, with the pages of `flow` (None = the lab's); no arguments at all print the help.
    What is no command ends with status 2 and one line that says why."""
    salab = program()
    try:
        status = salab.main(list(arguments) or ["--help"], prog_name=NAME, standalone_mode=False, obj=flow)
    except typer.TyperException as error:
        command = f"{NAME} {arguments[0]}" if arguments[0] in salab.commands else NAME
        print(f"{command}: {shown(error.format_message().removesuffix('.'))}; see `{command} --help`", file=sys.stderr)
        return error.exit_code
    return int(status or 0)


def version() -> str:
    """The version installed, or that of the checkout when nothing is."""
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as installed

    try:
        return installed(DISTRIBUTION)
    except PackageNotFoundError:
        (found,) = re.findall(r'^version = "([^"]+)"$', PROJECT_FILE.read_text(encoding="utf-8"), re.MULTILINE)
        return str(found)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"{NAME} {version()}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Shared Autonomy Lab."""
