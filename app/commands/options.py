"""What options of several commands are read with. What cannot be read is told with its value and what would do."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand

from app.config import LabConfig
from app.errors import LabError
from study.parts.registry import Registry
from study.records import StudyError
from study.store import DataPlace, checked_url, is_url

if TYPE_CHECKING:
    from study.flow.flow import Flow

MAX_PORT = 65535
DATA_FOLDER = LabConfig().data_dir


def flow_of(context: typer.Context) -> Flow:
    """The pages that the program runs with: the lab's, unless a program of one's own gave others."""
    from study.flow.flow import FLOW

    flow: Flow = context.obj or FLOW
    return flow


def number(help: str) -> Any:
    """An option that takes a whole number."""
    return typer.Option(metavar="N", parser=whole_number, help=help)


def choice(names: Sequence[str], help: str) -> Any:
    """An option that takes one of these names."""
    return typer.Option(metavar="|".join(names), parser=one_of(names), help=help)


def registered(registry: Registry, help: str) -> Any:
    """An option that takes the name of a part: one that ships, or one that an installed package registers."""

    def known(text: str) -> str:
        if text not in registry.shipped and text not in registry.names:  # looking the others up takes a while
            raise typer.BadParameter(f"{text!r} is not one of {', '.join(registry.names)}")
        return text

    return typer.Option(metavar="|".join(registry.shipped), parser=known, help=help)


def trust() -> Any:
    """The option without which no code of a study file's sender runs."""
    return typer.Option("--trust", help="run code in files beside the study file; read it first")


def folder(help: str) -> Any:
    """An option that takes a folder."""
    return typer.Option(metavar="DIR", parser=place, help=help)


def data(help: str) -> Any:
    """An option that takes a data folder, or the address of a database on a server."""
    return typer.Option(metavar="DIR|URL", parser=data_place, help=help)


def data_place(text: str | Path | DataPlace) -> DataPlace:
    """Where data are, of a text. The folder of a database on a server is the usual one, see `beside`."""
    if isinstance(text, DataPlace):
        return text
    if is_url(str(text)):
        try:
            return DataPlace(DATA_FOLDER, checked_url(str(text)))
        except StudyError as error:
            raise typer.BadParameter(str(error)) from None
    return DataPlace(place(text))


def own_folder() -> Any:
    """The option for where the lab's own files lie when the database is on a server."""
    return typer.Option(
        "--folder",
        metavar="DIR",
        parser=place,
        help=f"folder of the lab's own files, where --data is a URL; {DATA_FOLDER} if not given",
    )


def beside(data: DataPlace, folder: Path | None) -> DataPlace:
    """The same with another folder. Raises `LabError` where --data says which."""
    if folder is None:
        return data
    if data.url is None:
        raise LabError(f"--folder {folder}: is for a database on a server; --data names the folder itself")
    return DataPlace(folder, data.url)


def file(help: str) -> Any:
    """An option that takes a file."""
    return typer.Option(metavar="FILE", parser=place, help=help)


def place(text: str | Path) -> Path:
    """The path of a text. A `~` that the shell left alone, as in `--data=~/lab`, is the home folder: a folder of that
    name would be made else, and removing it would remove another one."""
    if not str(text):
        raise typer.BadParameter("the name of a file or folder is empty; . is this folder")
    if is_url(str(text)):  # which is not shown: it may hold a password
        raise typer.BadParameter("an address stands where a file or folder is asked for")
    return Path(os.path.expanduser(text))  # unlike `Path.expanduser`, it leaves ./~ what it says


def whole_number(text: str | int) -> int:
    """The number of a text; a default is one already."""
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a whole number") from None


def port_number(text: str | int) -> int:
    """The port of a text; 0 = any free one."""
    port = int(text) if str(text).isdecimal() else -1
    if not 0 <= port <= MAX_PORT:
        raise typer.BadParameter(f"{text!r} is not a port; ports are 0 to {MAX_PORT}")
    return port


def one_of(names: Sequence[str]) -> Callable[[str], str]:
    """A parser that takes these names only."""

    def chosen(text: str) -> str:
        if text not in names:
            raise typer.BadParameter(f"{text!r} is not one of {', '.join(names)}")
        return text

    return chosen


class SeveralValues(TyperCommand):
    """A command whose options that may be repeated also take several values at once: `--sizes 6 12 18`, `--sizes
    6,12,18` and `--sizes 6 --sizes 12 --sizes 18` are the same."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments, each value of such an option with the option before it."""
        several = {flag for option in self.params if getattr(option, "multiple", False) for flag in option.opts}
        return super().parse_args(ctx, list(_one_by_one(args, several)))


def _one_by_one(arguments: Sequence[str], options: set[str]) -> Iterator[str]:
    apart = [part for each in arguments for part in (each.split("=", 1) if each.split("=")[0] in options else [each])]
    option, is_first = "", True
    for part in apart:
        if part.startswith("-") or not option:
            option, is_first = part if part in options else "", True
            yield part
            continue
        for value in part.split(","):
            yield from (value,) if is_first else (option, value)
            is_first = False
