"""The command line `salab`: what was typed, and how it ends."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from app.commands.program import run
from app.errors import LabError
from study.records import StudyError

if TYPE_CHECKING:
    from study.flow.flow import Flow


def main(arguments: Sequence[str] | None = None, flow: Flow | None = None) -> int:
    """Run one command, with pages of one's own if a `flow` is given; an error the user can mend is one line on stderr
    and exit status 1."""
    try:
        return run(sys.argv[1:] if arguments is None else arguments, flow)
    except (LabError, StudyError) as error:
        print(f"salab: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
