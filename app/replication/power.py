"""`salab power`: the chance of each of the paper's significant differences against the number of participants.

Studies of every size are drawn from people simulated beforehand (those of `salab replicate --out DIR`, or fresh ones):
in one study nobody occurs twice, and the numbers of the six orders are as equal as they can be. Draws of one size
share people, so they are no more independent than the pool is large; the report says how large it was.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from app.errors import LabError
from app.replication.comparisons import ALPHA, compared, contrasts
from app.replication.formats import name_of
from app.replication.paper import CIRCULAR, CLAIMS, Claim
from app.replication.studies import Person, Pool, Values
from app.simulated.progress import progress
from app.simulated.study import MAX_WORKERS, check_count, run_jobs

TARGET = 0.80
BATCH = 25
"""Draws that a process takes at once: each batch costs it a copy of all people, and between batches progress shows."""
_WIDTH, _HEIGHT, _LEFT, _TOP, _RIGHT, _BOTTOM = 880, 520, 60, 40, 300, 50
_COLORS = ("#1b6ca8", "#d1495b", "#2e8b57", "#b8860b", "#6a4c93", "#444444")


@dataclass(frozen=True)
class Power:
    """Chance of significance in the paper's direction, by comparison and size."""

    sizes: tuple[int, ...]
    draws: int
    people: int
    chances: dict[Claim, tuple[float, ...]]

    def smallest(self, claim: Claim) -> int | None:
        """The smallest size from which on the chance is at least `TARGET`; None = not among these sizes."""
        found = None
        for size, chance in zip(self.sizes, self.chances[claim], strict=True):
            if chance < TARGET:
                found = None
            elif found is None:
                found = size
        return found


def check_draws(sizes: Sequence[int], draws: int, workers: int, people: int) -> None:
    """Raises `LabError` when such studies cannot be drawn from so many people. Cheap: ask before they are simulated."""
    check_count("draws", draws, 100_000)
    check_count("workers", workers, MAX_WORKERS)
    if not sizes:
        raise LabError("no sizes; give at least one number of participants")
    for size in sorted(sizes):
        if not 2 <= size <= people:
            raise LabError(
                f"size {size}; it must be from 2 to {people}, the number of simulated people; "
                "simulate more studies for larger sizes"
            )


def power(
    values: Sequence[Values], sizes: Sequence[int], draws: int, seed: int, workers: int, circular: bool = False
) -> Power:
    """Draw `draws` studies of every size and test them. Raises `LabError` out of bounds."""
    pool = Pool.of(values)
    check_draws(sizes, draws, workers, len(pool.people))
    wanted = tuple(sorted(set(sizes)))
    claims = tuple(c for c in CLAIMS if c.verdict == "different" and (circular or c.measure not in CIRCULAR))
    jobs = [(size, draw) for size in wanted for draw in range(draws)]
    found: dict[tuple[int, int], dict[Claim, bool]] = {}
    with progress("studies drawn", len(jobs)) as bar:
        if workers == 1:
            for job in jobs:
                found[job] = _draw(pool, claims, seed, job)
                bar.update()
        else:
            batches = [tuple(jobs[start : start + BATCH]) for start in range(0, len(jobs), BATCH)]
            for batch, results in run_jobs(partial(_draw_batch, pool, claims, seed), batches, workers):
                found.update(zip(batch, results, strict=True))
                bar.update(len(batch))
    chances = {
        claim: tuple(sum(found[size, draw][claim] for draw in range(draws)) / draws for size in wanted)
        for claim in claims
    }
    return Power(wanted, draws, len(pool.people), chances)


def _draw_batch(
    pool: Pool, claims: tuple[Claim, ...], seed: int, jobs: Sequence[tuple[int, int]]
) -> list[dict[Claim, bool]]:
    return [_draw(pool, claims, seed, job) for job in jobs]


def _draw(pool: Pool, claims: tuple[Claim, ...], seed: int, job: tuple[int, int]) -> dict[Claim, bool]:
    """One study of that size, tested."""
    size, draw = job
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(size, draw)))
    found = contrasts(compared(pool.values(choose_people(pool.people, size, rng)), claims))
    return {
        claim: claim in found and found[claim].p < ALPHA and found[claim].difference * claim.sign > 0.0
        for claim in claims
    }


def choose_people(people: Sequence[Person], size: int, rng: np.random.Generator) -> list[Person]:
    """So many people, the orders as equally often as the pool allows."""
    waiting: dict[tuple[str, ...], list[Person]] = {}
    for index in rng.permutation(len(people)):
        waiting.setdefault(people[index].order, []).append(people[index])
    queues = [waiting[order] for order in sorted(waiting)]
    rng.shuffle(queues)  # which orders get one more
    chosen: list[Person] = []
    while len(chosen) < size:
        for queue in queues:
            if queue and len(chosen) < size:
                chosen.append(queue.pop())
    return chosen


# ---- as text and picture --------------------------------------------------------------------------------------------


def table(result: Power) -> str:
    """Chances by size, and the size that is enough."""
    width = max(len(name_of(claim)) for claim in result.chances)
    lines = [
        f"{'comparison':<{width}}  " + "".join(f"{f'N={size}':>7}" for size in result.sizes) + f"  {TARGET:.0%} at"
    ]
    for claim, chances in result.chances.items():
        enough = result.smallest(claim)
        cells = "".join(f"{chance:>7.0%}" for chance in chances)
        lines.append(f"{name_of(claim):<{width}}  {cells}  {f'N={enough}' if enough else f'> {result.sizes[-1]}'}")
    return "\n".join(lines)


def write(result: Power, out_dir: Path) -> None:
    """`power.csv`, `power.md` and the curves, `power.svg`. Raises `LabError` when they cannot be written."""
    text = (
        "# Chance of the paper's significant differences\n\n"
        f"{result.draws} studies of every size drawn from {result.people} simulated people; significant at .05 in the "
        "paper's direction (Tukey after the paper's mixed model). The people are a model: these chances are only as "
        "good as it is, and belong to its layout, its robot and its numbers.\n\n"
        f"```\n{table(result)}\n```\n\n![curves](power.svg)\n"
    )
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        (out_dir / "power.md").write_text(text, encoding="utf-8")
        (out_dir / "power.svg").write_text(curves(result), encoding="utf-8")
        with (out_dir / "power.csv").open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(("measure", "kind", "first", "second", "participants", "chance", "draws"))
            for claim, chances in result.chances.items():
                for size, chance in zip(result.sizes, chances, strict=True):
                    place = (claim.measure, claim.kind, claim.first, claim.second)
                    rows.writerow((*place, size, f"{chance:.4f}", result.draws))
    except OSError as error:
        raise LabError(f"{out_dir}: cannot be written: {error.strerror or error}") from None


def curves(result: Power) -> str:
    """The chances as an SVG picture: one curve a comparison, a line at the target."""
    inner_w, inner_h = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM
    most = max(result.sizes)

    def x(size: float) -> float:
        return _LEFT + inner_w * size / most

    def y(chance: float) -> float:
        return _TOP + inner_h * (1.0 - chance)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" font-family="sans-serif" '
        f'font-size="12"><rect width="{_WIDTH}" height="{_HEIGHT}" fill="white"/>'
        f'<text x="{_LEFT}" y="22" font-size="15">Chance of significance at .05 by number of participants</text>'
    ]
    for step in range(6):
        chance = step / 5.0
        parts.append(
            f'<line x1="{_LEFT}" x2="{_LEFT + inner_w}" y1="{y(chance):.1f}" y2="{y(chance):.1f}" stroke="#ddd"/>'
            f'<text x="{_LEFT - 8}" y="{y(chance) + 4:.1f}" text-anchor="end">{chance:.0%}</text>'
        )
    parts.append(
        f'<line x1="{_LEFT}" x2="{_LEFT + inner_w}" y1="{y(TARGET):.1f}" y2="{y(TARGET):.1f}" stroke="#888" '
        'stroke-dasharray="5 4"/>'
    )
    for size in result.sizes:
        parts.append(f'<text x="{x(size):.1f}" y="{_TOP + inner_h + 18}" text-anchor="middle">{size}</text>')
    middle = _LEFT + inner_w / 2
    parts.append(f'<text x="{middle}" y="{_HEIGHT - 10}" text-anchor="middle">participants</text>')
    for number, (claim, chances) in enumerate(result.chances.items()):
        color = _COLORS[number % len(_COLORS)]
        dashes = ("none", "7 3", "2 3")[number // len(_COLORS) % 3]
        points = " ".join(f"{x(s):.1f},{y(c):.1f}" for s, c in zip(result.sizes, chances, strict=True))
        key = _TOP + 10 + 20 * number
        start = _LEFT + inner_w + 16
        style = f'fill="none" stroke="{color}" stroke-width="2" stroke-dasharray="{dashes}"'
        parts.append(f'<polyline points="{points}" {style}/>')
        parts.append(f'<line x1="{start}" x2="{start + 26}" y1="{key}" y2="{key}" {style}/>')
        parts.append(f'<text x="{start + 32}" y="{key + 4}">{name_of(claim)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"
