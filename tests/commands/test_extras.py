"""An installation that only serves: what needs an extra says in one line which, and everything else goes on."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from study.export.export import FORMAT
from study.export.parquet import NoTable, ParquetTable
from study.extras import EXTRAS
from study.records import SCHEMA_VERSION, columns
from study.store import open_store
from tests.support.study_samples import small_study, tick_row

ROOT = Path(__file__).resolve().parents[2]
ANALYSIS = "pip install 'shared-autonomy-lab[analysis]'"

WITHOUT_EXTRAS = """
import contextlib, io, json, sys
from pathlib import Path
sys.modules.update(dict.fromkeys(json.loads(sys.argv[1])))  # none of them can be imported
from app.__main__ import main
from app.report.job import make_report
for line in json.loads(sys.argv[2]):
    out, err, said = io.StringIO(), io.StringIO(), []
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = make_report(*map(Path, line[1:]), said.append) if line[0] == "job" else main(line)
    print(json.dumps([status, out.getvalue(), err.getvalue(), said]))
"""


@dataclass(frozen=True)
class Answer:
    """What a command, or the job that makes a report, had to say."""

    status: int | None
    out: str
    err: str
    said: list[dict[str, str]]


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Answer]:
    """Commands by their names, run one after another where no extra is installed."""
    folder = tmp_path_factory.mktemp("serving")
    study = folder / "small.toml"
    study.write_text(small_study().source_text, encoding="utf-8")
    pilot = str(folder / "pilot")
    lines = {
        "simulate": ["simulate", "--study", str(study), "--participants", "1", "--out", pilot],
        "verify": ["verify", pilot],
        "verify Parquet": ["verify", str(folder / "older")],
        "check": ["check", str(study)],
        "check --picture": ["check", str(study), "--picture", str(folder / "layout.png")],
        "analyze": ["analyze", pilot, "--out", str(folder / "report")],
        "figure2": ["figure2", "--out", str(folder / "maps")],
        "replicate": ["replicate", "--studies", "1"],
        "power": ["power", "--out", str(folder / "power")],
        "job": ["job", str(folder / "data"), str(folder / "made")],
    }
    older = folder / "older"
    older.mkdir()
    meta = {"format": FORMAT, "complete": True, "schema_version": SCHEMA_VERSION}
    (older / "meta.json").write_text(json.dumps(meta), encoding="utf-8")
    open_store(folder / "data").close()
    modules = [module for names in EXTRAS.values() for module in names]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_EXTRAS, json.dumps(modules), json.dumps(list(lines.values()))],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=240,
    )
    assert done.returncode == 0, done.stderr
    return {name: Answer(*json.loads(line)) for name, line in zip(lines, done.stdout.splitlines(), strict=True)}


@pytest.mark.parametrize(
    ("command", "module"),
    [("analyze", "scipy"), ("figure2", "matplotlib"), ("replicate", "scipy"), ("power", "scipy")],
)
def test_a_command_that_needs_one_says_which(answers: dict[str, Answer], command: str, module: str) -> None:
    answer = answers[command]
    assert (answer.status, answer.out) == (1, "")
    assert answer.err == f"salab: this needs {module}, which is not installed: {ANALYSIS}\n"


def test_data_are_simulated_and_verified_as_csv_alone(answers: dict[str, Answer]) -> None:
    assert answers["simulate"].status == 0
    assert answers["simulate"].out.rstrip().endswith(f"(CSV alone; for Parquet too: {ANALYSIS})")
    assert answers["verify"].status == 0
    assert "written without Parquet" in answers["verify"].out
    assert answers["verify Parquet"].err.endswith(f"older: to compare its Parquet with the CSV: {ANALYSIS}\n")
    assert answers["verify Parquet"].status == 1


def test_a_study_is_checked_without_a_picture_unless_one_is_asked_for(answers: dict[str, Answer]) -> None:
    needs = f"needs matplotlib, which is not installed: {ANALYSIS}\n"
    assert answers["check"].status == 0
    assert answers["check"].out.endswith(f"is not drawn: that {needs}")
    assert (answers["check --picture"].status, answers["check --picture"].err) == (1, f"salab: this {needs}")


def test_the_dashboard_is_told_why_there_is_no_report(answers: dict[str, Answer]) -> None:
    said = answers["job"].said[-1]
    assert said == {"cannot": f"The report needs scipy, which is not installed: {ANALYSIS}"}


@pytest.mark.parametrize(
    ("column", "value"),
    [("started_utc", "yesterday"), ("tick", 2**63), ("belief", "\ud800")],
)
def test_csv_alone_refuses_what_parquet_would(tmp_path: Path, column: str, value: object) -> None:
    names = [info.name for info in columns("ticks")]
    good = [[value] for value in (getattr(tick_row("P001"), name) for name in names)]
    bad = [[value] if name == column else cell for name, cell in zip(names, good, strict=True)]
    with ParquetTable(tmp_path / "ticks.parquet", "ticks") as packed, NoTable("ticks") as plain:
        packed.arrays(good)
        plain.arrays(good)
        for table in (packed, plain):
            with pytest.raises((ValueError, OverflowError)):
                table.arrays(bad)
