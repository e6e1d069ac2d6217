"""The command line `salab`, a file for each kind of command. Importing it loads nothing heavy."""

from app.commands.documentation import CommandDoc, OptionDoc, described

__all__ = ["CommandDoc", "OptionDoc", "described"]
