"""The command line `salab`: what was typed, and how it ends."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

OLDEST = (3, 10)
if sys.version_info < OLDEST:  # before anything is imported that an older one cannot read
    sys.exit(
        f"salab: this is Python {sys.version_info[0]}.{sys.version_info[1]}, the lab needs 3.10 to 3.14: install one "
        "(Debian 12, Ubuntu 22.04 and later: apt-get install python3 python3-venv; anywhere: uv python install 3.13), "
        "and the lab into it"
    )

CHECKOUT = Path(__file__).resolve().parents[1]

PRIVATE = 0o077
"""What the program writes, others cannot read: database, exports, backups and reports are about people."""
IS_PATH_SAFE = bool(sys.flags.isolated or getattr(sys.flags, "safe_path", False))

if __name__ == "__main__" and not IS_PATH_SAFE and Path(sys.path[0]).resolve() != CHECKOUT:
    # `python -m` looks for modules and installed packages in the current folder first. That may be a stranger's, with
    # study file and all, whose code is not to run unasked, here or in a process that this one starts.
    del sys.path[0]
    os.environ["PYTHONSAFEPATH"] = "1"

# Else pydantic looks for plugins, which the lab has none of, in every installed package; one broken file would stop it.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
# The matrices are small, threads that share one would only wait for each other, and the last digits of what is computed
# would hang on the number of processors. To be set before numpy is loaded; processes that this one starts inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from app.commands import console  # noqa: E402
from app.commands.program import run  # noqa: E402
from app.errors import LabError  # noqa: E402
from study.extras import missing_extra  # noqa: E402
from study.records import StudyError  # noqa: E402

if TYPE_CHECKING:
    from study.flow.flow import Flow


def main(arguments: Sequence[str] | None = None, flow: Flow | None = None) -> int:
    """Run one command, with pages of one's own if a `flow` is given; an error the user can mend is one line on stderr
    and exit status 1."""
    console.prepare()
    os.umask(PRIVATE)
    try:
        status = run(sys.argv[1:] if arguments is None else arguments, flow)
        console.flush()
        return status
    except (LabError, StudyError) as error:
        console.complain(error)
        return getattr(error, "exit_status", 1)
    except ModuleNotFoundError as error:
        what = missing_extra(error)
        if what is None:
            raise
        console.complain(LabError(f"this {what}"))
        return 1
    except BrokenPipeError:
        console.hush()
        return console.GONE
    except OSError as error:  # a folder without permission, a disk that is full, a name that is too long
        console.hush()
        console.complain(LabError(console.of_system(error)))
        return 1
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
