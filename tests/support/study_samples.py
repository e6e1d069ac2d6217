"""Rows and a study for the tests of what is recorded."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import Any

from app.simulated.variants import changed_study, preset_changes
from study.definition.study import Study, load_study
from study.records import AlertRow, EventRow, SurveyAnswerRow, TaskRow, TickRow, TrialRow
from study.store import Batch, Store

OBJECTS = ("spray_bottle", "bleach_bottle", "paper_towels", "wipes_tub", "absorbent_can", "sponge_pack")
BINS = ("left_bin", "right_bin")
UTC = "2026-01-01T00:00:00.000+00:00"


@cache
def shipped_study() -> Study:
    """The study that ships, checked against the names above."""
    return load_study(None)


@cache
def lab_study() -> Study:
    """The study that shipped first, in full: for tests that change lines of a study file or count ticks, and do not ask
    what ships. Its numbers stay what they are when those of the shipped study change, and its arm is a fast one."""
    return changed_study(load_study(None), preset_changes("lab"))


def lab_text() -> str:
    """Its file's text."""
    return lab_study().source_text


@cache
def small_study() -> Study:
    """The same with one object a trial: for tests that simulate people."""
    return changed_study(lab_study(), {"": {"pickups_per_trial": 1}})


def append_tick(store: Store, row: TickRow, practice: bool = False, **rows: Any) -> None:
    """One tick and everything that happened in it, as one commit."""
    ticks: dict[str, Any] = {"practice_ticks" if practice else "ticks": (row,)}
    store.commit(Batch(**ticks, **rows))


def tick_row(participant: str, tick: int = 0, **changes: Any) -> TickRow:
    row = TickRow(
        participant=participant,
        condition="balanced",
        trial=1,
        task=1,
        kind="pickup",
        tick=tick,
        cycle=1,
        trial_s=tick * 0.5,
        goal="spray_bottle",
        p_x=0.7,
        p_y=0.1 + 0.2,
        p_z=0.88,
        m_x=0.0,
        m_y=-0.7071067811865475,
        m_z=0.0,
        user_x=1,
        user_y=0,
        user_z=-1,
        action_x=None,
        action_y=None,
        action_z=None,
        source="user",
        blocked=0,
        blocked_reason=None,
        after_pause=0,
        gripper_input=None,
        gripper="open",
        held=None,
        goals=json.dumps({"spray_bottle": [0.8, 0.2, 0.85]}),
        belief=json.dumps({"spray_bottle": 1.0}),
        entropy=0.0,
        input_seq=tick + 1,
        started_utc=UTC,
        late_ms=0.3,
        digest="0123456789abcdef",
    )
    return replace(row, **changes)


def trial_row(participant: str, **changes: Any) -> TrialRow:
    row = TrialRow(participant, "balanced", 1, "arc", "[]", "{}", "running", 0, 0, UTC, None)
    return replace(row, **changes)


def task_row(participant: str, task: int = 1, **changes: Any) -> TaskRow:
    kind = "pickup" if task % 2 else "dropoff"
    row = TaskRow(participant, "balanced", 1, task, kind, "spray_bottle", "spray_bottle", 6, "success", None, 0, 30)
    return replace(row, **changes)


def alert_row(participant: str, alert: int = 1, **changes: Any) -> AlertRow:
    row = AlertRow(
        participant=participant,
        condition="balanced",
        trial=1,
        alert=alert,
        placement="same_page_away",
        reading="482.1",
        due_trial_s=10.0,
        shown_utc=None,
        heard_utc=None,
        answered_utc=None,
        answered_trial_s=None,
        answer=None,
        correct=None,
        status="open",
    )
    return replace(row, **changes)


def answer_row(participant: str, item: str = "effort", value: str = "4") -> SurveyAnswerRow:
    return SurveyAnswerRow(participant, "balanced", 1, "tlx_raw", item, value, UTC)


def event_row(participant: str, kind: str = "help", **changes: Any) -> EventRow:
    return replace(EventRow(participant, 1, 3, UTC, kind, "participant", "{}"), **changes)
