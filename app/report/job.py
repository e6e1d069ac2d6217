"""`python -m app.report.job DATA OUT`: the report of the data so far, made in a process of its own for a running lab.

It reads the database beside the lab, at low priority, and says on stdout how far it is, a JSON object a line:

    {"step": 2, "of": 4, "text": "Measuring the trials"}
    {"made": {"participants": 12, "trials": 36, "figures": [{"name": ..., "title": ...}]}}
    {"cannot": "No trial is completed yet ..."}

Pilot and demo participants are left out. OUT is replaced when all is done, not before.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

from app.jobs.work import NICENESS, Say, say
from app.processes import step_back
from study.export.export import export
from study.extras import missing_extra
from study.records import StudyError
from study.store import DataPlace, handed_over, open_store

STEPS = ("Reading the records", "Measuring the trials", "Comparing the conditions", "Drawing the figures")
WORK_PREFIX = ".report-"
"""What the folder of a job begins with, beside OUT. A job that is killed leaves it; it holds an export."""


def make_report(data_place: DataPlace | Path, out: Path, say: Say) -> None:
    """Export, measure, compare, draw. What cannot be computed yet is said in a sentence."""

    def step(number: int) -> None:
        say({"step": number, "of": len(STEPS), "text": STEPS[number - 1]})

    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=WORK_PREFIX, dir=out.parent) as made:
        package, report = Path(made) / "data", Path(made) / "report"
        try:
            step(1)
            with open_store(data_place, must_exist=True) as store:
                export(store, package)
            step(2)
            # Imported when there is something to compute: they load the statistics and the plotting.
            from app.report.figure2 import heatmap_of
            from study.analysis.analysis import analyse
            from study.analysis.dataset import load
            from study.analysis.figures import draw_all
            from study.analysis.report import write_drawn

            data = load(package, without_unusable=True, as_written=True)
            step(3)
            analysis = analyse(data)
        except StudyError as error:
            say({"cannot": sentence(str(error), package)})
            return
        except ModuleNotFoundError as error:
            what = missing_extra(error)
            if what is None:
                raise
            say({"cannot": f"The report {what}"})
            return
        step(4)
        pictures = draw_all(analysis, heatmap_of(data))
        write_drawn(analysis, report, pictures)
        shutil.rmtree(out, ignore_errors=True)
        os.replace(report, out)
    quality = data.quality
    figures = [{"name": picture.name, "title": picture.title} for picture in pictures]
    say({"made": {"participants": quality.participants, "trials": quality.trials, "figures": figures}})


def sentence(text: str, folder: Path) -> str:
    """An error of the analysis for somebody who never saw the folder it is about."""
    words = text.removeprefix(f"{folder}: ").replace(", then export again", "")
    return f"{words[:1].upper()}{words[1:].rstrip('.')}."


def main() -> int:
    """Run as a program."""
    folder, out = sys.argv[1:3]
    step_back(NICENESS)
    make_report(handed_over(folder), Path(out), say)
    return 0


if __name__ == "__main__":
    sys.exit(main())
