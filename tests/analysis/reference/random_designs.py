"""How far the mixed model and R differ over random designs: the figures of docs/topics/statistics.md.

python -m tests.analysis.reference.random_designs make 200 2 random.csv      200 designs, seed 2
Rscript tests/analysis/reference/fit.R random.csv random.json
python -m tests.analysis.reference.random_designs compare random.csv random.json
"""

from __future__ import annotations

import csv
import json
import math
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from study.analysis.effect_sizes import NotFitted
from study.analysis.linear_model import Anova, tukey
from study.analysis.mixed_model import mixed_model

COLUMNS = ("case", "value", "condition", "position", "goal", "participant")
COVARIATES = {"random": ("position", "goal"), "with_participant": ("position", "goal", "participant")}


def design(rng: np.random.Generator) -> list[tuple[float, str, int, str, str]]:
    """Two to four conditions, few or many people, values left out, any unit, variances of 0 or large."""
    k, people = int(rng.choice([2, 3, 3, 3, 4])), int(rng.integers(2, 13))
    goals, tasks = int(rng.choice([2, 3, 6, 6, 10])), int(rng.integers(1, 8))
    sds = rng.choice([0.0, 0.0, 0.05, 0.2, 0.5, 1.0, 3.0], 3)
    scale = 10.0 ** rng.uniform(-3, 4)
    level = float(rng.choice([0, 1, 10]))
    of_place, of_goal, of_person = (rng.normal(0, 1, n) * sd for n, sd in zip((k, goals, people), sds, strict=True))
    of_condition = rng.normal(0, 1, k) * rng.choice([0.0, 0.3, 1.0])
    missing, skewed = float(rng.choice([0, 0.1, 0.3, 0.6])), rng.random() < 0.3
    no_cell, one_place = rng.random() < 0.15, rng.random() < 0.1
    rows = []
    for person in range(people):
        for place, condition in enumerate(rng.permutation(k)):
            for task in range(tasks):
                goal = int(rng.integers(goals)) if rng.random() < 0.5 else task % goals
                noise = rng.exponential() - 1.0 if skewed else rng.normal()
                if rng.random() < missing or (no_cell and condition == 0 and goal == 0):
                    continue
                told = level + of_condition[condition] + of_place[place] + of_goal[goal] + of_person[person] + noise
                rows.append((scale * told, "tgbx"[condition], 1 if one_place else place + 1, f"g{goal}", f"P{person}"))
    return rows


def make(count: int, seed: int, path: Path) -> None:
    rng = np.random.default_rng(seed)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for case in range(count):
            writer.writerows((f"r{case:04d}", f"{row[0]:.10g}", *row[1:]) for row in design(rng))


def compare(data: Path, fitted: Path) -> None:
    """Prints the largest relative difference of each figure, and how many fits were compared."""
    rows: dict[str, list[dict[str, str]]] = {}
    with data.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            rows.setdefault(row["case"], []).append(row)
    worst: dict[str, tuple[float, str]] = {}
    counts: Counter[str] = Counter()
    for case, of in json.loads(fitted.read_text(encoding="utf-8"))["cases"].items():
        values, kinds = [float(row["value"]) for row in rows[case]], [row["condition"] for row in rows[case]]
        for name, covariates in COVARIATES.items():
            model = mixed_model(values, kinds, {key: [row[key] for row in rows[case]] for key in covariates})
            if isinstance(model, NotFitted) or "error" in of[name]:
                counts["not fitted here" if isinstance(model, NotFitted) else "not fitted in R alone"] += 1
                continue
            counts["compared"] += 1
            counts["of these singular"] += any(part.sd == 0.0 for part in model.random)
            counts["of these with another criterion"] += abs(model.criterion - of[name]["criterion"]) > 1e-6
            for method, test in (("satterthwaite", model.anova), ("kenward_roger", model.kenward_roger)):
                if not isinstance(test, Anova):
                    counts["without Kenward and Roger's"] += 1
                    continue
                precision = 0.1 * model.residual_sd / math.sqrt(len(values))
                for key, ours, theirs, floor in _figures(test, of[name][method], precision):
                    if isinstance(theirs, (int, float)):
                        off = abs(ours - theirs) / max(abs(theirs), floor)
                        worst[f"{method} {key}"] = max(worst.get(f"{method} {key}", (0.0, "")), (off, f"{case} {name}"))
    for key, (off, where) in sorted(worst.items()):
        print(f"{key:40s} {off:.1e}  {where}")
    print(dict(counts))


def _figures(test: Anova, of: dict[str, Any], precision: float) -> list[tuple[str, float, Any, float]]:
    """Name, ours, R's, and the size below which a difference is taken as of that size."""
    tiny = 1e-300

    def listed(key: str) -> list[Any]:
        return of[key] if isinstance(of[key], list) else [of[key]]

    found = [("F", test.f, of["f"], 1e-3), ("df", test.df_error, of["df_error"], tiny), ("p", test.p, of["p"], 1e-10)]
    for mean, m, se, df in zip(test.adjusted_means, listed("means"), listed("se"), listed("df"), strict=True):
        found += [("mean", mean.mean, m, precision), ("se", mean.se, se, tiny), ("df of se", mean.df, df, tiny)]
    for index, pair in enumerate(tukey(test, intervals=False)):
        row, column = test.conditions.index(pair.first), test.conditions.index(pair.second)
        df = test.contrast_df[row][column]
        found.append(("df of pair", df, listed("pair_df")[index], tiny))
        few = " below 5 df" if df < 5.0 and len(test.conditions) > 2 else ""
        found.append((f"Tukey p{few}", pair.p, listed("p_tukey")[index], 1e-5))
    return found


if __name__ == "__main__":
    if sys.argv[1] == "make":
        make(int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
    else:
        compare(Path(sys.argv[2]), Path(sys.argv[3]))
