"""Facts of a study in its texts: what a participant reads follows the file, whatever the file is changed to."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from app.trial.world import open_study, parse_stored
from study.definition.study import DEFAULT_STUDY, StudyFileError
from study.definition.text_placeholders import FACTS
from study.flow.facts import as_read, facts_of
from study.flow.flow import FLOW
from study.flow.overview import overview
from study.flow.page import PageContext
from tests.support.study_samples import shipped_study


def changed(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    text = DEFAULT_STUDY.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "study.toml"
    file.write_text(text, encoding="utf-8")
    return file


def read_by_participants(file: Path) -> str:
    """Everything that any page shows of the study's own texts."""
    study = open_study(file)
    contents = []
    for page in FLOW.pages:
        session = FLOW.new_session("P001", len(study.conditions))
        contents.append(str(page.content(session, PageContext(study))))
    return "\n".join([*contents, *as_read(study).recruitment.welcome])


def test_the_consent_says_the_minutes_that_check_says() -> None:
    study = shipped_study()
    minutes = facts_of(study)["minutes"]
    assert f"Your part takes about {minutes} minutes." in as_read(study).consent.text[0]
    assert f"about {minutes} minutes" in overview(study)


def test_every_fact_has_a_value_and_no_page_shows_a_brace() -> None:
    study = shipped_study()
    assert facts_of(study).keys() == FACTS.keys()
    for page in FLOW.pages:
        shown = str(page.content(FLOW.new_session("P001", 3), PageContext(study, scene_path="/s/x/scene/")))
        assert not re.search(r"\{[a-z_]+\}", shown), page.state


def test_texts_follow_the_file(tmp_path: Path) -> None:
    file = changed(tmp_path, ("answer_within_s = 20.0", "answer_within_s = 12.5"), ("digits = 4", "digits = 5"))
    text = read_by_participants(file)
    assert "Log each reading within 12.5 seconds" in text
    assert "Type the reading within 12.5 seconds" in text
    assert "within 20 seconds" not in text


def test_what_is_agreed_to_is_what_was_read(tmp_path: Path) -> None:
    """The hash of the agreement follows the numbers in it."""
    longer = open_study(changed(tmp_path, ("pickups_per_trial = 3", "pickups_per_trial = 5")))
    assert longer.consent == shipped_study().consent
    assert as_read(longer).consent.text != as_read(shipped_study()).consent.text
    assert as_read(longer).consent.hash != as_read(shipped_study()).consent.hash


def test_a_text_without_facts_is_read_as_it_stands(tmp_path: Path) -> None:
    study = open_study(changed(tmp_path, ("about {minutes} minutes", "45 minutes"), ("each of {rounds}", "each of 3")))
    assert as_read(study).consent == study.consent


def test_a_name_that_is_no_fact_is_told_with_its_line_and_the_choices(tmp_path: Path) -> None:
    file = changed(
        tmp_path,
        ("about {minutes} minutes", "about {minuts} minutes"),
        ('id = "log", label = "', 'id = "log", label = "{x}'),
    )
    with pytest.raises(StudyFileError) as raised:
        open_study(file)
    problems = "\n".join(raised.value.problems)
    assert len(raised.value.problems) == 2
    assert (
        "{minuts} is none of the facts a text may name: minutes, rounds, tasks, objects, bins, answer_seconds"
        in problems
    )
    assert "consent.text" in problems and "{x} is none" in problems


def test_what_was_stored_with_other_braces_stays_readable(tmp_path: Path) -> None:
    text = DEFAULT_STUDY.read_text(encoding="utf-8").replace("about {minutes} minutes", "about {some} minutes")
    assert "about {some} minutes" in as_read(parse_stored(text, "stored")).consent.text[0]
