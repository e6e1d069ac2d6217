"""Questionnaires of one's own, docs/examples/07_questionnaire: in a file beside the study file, and from a package."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.trial.world import open_study, parse_stored
from study.export.export import read_table
from tests.support.lab_server import ROOT
from tests.support.outside_package import install_project, installed_at, salab

pytestmark = pytest.mark.slow

EXAMPLE = ROOT / "docs" / "examples" / "07_questionnaire"
PACKAGED = EXAMPLE / "study_with_package.toml"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    folder = tmp_path / "site"
    folder.mkdir()
    install_project(folder, EXAMPLE / "package")
    return folder


def text_and_check(site: Path, study: Path) -> tuple[str, str]:
    """What is wrong with a study file where that is installed, and the line that says that nothing is."""
    done = salab("check", str(study), environment=installed_at(site))
    return done.stderr.replace(f"{study.parent}/", ""), done.stdout


def test_one_beside_the_study_file_is_asked_and_exported(tmp_path: Path) -> None:
    calm, tlx = open_study(EXAMPLE / "study.toml").instruments
    assert (calm.id, calm.points, calm.method, tlx.id) == ("calm", 5, "mean", "tlx_raw")
    out = tmp_path / "out"
    done = salab("simulate", "--study", str(EXAMPLE / "study.toml"), "--participants", "1", "--out", str(out))
    assert done.returncode == 0, done.stderr
    asked = {row.item for row in read_table(out, "survey_answers") if row.instrument == "calm"}
    assert asked == {"calm", "startled"}


def test_one_of_a_package_becomes_a_part_of_the_studys_text(site: Path, tmp_path: Path) -> None:
    assert text_and_check(site, PACKAGED)[0] == ""
    out = tmp_path / "out"
    arguments = ("simulate", "--study", str(PACKAGED), "--participants", "1", "--out", str(out))
    done = salab(*arguments, environment=installed_at(site))
    assert done.returncode == 0, done.stderr
    assert {row.item for row in read_table(out, "survey_answers")} >= {"together", "in_my_way"}
    text = (out / "study.toml").read_text(encoding="utf-8")
    assert "# teamwork.toml, as salab-team-scales 1.0 brought it\n[[questionnaires]]" in text
    (teamwork,) = parse_stored(text, "a stored study").instruments  # here, where no such package is installed
    assert teamwork.title == "About working together"
    told = json.loads((out / "questionnaires.json").read_text(encoding="utf-8"))
    (asked,) = told["studies"].values()
    assert [form["id"] for form in asked["surveys"]] == ["teamwork"]
    report = tmp_path / "report"
    assert salab("analyze", str(out), "--out", str(report)).returncode == 0
    assert "About working together" in (report / "report.html").read_text(encoding="utf-8")


def test_without_the_package_the_ones_there_are_are_named(site: Path, tmp_path: Path) -> None:
    line = 'surveys[1] = "teamwork": not known; surveys: sus_modified, tlx_raw, or your own in teamwork.toml'
    assert line in salab("check", str(PACKAGED)).stderr
    study = tmp_path / "study.toml"
    study.write_text(PACKAGED.read_text(encoding="utf-8").replace('"teamwork"', '"teamworks"'), encoding="utf-8")
    said = text_and_check(site, study)[0].splitlines()
    assert said[0] == (
        'study.toml:13: surveys[1] = "teamworks": not known; did you mean '
        "'teamwork'? surveys: sus_modified, tlx_raw, teamwork, or your own in teamworks.toml beside this file"
    )


def test_a_name_in_a_file_and_in_a_package_is_an_error(site: Path, tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_bytes(PACKAGED.read_bytes())
    (tmp_path / "teamwork.toml").write_bytes((EXAMPLE / "calm.toml").read_bytes())
    said, _ = text_and_check(site, study)
    assert said.splitlines()[0] == (
        'study.toml:13: surveys[1] = "teamwork": stands in teamwork.toml and is brought by salab-team-scales 1.0 as '
        "well; rename the file"
    )


@pytest.mark.parametrize(
    ("source", "told"),
    [
        (
            "TEAMWORK = 7",
            "questionnaire 'teamwork' of salab-team-scales 1.0: team_scales:TEAMWORK is of type int; it must be "
            "a text or a pathlib.Path",
        ),
        (
            "import not_there",
            "questionnaire 'teamwork' (team_scales:TEAMWORK) cannot be loaded: ModuleNotFoundError: No "
            "module named 'not_there'",
        ),
        (
            "TEAMWORK = 'title = 3'",
            "questionnaire 'teamwork' of salab-team-scales 1.0 cannot be used: teamwork.toml: "
            "intro: missing; must be a text (and 3 more)",
        ),
        (
            "from pathlib import Path\nTEAMWORK = Path('gone.toml')",
            "questionnaire 'teamwork' of salab-team-scales 1.0: gone.toml cannot be read: No such file or directory",
        ),
    ],
)
def test_one_that_is_broken_is_one_line(source: str, told: str, site: Path) -> None:
    (site / "team_scales" / "__init__.py").write_text(source, encoding="utf-8")
    said = text_and_check(site, PACKAGED)[0].splitlines()
    assert said == [
        f'study_with_package.toml:13: surveys[1] = "teamwork": {told}',
        "study_with_package.toml: 1 problem",
    ]
