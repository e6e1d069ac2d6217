"""An export in pandas: how often tasks succeed under each condition, and how long they take.

    salab simulate --participants 6 --out pilot
    python docs/examples/10_export_in_pandas/success_by_condition.py pilot

`salab export` writes the same tables of real participants. `codebook.csv` beside them says what each column means.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

TICK_S = 0.5
KEY = ["participant", "condition", "trial", "task"]


def success_by_condition(export: Path) -> pd.DataFrame:
    """One row for each condition and kind of task: tasks run, share that succeeded, mean seconds of those that did."""
    tasks = pd.read_parquet(export / "tasks.parquet")
    ticks = pd.read_parquet(export / "ticks.parquet")
    # A dropoff after a failed pickup was never run: it says nothing about the condition.
    tasks = tasks[tasks.outcome != "not_run"]
    # Ticks of a reset belong to no task. Pauses have no rows, so they do not count as time.
    taken_s = ticks.dropna(subset="task").groupby(KEY).size().mul(TICK_S).rename("seconds").reset_index()
    tasks = tasks.merge(taken_s, on=KEY)
    tasks["success"] = tasks.outcome == "success"
    tasks["seconds"] = tasks.seconds.where(tasks.success)
    return tasks.groupby(["condition", "kind"]).agg(
        tasks=("success", "size"), success=("success", "mean"), seconds=("seconds", "mean")
    )


if __name__ == "__main__":
    print(success_by_condition(Path(sys.argv[1])).round(2).to_string())
