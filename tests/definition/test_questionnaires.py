"""A study's own questionnaires: from a file beside the study file to the page, the answers, the score, the export."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.session.pages import page
from app.simulated.answers import Experience, SimulatedPerson
from app.simulated.traits import Population, draw_traits
from study.analysis.analysis import analyse
from study.analysis.dataset import load as load_data
from study.analysis.method_text import methods
from study.definition.questionnaires import own_instruments
from study.definition.study import Study, StudyFileError, load_study, parse_study
from study.definition.toml_reader import parse_toml
from study.export.export import write_tables
from study.flow.answers import answer_rows, score, survey_scores, validate_surveys
from study.flow.page import PageContext
from study.flow.protocol import Session
from tests.support.analysis_samples import data_set
from tests.support.flow_cases import handed_in
from tests.support.study_samples import UTC, lab_text

SOURCE = lab_text()
CHOSEN = 'surveys = ["sus_modified", "tlx_raw"]'
TRUST = """
title = "About trust"
intro = "How much do you agree?"
low = "Strongly disagree"
high = "Strongly agree"
points = 5
scoring = "sum"
score_means = "more trust"

[[items]]
id = "reliable"
text = 'The robot is "reliable": \\o/ – Größe.'

[[items]]
id = "unpredictable"
text = \"\"\"The robot is
unpredictable.\"\"\"
high = "Completely"
reversed = true
"""
STUDY = SOURCE.replace(CHOSEN, 'surveys = ["trust", "tlx_raw"]')


def write(folder: Path, study: str = STUDY, **files: str) -> Path:
    """A study file with questionnaire files beside it."""
    for name, text in files.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    (folder / "study_file.toml").write_text(study, encoding="utf-8")
    return folder / "study_file.toml"


def load(file: Path) -> Study:
    return load_study(file)


def problems(file: Path) -> list[str]:
    """What is told, without the folder."""
    with pytest.raises(StudyFileError) as caught:
        load(file)
    return [line.replace(f"{file.parent}/", "") for line in caught.value.problems]


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return load(write(tmp_path, trust=TRUST))


def test_it_is_asked_in_its_place_with_its_own_words(study: Study) -> None:
    assert study.surveys == ("trust", "tlx_raw")
    trust, tlx = study.instruments
    assert (trust.id, trust.points, trust.method, trust.score_range) == ("trust", 5, "sum", (2, 10))
    assert trust.items[0].text == 'The robot is "reliable": \\o/ – Größe.'
    assert trust.items[1].text == "The robot is\nunpredictable."
    assert [(item.low, item.high, item.reversed) for item in trust.items] == [
        ("Strongly disagree", "Strongly agree", False),
        ("Strongly disagree", "Completely", True),
    ]
    assert tlx.id == "tlx_raw"


def test_the_page_shows_it_without_direction_and_scoring(study: Study) -> None:
    session = Session("P001", trials=3, state="survey")
    shown = page(session, PageContext(study, "/s/x/scene/", worker_ready=True)).content["instruments"]
    assert [form["id"] for form in shown] == ["trust", "tlx_raw"]
    assert shown[0]["points"] == 5
    assert shown[0]["items"][1] == {
        "id": "unpredictable",
        "text": "The robot is\nunpredictable.",
        "low": "Strongly disagree",
        "high": "Completely",
    }
    assert "sum" not in json.dumps(shown[0])


def test_answers_are_held_to_its_items_and_points(study: Study) -> None:
    tlx = {item.id: 4 for item in study.instruments[1].items}
    good = {"trust": {"reliable": 5, "unpredictable": 2}, "tlx_raw": tlx}
    assert validate_surveys(study, good) == ()
    wrong = validate_surveys(study, {**good, "trust": {"reliable": 6, "honest": 1}, "sus_modified": {}})
    assert {problem.field for problem in wrong} == {
        "answers.sus_modified",
        "answers.trust.honest",
        "answers.trust.reliable",
        "answers.trust.unpredictable",
    }
    assert score(study.instruments[0], good["trust"]) == 5 + (6 - 2)


def test_simulated_participants_answer_it(study: Study) -> None:
    rng = np.random.default_rng(1)
    person = SimulatedPerson(study, draw_traits(Population(), rng), Experience(7.0, 0, 0, 0.0), rng)
    answers = handed_in(study, "survey", person)["answers"]
    assert list(answers["trust"]) == ["reliable", "unpredictable"]
    assert validate_surveys(study, answers) == ()


def test_the_studys_text_holds_all_that_is_needed_to_run_it_again(tmp_path: Path, study: Study) -> None:
    alone = parse_study(study.source_text)
    assert alone == study
    assert study.source_text.startswith(STUDY.rstrip("\n"))
    copied = tmp_path / "elsewhere"
    copied.mkdir()
    assert load(write(copied, study.source_text, trust="broken")).hash == study.hash


def test_its_hash_is_in_the_studys(tmp_path: Path, study: Study) -> None:
    other = load(write(tmp_path, trust=TRUST.replace("unpredictable.", "erratic.")))
    assert other.hash != study.hash
    assert load(write(tmp_path, SOURCE, trust=TRUST)).source_text == SOURCE  # not asked: not a part of the study


def test_the_export_tells_and_scores_it(tmp_path: Path, study: Study) -> None:
    answers = {"reliable": 4, "unpredictable": 1}
    rows = answer_rows("P001", "trust", answers, UTC, condition="balanced", trial=1)
    out = tmp_path / "out"
    write_tables(out, {"survey_answers": rows}, studies={study.hash: study.source_text})
    told: dict[str, Any] = json.loads((out / "questionnaires.json").read_text(encoding="utf-8"))
    trust = told["studies"][study.hash]["surveys"][0]
    assert trust["scoring"] == "Sum of the 2 items on 1-5 after reversing unpredictable."
    assert trust["items"][1]["anchors"] == {"1": "Strongly disagree", "5": "Completely"}
    exported = parse_toml((out / "study.toml").read_bytes(), "study.toml")[0]
    (scored,) = survey_scores(rows, own_instruments(exported))
    assert (scored.instrument, scored.score) == ("trust", 9)


def test_the_analysis_compares_it_under_its_own_title(tmp_path: Path, study: Study) -> None:
    data = data_set(4)
    for number, trial in enumerate(data.tables["trials"]):
        answers = {"reliable": 1 + number % 5, "unpredictable": 1 + number % 4}
        data.tables["survey_answers"] += answer_rows(
            trial.participant, "trust", answers, UTC, condition=trial.condition, trial=trial.trial
        )
    write_tables(tmp_path / "out", data.tables, studies={study.hash: study.source_text}, meta={"machines": []})
    analysis = analyse(load_data(tmp_path / "out"))
    trust = analysis.comparison("trust")
    assert trust is not None
    assert (trust.measure.title, trust.measure.unit) == ("About trust", "score, 2–10; high = more trust")
    assert sum(summary.n for summary in trust.summaries.values()) == 12
    assert analysis.data.quality.notes == ()
    other = study.source_text.replace("unpredictable.", "erratic.")
    write_tables(tmp_path / "both", data.tables, studies={study.hash: study.source_text, "f" * 64: other})
    (differs,) = [note for note in load_data(tmp_path / "both").quality.notes if "trust" in note]
    assert "differs between the study files" in differs
    assert any("“About trust”; a high score means more trust." in text for text in methods(analysis))


def test_a_questionnaire_may_stand_in_the_study_file(tmp_path: Path) -> None:
    table = TRUST.replace("[[items]]", "[[questionnaires.items]]")
    inline = f'{STUDY}\n[[questionnaires]]\nid = "trust"\n{table}'
    assert load(write(tmp_path, inline)).instruments[0].title == "About trust"
    both = inline.replace('["trust", ', '["trust", "mood", ')
    mood = TRUST.replace("About trust", "About mood")
    assert [form.title for form in load(write(tmp_path, both, mood=mood)).instruments[:2]] == [
        "About trust",
        "About mood",
    ]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("points = 5", "points = 12", "trust.toml:6: points = 12: must be a whole number at least 2 and at most 11"),
        ('scoring = "sum"', 'scoring = "total"', 'trust.toml:7: scoring = "total": not known; allowed: mean, sum'),
        ('title = "', 'titel = "', "trust.toml:2: titel = "),
        ('low = "Strongly disagree"\n', "", "trust.toml:9: items[1].low: missing; give low here or once for all items"),
        ('id = "reliable"', 'id = "unpredictable"', 'items[2].id = "unpredictable": repeats entry 1'),
        ("points = 5", "points = = 5", "trust.toml:6: not valid TOML"),
        ("[[items]]", "[[item]]", "items: missing"),
    ],
)
def test_its_mistakes_are_told_with_file_and_line(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert old in TRUST
    found = problems(write(tmp_path, trust=TRUST.replace(old, new)))
    assert any(told in line for line in found), found
    assert all(line.startswith("trust.toml") for line in found)


def test_mistakes_in_both_files_are_told_at_once(tmp_path: Path) -> None:
    file = write(tmp_path, STUDY.replace("speed_m_s = 0.04", "speed_m_s = 4"), trust=TRUST.replace("= 5", "= 50"))
    study_line, trust_line = problems(file)
    assert "robot.speed_m_s = 4" in study_line
    assert "trust.toml:6: points = 50" in trust_line


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("tlx_raw", 'questionnaires[1].id = "tlx_raw": is a questionnaire that is built in'),
        ("debrief", "is taken; ids that are taken: demographics, comprehension, debrief"),
        ("mood", 'questionnaires[1].id = "mood": is never asked'),
    ],
)
def test_a_name_that_cannot_be_is_refused(tmp_path: Path, name: str, told: str) -> None:
    chosen = SOURCE.replace(CHOSEN, 'surveys = ["debrief", "tlx_raw"]' if name == "debrief" else CHOSEN)
    table = TRUST.replace("[[items]]", "[[questionnaires.items]]")
    found = problems(write(tmp_path, f'{chosen}\n[[questionnaires]]\nid = "{name}"\n{table}'))
    assert len(found) == 1 and told in found[0]


def test_a_missing_file_is_told_where_it_was_looked_for(tmp_path: Path) -> None:
    (line,) = problems(write(tmp_path))
    assert 'surveys[1] = "trust": not known' in line
    assert "or your own in trust.toml beside this file" in line


def test_names_do_not_lead_out_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "trust.toml").write_text(TRUST, encoding="utf-8")
    (tmp_path / "inner").mkdir()
    found = problems(write(tmp_path / "inner", STUDY.replace('"trust"', '"../trust"')))
    assert all("surveys[1]" in line for line in found)
