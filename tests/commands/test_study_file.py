"""`salab new`, `salab check` and `salab export --zip`, as typed."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest
from frictionless import validate

from app.trial.setup import study_setup
from app.trial.world import open_study
from sim.view import published
from study.definition.study import DEFAULT_STUDY
from study.export.export import read_meta, read_table
from study.flow.overview import expected_minutes, overview
from study.store import open_store
from tests.export.test_export import fill
from tests.support.study_samples import shipped_study
from tests.support.typed_command import run

pytestmark = pytest.mark.usefixtures("own_folder")


def test_a_new_study_is_the_papers_under_its_own_title(capsys: pytest.CaptureFixture[str]) -> None:
    status, said, _ = run(capsys, "new", "spill-cleaning_2")
    assert status == 0
    assert "salab check spill-cleaning_2.toml" in said and "salab serve --study spill-cleaning_2.toml" in said
    study, shipped = open_study(Path("spill-cleaning_2.toml")), shipped_study()
    assert study.title == "Spill cleaning 2"
    assert study.model_dump(exclude={"title"}) == shipped.model_dump(exclude={"title"})
    text = Path("spill-cleaning_2.toml").read_text(encoding="utf-8")
    assert text.count("#") >= DEFAULT_STUDY.read_text(encoding="utf-8").count("#")
    assert "my-study.toml" not in text


def test_a_new_study_may_start_from_a_preset(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "new", "as-fitted", "--preset", "fitted")[0] == 0
    study = open_study(Path("as-fitted.toml"))
    assert study.arbiter.transition == "replan"
    assert study.arbiter.rationality_per_m == 6.31
    assert study.robot.speed_m_s == 0.02687


@pytest.mark.parametrize(("name", "title"), [("my.toml", "My"), ('say "hi"', 'Say "hi"'), ("größe", "Größe")])
def test_a_name_may_be_a_file_or_any_words(name: str, title: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "new", name)[0] == 0
    (made,) = Path().glob("*.toml")
    assert open_study(made).title == title


def test_nothing_is_overwritten(capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine.toml").write_text("years of work", encoding="utf-8")
    assert run(capsys, "new", "mine") == (
        1,
        "",
        "salab: mine.toml: there already; choose another name, or remove it first\n",
    )
    assert Path("mine.toml").read_text(encoding="utf-8") == "years of work"
    assert "cannot be written: No such file" in run(capsys, "new", "nowhere/mine")[2]
    for name in ("", " ", "_", "a\nb"):
        assert "is no name for a study" in run(capsys, "new", name)[2]


def test_a_file_without_mistakes_is_summed_up_with_its_hash_and_weight(capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "new", "mine")
    status, said, complained = run(capsys, "check", "mine.toml")
    summary, weight, drawn = said.splitlines()
    assert drawn == "layout 'crescent' is drawn in mine.layout.png"
    assert Path("mine.layout.png").stat().st_size > 10_000
    assert (status, complained) == (0, "")
    assert summary.startswith("mine.toml: fine. 3 conditions in 6 orders; 3 trials with 6 tasks each, 18 in all; ")
    study = open_study(Path("mine.toml"))
    assert summary.endswith(f"SHA-256 {study.hash}")
    calibration = study_setup(study).calibration
    assert calibration is not None
    assert weight.startswith(
        f"alpha is calibrated to {calibration.alpha:.4g}, on {calibration.samples} states in which "
    )
    for band in calibration.shares.in_use:
        assert f"{band.information_leads:.0%}" in weight and f"{band.states:.0%} of states" in weight


def test_a_look_that_is_left_open_or_cannot_be_had_is_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(published, "published_meshes_dir", lambda: None)
    run(capsys, "new", "mine")
    text = Path("mine.toml").read_text(encoding="utf-8").replace('alpha = "calibrated"', "alpha = 300.0")
    for look, told in (
        ('look = "installed"', "It leaves open how the robot looks (on this machine: own). "),
        ("", "It leaves open how the robot looks (on this machine: own). "),
        ('look = "published"', 'It cannot be served on this machine: [view] look = "published": '),
    ):
        Path("mine.toml").write_text(text.replace('look = "own"', look), encoding="utf-8")
        status, said, _ = run(capsys, "check", "mine.toml")
        assert status == 0 and said.splitlines()[1].startswith(told)


def test_alpha_on_states_at_random_is_told_with_its_shares(capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "new", "first", "--preset", "lab")
    weight = run(capsys, "check", "first.toml")[1].splitlines()[1]
    calibration = study_setup(open_study(Path("first.toml"))).calibration
    assert calibration is not None
    assert weight.startswith(f"alpha is calibrated to {calibration.alpha:.4g}. ")
    assert (
        f"information weighs more than goals in {calibration.shares.information_above_0_7:.0%} with a vague" in weight
    )
    assert f"goals weigh more in {calibration.shares.goals_below_0_3:.0%} with a sure" in weight


def test_a_weight_that_is_given_is_not_calibrated(capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "new", "mine")
    text = Path("mine.toml").read_text(encoding="utf-8")
    Path("mine.toml").write_text(text.replace('alpha = "calibrated"', "alpha = 300.0"), encoding="utf-8")
    summary, drawn = run(capsys, "check", "mine.toml")[1].splitlines()
    assert summary.startswith("mine.toml: fine. ") and drawn.startswith("layout 'crescent' is drawn in ")


def test_a_folder_that_takes_no_picture_does_not_spoil_the_check(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    run(capsys, "new", "mine")
    Path("mine.layout.png").mkdir()
    status, said, _ = run(capsys, "check", "mine.toml")
    assert status == 0
    assert "layout 'crescent' is not drawn: mine.layout.png cannot be written: Is a directory" in said


def test_a_picture_replaces_nothing_that_a_link_leads_to(capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "new", "mine")
    Path("precious.txt").write_text("years of work", encoding="utf-8")
    Path("mine.layout.png").symlink_to("precious.txt")
    status, said, _ = run(capsys, "check", "mine.toml")
    assert status == 0
    assert (
        "layout 'crescent' is not drawn: mine.layout.png cannot be written: a link, or no regular file, is not" in said
    )
    Path("picture.png").symlink_to("precious.txt")
    status, _, told = run(capsys, "check", "mine.toml", "--picture", "picture.png")
    assert (status, told) == (
        1,
        "salab: picture.png: cannot be written: a link, or no regular file, is not written to\n",
    )
    assert Path("precious.txt").read_text(encoding="utf-8") == "years of work"


def test_labels_are_drawn_as_they_stand(capsys: pytest.CaptureFixture[str], recwarn: pytest.WarningsRecorder) -> None:
    example = Path(__file__).resolve().parents[2] / "docs" / "examples" / "05_layout"
    for name in ("study.toml", "mug.obj"):
        Path(name).write_text((example / name).read_text(encoding="utf-8"), encoding="utf-8")
    kitchen = (example / "kitchen.toml").read_text(encoding="utf-8")
    odd = 'label = "$\\\\frac{1}{0}$ $x_{$ \\n\\u0007 🥣"'
    for label in ('label = "cereal box"', 'label = "recycling"'):
        assert label in kitchen
        kitchen = kitchen.replace(label, odd)
    Path("kitchen.toml").write_text(kitchen, encoding="utf-8")
    status, said, told = run(capsys, "check", "study.toml")
    assert (status, told, list(recwarn)) == (0, "", [])
    assert "layout 'kitchen' is drawn in study.layout.png" in said


def test_every_problem_is_told_at_once_with_file_and_line(capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "new", "mine")
    text = Path("mine.toml").read_text(encoding="utf-8")
    for old, new in (
        ("speed_m_s = 0.03425", "speed_m_s = 4"),
        ('["sus_modified", "tlx_raw"]', '["trust"]'),
        ('layout = "crescent"', 'layout = "ark"'),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    Path("mine.toml").write_text(text, encoding="utf-8")
    Path("trust.toml").write_text('title = "Trust"\n', encoding="utf-8")
    status, said, complained = run(capsys, "check", "mine.toml")
    assert (status, said) == (1, "")
    *problems, last = complained.splitlines()
    assert last == f"mine.toml: {len(problems)} problems"
    lines = text.splitlines()
    for field, allowed in (("layout", "arc"), ("robot.speed_m_s", "above 0.0 and at most 0.1")):
        (told,) = [problem for problem in problems if f": {field} = " in problem]
        assert allowed in told
        number = int(told.split(":")[1])
        assert lines[number - 1].startswith(field.split(".")[-1])
    assert any(problem.startswith("trust.toml: items: missing") for problem in problems)


def test_a_file_that_is_not_there_is_one_problem(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, complained = run(capsys, "check", "nowhere.toml")
    assert status == 1
    assert complained == "nowhere.toml: cannot be read: No such file or directory\nnowhere.toml: 1 problem\n"


def test_the_overview_follows_the_study() -> None:
    study = shipped_study()
    time = f"about {round(expected_minutes(study))} minutes; at most 5 for a task and 25 for a trial"
    assert overview(study).endswith(f"16 questions after each; {time}")
    unlimited = study.model_copy(update={"task_limit_s": 0.0, "trial_limit_s": 0.0})
    assert overview(unlimited).endswith(" minutes")
    hurried = study.model_copy(update={"trial_limit_s": 60.0})
    assert expected_minutes(hurried) < expected_minutes(study) == expected_minutes(unlimited)
    longer = study.model_copy(update={"pickups_per_trial": 6})
    shorter = study.model_copy(update={"surveys": (), "conditions": study.conditions[:1]})
    assert expected_minutes(shorter) < expected_minutes(study) < expected_minutes(longer)
    assert "1 condition in 1 order; 1 trial with 6 tasks each, 6 in all; no questionnaires" in overview(shorter)


def test_an_export_as_folder_and_as_archive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with open_store(tmp_path / "data") as store:
        fill(store, "a")
    assert run(capsys, "export", "--data", "data", "--out", "out") == (0, "exported to out\n", "")
    assert run(capsys, "export", "--data", "data", "--out", "out", "--zip") == (0, "exported to out.zip\n", "")
    assert run(capsys, "export", "--data", "data", "--out", "other.zip", "--zip")[1] == "exported to other.zip\n"
    with zipfile.ZipFile("out.zip") as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == {
            path.name: path.read_bytes() for path in Path("out").iterdir()
        }


@pytest.mark.slow
def test_what_is_simulated_is_the_same_kind_of_package(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(capsys, "new", "mine")
    text = Path("mine.toml").read_text(encoding="utf-8")
    text = text.replace("pickups_per_trial = 3", "pickups_per_trial = 1")
    text = text.replace('["sus_modified", "tlx_raw"]', '["mood", "tlx_raw"]')
    Path("mine.toml").write_text(text, encoding="utf-8")
    item = '[[items]]\nid = "calm"\ntext = "I was calm."\n'
    head = 'title = "Mood"\nintro = "How was it?"\npoints = 3\nlow = "No"\nhigh = "Yes"\nscore_means = "calmer"\n'
    Path("mood.toml").write_text(head + item, encoding="utf-8")
    assert run(capsys, "simulate", "--study", "mine.toml", "--participants", "1", "--out", "sim")[0] == 0
    report = validate("sim/datapackage.json")
    assert report.valid, report.flatten(["name", "message"])
    assert report.warnings == [] and all(task.warnings == [] for task in report.tasks)
    answers = [row for row in read_table("sim", "survey_answers") if row.instrument == "mood"]
    assert len(answers) == 3 and {row.value for row in answers} <= {"1", "2", "3"}
    assert read_meta("sim")["machines"][0]["numpy"]
    assert json.loads(Path("sim/questionnaires.json").read_text(encoding="utf-8"))
    run(capsys, "check", "sim/study.toml")  # the exported study runs again by itself
    assert open_study(Path("sim/study.toml")).hash == open_study(Path("mine.toml")).hash
