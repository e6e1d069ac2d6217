"""The headings under which the help lists the commands."""

from __future__ import annotations

from typing import Any, Final

from typer.core import TyperGroup

RUN_A_STUDY: Final = "Run a study"
STUDY_FILE: Final = "Study file"
DATA: Final = "Data"
SIMULATE_AND_ANALYSE: Final = "Simulate and analyse"
GROUPS: Final = (RUN_A_STUDY, STUDY_FILE, DATA, SIMULATE_AND_ANALYSE)
"""In the order of the help. A command names its own as `rich_help_panel`."""


class GroupedHelp(TyperGroup):
    """Lists commands by group in plain text. The library would need rich for that, which takes longer to load than
    everything else of `salab --help`."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a section for each group, their columns aligned."""
        width = max(len(name) for name in self.commands)
        for group in GROUPS:
            with formatter.section(group):
                formatter.write_dl(
                    [
                        (name.ljust(width), command.get_short_help_str(limit=formatter.width))
                        for name, command in self.commands.items()
                        if getattr(command, "rich_help_panel", None) == group
                    ]
                )
