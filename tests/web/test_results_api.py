"""Verdicts over trials and what came of the study, over HTTP."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest

from app.web.results_api import summarise
from study.flow.roster import EnrolmentKind
from study.store import Batch, open_store
from tests.support.lab_server import LabServer
from tests.support.study_samples import UTC, alert_row, answer_row, shipped_study, trial_row
from tests.support.wire_client import events, invite, stored, visit


def asked(lab: LabServer, method: str, path: str, **options: Any) -> httpx.Response:
    return httpx.request(method, f"{lab.base_url}{path}", headers=lab.headers, trust_env=False, **options)


async def aborted_trial(lab: LabServer) -> str:
    """A participant with one trial that ended."""
    made = invite(lab)
    async with visit(made["link"]) as player:
        await player.reach_trial()
        await player.tick()
        ended = asked(lab, "POST", f"/api/sessions/{made['participant']}/abort", json={"reason": "over"})
        assert ended.status_code == 200, ended.text
    participant: str = made["participant"]
    return participant


async def test_a_trial_gets_a_verdict_that_can_be_overridden_with_a_reason(quick_lab: LabServer) -> None:
    who = await aborted_trial(quick_lab)
    (line,) = [each for each in asked(quick_lab, "GET", "/api/quality").json()["lines"] if each["participant"] == who]
    assert (line["trial"], line["quality"], line["broken"], line["override"]) == (1, "good", [], None)
    place = f"/api/quality/{who}/1"
    for body in ({"verdict": "suspect"}, {"verdict": "suspect", "reason": " "}, {"verdict": "bad", "reason": "x"}):
        assert asked(quick_lab, "POST", place, json=body).status_code == 422
    said = asked(quick_lab, "POST", place, json={"verdict": "suspect", "reason": "the phone rang"}).json()
    assert (said["quality"], said["override"], said["reason"]) == ("good", "suspect", "the phone rang")
    found = asked(quick_lab, "GET", "/api/quality", params={"show": "suspect"}).json()
    assert who in [each["participant"] for each in found["lines"]] and found["suspect"] >= 1
    assert events(quick_lab, who, "quality_override") == [
        ("quality_override", {"by": "experimenter", "from": "good", "to": "suspect"})
    ]
    with stored(quick_lab) as store:  # and so it is exported
        (row,) = store.rows_of("trials", who)
    assert (row.quality, row.quality_override, row.quality_reason) == ("good", "suspect", "the phone rang")


@pytest.mark.parametrize("place", ["P999999/1", "{who}/2"])
def test_a_trial_that_has_not_ended_has_no_verdict_to_override(quick_lab: LabServer, place: str) -> None:
    path = f"/api/quality/{place.format(who=invite(quick_lab)['participant'])}"
    assert asked(quick_lab, "POST", path, json={"verdict": "good", "reason": "x"}).status_code == 404


def test_the_summary_counts_and_scores_complete_questionnaires_of_completed_trials_of_the_study(tmp_path: Path) -> None:
    scales = ("mental_demand", "physical_demand", "temporal_demand", "performance", "effort", "frustration")
    with open_store(tmp_path / "data") as store:
        kinds: tuple[EnrolmentKind, ...] = ("study", "study", "study", "pilot", "demo", "study")
        for number, kind in enumerate(kinds):
            who = store.create_participant(
                shipped_study(), seed=number, public_id=f"{number}", utc=UTC, kind=kind
            ).participant
            given = scales[:-1] if number == 2 else scales
            store.commit(
                Batch(
                    trials=(trial_row(who, outcome="aborted" if number == 5 else "completed"),),
                    alerts=(alert_row(who, 1, status="answered"), alert_row(who, 2, status="expired")),
                    answers=tuple(answer_row(who, item, str(number + 2)) for item in given),
                )
            )
        found = summarise(store, {stored.participant: shipped_study() for stored in store.sessions()})
    assert found.trials == {"completed": 3, "aborted": 1, "running": 0}
    assert found.alerts == {"answered": 4, "expired": 4, "trial_ended": 0, "open": 0}
    assert [line.model_dump() for line in found.scores] == [
        {"instrument": "tlx_raw", "condition": "balanced", "n": 2, "mean": 2.5}
    ]


def test_the_summary_is_there_for_the_dashboard(quick_lab: LabServer) -> None:
    assert set(asked(quick_lab, "GET", "/api/summary").json()) == {"trials", "alerts", "scores"}
