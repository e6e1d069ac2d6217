"""Makes data.csv: what lme4 was fitted to. Values of a simulated study, and data that are hard in one way each.

python make_data.py REPORT data.csv     REPORT: the folder of `salab analyze` on a simulated study of twelve people
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

Row = tuple[float, str, int, str, str]
"""Value, condition, position, goal, participant."""
CONDITIONS = ("teleoperation", "balanced", "goal_oriented")
ORDERS = ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2))


def made(
    seed: int,
    people: int = 6,
    tasks: int = 6,
    sds: tuple[float, float, float] = (0.5, 0.8, 0.6),
    keep: Callable[[Row, float], bool] = lambda row, chance: True,
    scale: float = 1.0,
    level: float = 10.0,
) -> list[Row]:
    """A study: `sds` of positions, goals and people in residual SDs; `keep` gets a row and a number from 0 to 1."""
    rng = np.random.default_rng(seed)
    of_place, of_goal = rng.normal(0, 1, 3) * sds[0], rng.normal(0, 1, tasks) * sds[1]
    of_person, of_condition = rng.normal(0, 1, people) * sds[2], (0.0, 0.3, 0.9)
    rows = []
    for person in range(people):
        for place, condition in enumerate(ORDERS[person % 6], 1):
            for goal in range(tasks):
                told = of_condition[condition] + of_place[place - 1] + of_goal[goal] + of_person[person]
                value = float(f"{scale * (level + told + rng.normal()):.9g}")
                row = (value, CONDITIONS[condition], place, f"goal{goal}", f"P{person + 1:03d}")
                if keep(row, rng.random()):
                    rows.append(row)
    return rows


def simulated(report: Path) -> dict[str, list[Row]]:
    """Values of the objective measures, pickups and all tasks, as the analysis selects them."""
    with (report / "tasks.csv").open(encoding="utf-8", newline="") as file:
        tasks = [row for row in csv.DictReader(file) if row["analysed"] == "True"]
    with (report / "windows.csv").open(encoding="utf-8", newline="") as file:
        windows = [row for row in csv.DictReader(file) if row["analysed"] == "True"]
    gains = [row for row in windows if row["gain"] and float(row["entropy_before"]) > 0.7]
    converged = [row for row in tasks if row["convergence_user_actions"]]
    found = {}
    for name, rows, column in (
        ("efficiency", tasks, "efficiency_ticks"),
        ("convergence", converged, "convergence_user_actions"),
        ("gain", gains, "gain"),
    ):
        for kind in ("pickup", "all"):
            found[f"simulated_{name}_{kind}"] = [
                (
                    float(f"{float(row[column]):.9g}"),
                    row["condition"],
                    int(row["position"]),
                    row["goal"],
                    row["participant"],
                )
                for row in rows
                if kind in ("all", row["kind"])
            ]
    return found


def cases(report: Path) -> dict[str, list[Row]]:
    """Every case by its name."""
    big, small = CONDITIONS[0], CONDITIONS[1]
    return {
        **simulated(report),
        "balanced": made(1),
        "unbalanced": made(2, keep=lambda row, chance: chance < 0.7),
        "heavily_unbalanced": made(
            3, 9, keep=lambda row, chance: row[1] == big or chance < (0.5 if row[1] == small else 0.1)
        ),
        "singular_position": made(22, sds=(0.0, 0.8, 0.5)),
        "singular_all": made(27, sds=(0.0, 0.0, 0.0)),
        "missing_cell": made(6, keep=lambda row, chance: not (row[1] == small and row[3] in ("goal0", "goal1"))),
        "missing_condition": made(7, keep=lambda row, chance: row[1] != small),
        "one_level_position": [(v, c, 1, g, p) for v, c, _, g, p in made(8)],
        "one_level_goal": [(v, c, place, "goal0", p) for v, c, place, _, p in made(9)],
        "tiny": made(10, people=3, tasks=2),
        "large_scale": made(11, scale=1000.0, level=100.0),
        "thousandths": made(12, scale=0.001, level=0.0),
        "far_from_zero": made(13, level=1e6),
        "strong_goals": made(14, sds=(3.0, 20.0, 0.2), keep=lambda row, chance: chance < 0.85),
        "skewed": [(round(float(np.exp(v - 9.0)), 6), c, place, g, p) for v, c, place, g, p in made(15)],
        "four_conditions": made(16, people=6)
        + [(v + 0.5, "fourth", place, g, p) for v, c, place, g, p in made(17) if c == big],
    }


def write(found: dict[str, Iterable[Row]], path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("case", "value", "condition", "position", "goal", "participant"))
        for case, rows in found.items():
            writer.writerows((case, f"{row[0]:.9g}", *row[1:]) for row in rows)


if __name__ == "__main__":
    write(dict(cases(Path(sys.argv[1]) / "tables")), Path(sys.argv[2]))
