"""`python -m app.jobs.erase_job DATA PARTICIPANT UTC`: somebody is erased, for a running lab.

The database has one writer at a time: ticks of other sessions wait for the one transaction, and no longer. It is all
done or not at all, whoever is killed.
"""

from __future__ import annotations

import sys
from typing import Any

from app.jobs.work import Say, run
from study.store import DataPlace, handed_over, open_store


def erase(data: DataPlace, participant: str, utc: str, say: Say) -> dict[str, Any]:
    """Erase; whether the space is overwritten too."""
    say({"step": 1, "of": 1, "text": f"Erasing {participant}"})
    with open_store(data, must_exist=True) as store:
        return {"overwritten": store.erase(participant, utc)}


def main() -> int:
    """Run as a program. It holds the database while it writes: it is not to be slow."""
    folder, participant, utc = sys.argv[1:]
    return run(lambda say: erase(handed_over(folder), participant, utc, say), niceness=0)


if __name__ == "__main__":
    sys.exit(main())
