"""Power: the chance of each difference by size, from simulated people."""

from __future__ import annotations

import csv
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.errors import LabError
from app.replication.paper import CIRCULAR, CLAIMS
from app.replication.power import Power, choose_people, curves, power, table, write
from app.replication.studies import Pool
from tests.support.study_values import ORDERS, as_the_paper_found

pytestmark = pytest.mark.slow

DIFFERENT = [claim for claim in CLAIMS if claim.verdict == "different" and claim.measure not in CIRCULAR]


@pytest.fixture(scope="module")
def found() -> Power:
    rng = np.random.default_rng(1)
    return power([as_the_paper_found(rng) for _ in range(4)], (6, 36), draws=6, seed=1, workers=1)


def test_nobody_occurs_twice_and_orders_are_balanced() -> None:
    rng = np.random.default_rng(2)
    pool = Pool.of([as_the_paper_found(rng) for _ in range(3)])
    assert len(pool.people) == 36
    for size in (6, 7, 12, 20, 36):
        chosen = choose_people(pool.people, size, rng)
        assert len(set(chosen)) == size
        counts = Counter(person.order for person in chosen)
        assert set(counts) == set(ORDERS)
        assert max(counts.values()) - min(counts.values()) <= 1


def test_a_drawn_study_holds_its_people_s_values_and_no_others() -> None:
    rng = np.random.default_rng(3)
    studies = [as_the_paper_found(rng) for _ in range(2)]
    pool = Pool.of(studies)
    values = pool.values(choose_people(pool.people, 12, rng))
    key = ("efficiency_ticks", "all")
    assert len({one.participant for one in values.observations[key]}) == 12
    known = {one.value for study in studies for one in study.observations[key]}
    assert {one.value for one in values.observations[key]} <= known


def test_more_people_find_more(found: Power) -> None:
    assert set(found.chances) == set(DIFFERENT)
    few, many = (np.mean([chances[place] for chances in found.chances.values()]) for place in (0, 1))
    assert many > few + 0.1
    assert found.people == 48


def test_without_an_effect_there_is_no_power() -> None:
    rng = np.random.default_rng(4)
    nothing = power([as_the_paper_found(rng, effect=0.0) for _ in range(2)], (12,), draws=8, seed=1, workers=1)
    assert np.mean([chances[0] for chances in nothing.chances.values()]) < 0.1


def test_two_processes_find_the_same() -> None:
    rng = np.random.default_rng(5)
    studies = [as_the_paper_found(rng)]
    assert power(studies, (6,), 2, 1, workers=2) == power(studies, (6,), 2, 1, workers=1)


def test_the_smallest_size_is_the_one_from_which_on_it_holds() -> None:
    claim = DIFFERENT[0]
    assert Power((6, 12, 24), 10, 48, {claim: (0.5, 0.85, 0.9)}).smallest(claim) == 12
    assert Power((6, 12, 24), 10, 48, {claim: (0.85, 0.7, 0.9)}).smallest(claim) == 24
    assert Power((6, 12, 24), 10, 48, {claim: (0.5, 0.85, 0.7)}).smallest(claim) is None


def test_table_and_curves_show_every_difference(found: Power, tmp_path: Path) -> None:
    write(found, tmp_path)
    assert len(table(found).splitlines()) == 1 + len(DIFFERENT)
    picture = ET.fromstring(curves(found))
    assert len(picture.findall(".//{*}polyline")) == len(DIFFERENT)
    with (tmp_path / "power.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * len(DIFFERENT)
    assert "48 simulated people" in (tmp_path / "power.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("sizes", "draws", "told"),
    [((49,), 1, "from 2 to 12"), ((1,), 1, "from 2 to 12"), ((), 1, "no sizes"), ((6,), 0, "draws is 0")],
)
def test_sizes_that_cannot_be_drawn_are_told(sizes: tuple[int, ...], draws: int, told: str) -> None:
    with pytest.raises(LabError, match=told):
        power([as_the_paper_found(np.random.default_rng(6))], sizes, draws, 1, 1)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("--sizes 1", "size 1; it must be from 2 to 480"),
        ("--sizes 6 500", "size 500; it must be from 2 to 480"),
        ("--studies 2 --sizes 6 25", "size 25; it must be from 2 to 24"),
        ("--draws 0", "draws is 0"),
        ("--workers 0", "workers is 0"),
        ("--studies 0", "studies is 0"),
    ],
)
def test_the_command_tells_what_is_out_of_bounds_before_it_simulates(
    wrong: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def simulated(*given: object) -> None:
        pytest.fail("people were simulated first")

    monkeypatch.setattr("app.replication.studies.run_studies", simulated)
    assert main(["power", *wrong.split(), "--out", str(tmp_path / "out")]) == 1
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_command_uses_what_was_simulated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["power", "--studies", "0", "--out", str(tmp_path / "out")]) == 1
    assert "studies is 0" in capsys.readouterr().err
