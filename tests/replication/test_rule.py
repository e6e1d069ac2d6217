"""The rule of choice: its hash in the docs, its values in the study, its seeds apart."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from app.replication.comparisons import SIGN_AIM, SIGNIFICANT_AIM
from app.replication.fit import ANCHORS, PARAMETERS, Fit, as_json, report
from app.replication.long_tasks import LONG_AIM, LONG_S
from app.replication.rule import RULE_FILE, hash_line, rule, seed_sentence, table, value_of
from app.simulated.study import setup_of
from app.trial.setup import CALIBRATION_SEED
from app.trial.world import open_study
from study.definition.sections import ArbiterSettings, DistractorSettings, RobotSettings

DOCS = Path(__file__).resolve().parents[2] / "docs" / "topics" / "choosing-the-default.md"


def test_the_hash_is_that_of_the_file_and_stands_in_the_docs() -> None:
    assert rule().sha256 == hashlib.sha256(RULE_FILE.read_bytes()).hexdigest()
    assert rule().sha256 in DOCS.read_text(encoding="utf-8"), "the rule was changed: say so in the docs"
    assert rule().sha256 in hash_line()


def test_every_open_value_is_one_of_the_study_file() -> None:
    fields = {
        "arbiter": ArbiterSettings.model_fields,
        "robot": RobotSettings.model_fields,
        "distractor": DistractorSettings.model_fields,
        "conditions": {"alpha"},
        "": {"layout"},
    }
    for item in rule().open:
        assert item.key in fields[item.section], f"{item.section}.{item.key}"
        assert item.fixed_by in {"teleoperation", "the paper's text", "physics"}
        assert item.how


def test_what_is_fitted_is_what_teleoperation_fixes() -> None:
    of_study = {item.key for item in rule().open if item.fixed_by == "teleoperation"}
    assert of_study == {item.name for item in PARAMETERS if item.name in ("speed_m_s", "rationality_per_m")}


def test_values_are_those_of_the_study() -> None:
    setup = setup_of(open_study(None).source_text)
    by_key = {item.key: value_of(item, setup) for item in rule().open}
    assert float(by_key["rationality_per_m"]) == setup.study.arbiter.rationality_per_m
    assert by_key["layout"] == setup.study.layout
    assert by_key["alpha"].endswith("(calibrated)")
    assert len(table(setup).splitlines()) == 1 + len(rule().open)


def test_seeds_for_choosing_and_for_testing_are_apart() -> None:
    assert not set(rule().choosing) & set(rule().testing)
    assert CALIBRATION_SEED in rule().choosing
    assert "reserved for testing" in seed_sentence(rule().testing[0])
    assert "not unseen" in seed_sentence(2020)
    assert "neither" in seed_sentence(987_654_321)


def test_aims_are_those_that_are_used() -> None:
    aims = rule().aims
    assert (aims["sign"], aims["significant"]) == (SIGN_AIM, SIGNIFICANT_AIM)
    assert (aims["long_s"], aims["long_share"]) == (LONG_S, LONG_AIM)


@pytest.mark.parametrize(("share", "missed"), [(1.09, False), (1.11, True), (0.89, True)])
def test_a_fit_says_which_anchors_it_misses(share: float, missed: bool) -> None:
    values = {item.name: item.start for item in PARAMETERS}
    found = Fit("replan", values, tuple((anchor, share * anchor.value) for anchor in ANCHORS), 1.0, 1, 10, 5)
    assert ("MISSED" in report(found)) is missed
    assert json.loads(as_json([found], 24, 1))["found"]["rule"] == rule().sha256
