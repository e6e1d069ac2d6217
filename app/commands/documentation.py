"""Every command as plain values: what the help prints, for whoever writes it down elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from typer.core import TyperArgument, TyperCommand, TyperOption

from app.commands.program import program

EXAMPLE = "Example: "


@dataclass(frozen=True)
class OptionDoc:
    """An option, or an argument that is known by its place and has no flags."""

    flags: tuple[str, ...]
    metavar: str
    """What the value is called; "" where none is taken."""
    default: str
    """As the help prints it; "" = none."""
    help: str
    required: bool


@dataclass(frozen=True)
class CommandDoc:
    """A command of `salab`. Its help text begins with a line that stands by itself."""

    name: str
    group: str
    help: str
    example: str
    """A whole line to type, beginning with `salab`."""
    options: tuple[OptionDoc, ...]
    """In the order of the help: arguments first; `--help`, which every command has, is left out."""


def described() -> tuple[CommandDoc, ...]:
    """All commands, in the order of the help."""
    return tuple(_command_doc(each) for each in program().commands.values() if isinstance(each, TyperCommand))


def _command_doc(command: TyperCommand) -> CommandDoc:
    parameters = [each for each in command.params if isinstance(each, TyperArgument | TyperOption)]
    parameters.sort(key=lambda each: isinstance(each, TyperOption))
    return CommandDoc(
        name=command.name or "",
        group=command.rich_help_panel or "",
        help=command.help or "",
        example=(command.epilog or "").removeprefix(EXAMPLE),
        options=tuple(_option_doc(each) for each in parameters),
    )


def _option_doc(parameter: TyperArgument | TyperOption) -> OptionDoc:
    return OptionDoc(
        flags=tuple(parameter.opts) if isinstance(parameter, TyperOption) else (),
        metavar="" if isinstance(parameter, TyperOption) and parameter.is_flag else parameter.metavar or "",
        default=_text(parameter.default),
        help=parameter.help or "",
        required=parameter.required,
    )


def _text(default: object) -> str:
    if default is None or default is False:
        return ""
    if isinstance(default, Sequence) and not isinstance(default, str):
        return ", ".join(str(each) for each in default)
    return str(default)
