"""A study in German, docs/examples/11_another_language: what ships, what is its own, what stays English on purpose."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.commands.participant_texts import notes_on_texts
from app.trial.world import open_study
from study.export.export import read_table
from tests.support.lab_server import ROOT
from tests.support.outside_package import salab

pytestmark = pytest.mark.slow

EXAMPLE = ROOT / "docs" / "examples" / "11_another_language"


def test_the_words_are_the_files_own_then_those_that_ship() -> None:
    study = open_study(EXAMPLE / "study.toml")
    words = study.words
    assert words.t("Pick up the {object}.", object=words.t("spray bottle")) == (
        "Bitte aufnehmen: Flasche mit Sprühkopf."
    )
    assert words.t("Agree and continue") == "Zustimmen und weiter"
    (note,) = notes_on_texts(study, EXAMPLE / "study.toml")
    assert note.startswith(f"{EXAMPLE / 'meine-studie.de.po'}: not reviewed for data")


def test_the_export_says_the_language(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = salab("simulate", "--study", str(EXAMPLE / "study.toml"), "--participants", "1", "--out", str(out))
    assert done.returncode == 0, done.stderr
    assert [row.language for row in read_table(out, "participants")] == ["de"]
    (told,) = json.loads((out / "questionnaires.json").read_text(encoding="utf-8"))["studies"].values()
    assert [(form["id"], form["language"]) for form in told["surveys"]] == [("ruhe", "de"), ("tlx_raw", "en")]
    assert "# meine-studie.de.po, as it stood beside this file" in (out / "study.toml").read_text(encoding="utf-8")
