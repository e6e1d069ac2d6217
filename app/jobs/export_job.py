"""`python -m app.jobs.export_job DATA ARCHIVE [--pilot] [--excel-safe]`: an archive of the data, for a running lab."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from app.jobs.work import Say, run
from study.export.export import export_zip
from study.records import TABLES
from study.store import DataPlace, handed_over, open_store

PILOT, EXCEL_SAFE = "--pilot", "--excel-safe"
STEPS = (*TABLES, "the archive")


def make_archive(
    data: DataPlace | Path, archive: Path, say: Say, *, include_pilot: bool = False, excel_safe: bool = False
) -> dict[str, Any]:
    """Write it; its size in bytes and how many ticks are in it."""

    def told(what: str, rows: int) -> None:
        counted = f" ({rows:,} rows)" if rows else ""
        say({"step": STEPS.index(what) + 1, "of": len(STEPS), "text": f"Writing {what.replace('_', ' ')}{counted}"})

    with open_store(data, must_exist=True) as store:
        rows = export_zip(store, archive, include_pilot=include_pilot, excel_safe=excel_safe, told=told)
    return {"bytes": archive.stat().st_size, "rows": rows["ticks"]}


def main() -> int:
    """Run as a program."""
    folder, archive, *options = sys.argv[1:]
    wanted = {"include_pilot": PILOT in options, "excel_safe": EXCEL_SAFE in options}
    return run(lambda say: make_archive(handed_over(folder), Path(archive), say, **wanted))


if __name__ == "__main__":
    sys.exit(main())
