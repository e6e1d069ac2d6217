"""The rows a study leaves behind: one frozen dataclass per exported table, every column described.

These types are the data dictionary. The store makes its tables from them, the export writes them, the analysis reads
them back, and the codebook is printed from them; a column exists because it stands here.

Blank (`None`) always means "does not apply"; what that means for a column stands in its description.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import Any, Literal, TypeVar, get_args, get_type_hints

Row = TypeVar("Row")
SCHEMA_VERSION = 1
TICK_S = 0.5
"""Length of a tick, one decision (paper IV-A), seconds. The robot's is `sim.interface.TICK_S`; a test holds them equal,
since neither house imports the other."""


class StudyError(ValueError):
    """A value the study engine cannot take; the message gives the value, the bound and the choices."""


class RecordProblem(StudyError):
    """One participant's record cannot be used; the text says why."""

    def __init__(self, participant: str, problem: str) -> None:
        self.participant = participant
        super().__init__(problem)


UTC = "ISO 8601 UTC"
"""The unit of a time of day; it is written as `utc_text` does."""
YES_NO = "0/1"
"""The unit of what is so (1) or not (0)."""
OVERRUN_MS = 50.0
"""A tick that starts later than this after its deadline is an overrun."""


def utc_text(unix_s: float) -> str:
    """A time of day with milliseconds, such as 2026-01-31T09:30:00.000Z."""
    text = datetime.fromtimestamp(unix_s, timezone.utc).isoformat(timespec="milliseconds")
    return text.replace("+00:00", "Z")


def unix_s(utc: str) -> float:
    """A time of day that `utc_text` wrote, in seconds since 1970."""
    return datetime.fromisoformat(utc.replace("Z", "+00:00")).timestamp()


def column(
    description: str,
    *,
    unit: str | None = None,
    levels: tuple[str, ...] = (),
    json: Literal["object", "array"] | None = None,
    least: int | None = None,
    most: int | None = None,
    words: bool = False,
    default: Any = dataclasses.MISSING,
) -> Any:
    """A dataclass field that carries its own documentation.

    `words` marks a text that people wrote or named (an answer, an id of the study file), which may look like anything.
    `levels` are all values a text may have, `json` is what a text holds that is JSON, `least` and `most` bound a
    number.
    """
    return field(
        default=default,
        metadata={
            "description": description,
            "unit": unit,
            "levels": levels,
            "json": json,
            "least": least,
            "most": most,
            "words": words,
        },
    )


CONDITIONS = ("teleoperation", "goal_oriented", "balanced")
KINDS = ("pickup", "dropoff")
SOURCES = ("user", "blend", "robot", "idle", "gripper", "reset", "free")
OUTCOMES = ("success", "failure", "not_run")


@dataclass(frozen=True)
class ParticipantRow:
    """One person (or simulated person) who was enrolled."""

    participant: str = column("Participant id, unique in the data set")
    seed: int = column("Seed of everything random about this participant", least=0)
    condition_order: str = column("Condition ids in the order run, joined by '>'", words=True)
    state: str = column("State of the session when exported (done = complete)")
    study_hash: str = column("SHA-256 of the study file this participant ran under")
    created_utc: str = column("When the participant was created", unit=UTC)
    consent_utc: str | None = column("When consent was given; blank = not given", unit=UTC)
    consent_hash: str | None = column("SHA-256 of the consent text agreed to")
    finished_utc: str | None = column("When the session ended; blank = it has not", unit=UTC)
    schema_version: int = column("Version of these row types")
    kind: str = column(
        "Enrolled for: the study itself, or a pilot or demo that is in an export only when asked for",
        levels=("study", "pilot", "demo"),
        default="study",
    )
    screened_out: str | None = column(
        "JSON: what the check of the device found wanting, by [eligibility] in the study file; blank = nothing",
        json="array",
        default=None,
    )
    language: str = column(
        "Language of the study, as a tag such as en, de or ar; questionnaires.json says which are asked in another",
        default="en",
    )


@dataclass(frozen=True)
class TrialRow:
    """One trial: three pickups and dropoffs under one condition."""

    participant: str = column("Participant id")
    condition: str = column("Condition id from the study file", words=True)
    trial: int = column("Trial number, from 1", least=1)
    layout: str = column("Name of the layout on the table", words=True)
    placement: str = column("JSON: object id at each slot of the layout, in slot order", json="array")
    parameters: str = column("JSON: every parameter of the arbiter in this trial", json="object")
    outcome: str = column("How the trial ended", levels=("completed", "aborted", "running"))
    ticks: int = column("Ticks run so far, resets included", unit="ticks", least=0)
    overruns: int = column("Ticks that started more than 50 ms late", unit="ticks", least=0)
    started_utc: str | None = column("When the first tick started", unit=UTC)
    finished_utc: str | None = column("When the trial ended", unit=UTC)
    quality: str | None = column(
        "Automatic verdict by the [quality] rules of the study file; blank = not judged (running, or simulated)",
        levels=("good", "suspect"),
        default=None,
    )
    quality_broken: str | None = column(
        "JSON: a sentence for each rule that was broken; blank = not judged", json="array", default=None
    )
    quality_override: str | None = column(
        "An experimenter's verdict, which counts instead; blank = none", levels=("good", "suspect"), default=None
    )
    quality_reason: str | None = column(
        "Why the experimenter overrode the verdict, as written; blank = not done", default=None, words=True
    )
    round_trip_ms: float | None = column(
        "95th percentile of the page's round trips in the trial; blank = not measured", unit="ms", default=None
    )
    hidden_s: float | None = column("How long the page was hidden; blank = not judged", unit="s", default=None)
    focus_losses: int | None = column("How often the page lost the focus; blank = not judged", least=0, default=None)
    pad_losses: int | None = column("How often the gamepad was lost; blank = not judged", least=0, default=None)
    unanswered_alerts: int | None = column(
        "Readings, or other alerts, that expired; blank = not judged", least=0, default=None
    )
    frees: int | None = column(
        "How often the arm was freed in the trial; blank = not judged, or recorded before it could be",
        least=0,
        default=None,
    )


@dataclass(frozen=True)
class TaskRow:
    """One pickup or dropoff. A complete participant of the paper's study has 18."""

    participant: str = column("Participant id")
    condition: str = column("Condition id from the study file", words=True)
    trial: int = column("Trial number, from 1", least=1)
    task: int = column("Task number in the trial, from 1; odd = pickup", least=1)
    kind: str = column("Kind of task", levels=KINDS)
    goal: str = column("Id of the instructed object (pickup) or bin (dropoff): the ground truth", words=True)
    object: str = column("Id of the object of this pick-and-place cycle", words=True)
    goals: int = column("Number of candidate goals at the start of the task", least=1)
    outcome: str = column(
        "Outcome, of the last attempt; not_run = the dropoff after a failed pickup, or what the trial's time limit "
        "left undone",
        levels=OUTCOMES,
    )
    reason: str | None = column(
        "Why it failed or was not run; blank after a success. time_limit = the time of task_limit_s or trial_limit_s "
        "of the study was over: the task would have taken longer, so that its ticks are right-censored",
        words=True,
    )
    first_tick: int | None = column(
        "First tick of the task, in the first of its attempts; blank if not run", unit="tick of the trial", least=0
    )
    last_tick: int | None = column(
        "Last tick of the task, in the last of its attempts; blank if not run", unit="tick of the trial", least=0
    )
    attempts: int = column(
        "Attempts at its cycle so far, from 1: whenever the arm is freed, pickup and dropoff begin again. The outcome "
        "is that of the last; all ticks with this task in `ticks` are the task's, whatever their attempt",
        least=1,
        default=1,
    )


_USER = (
    "User input along {}: -1, 0 or 1; blank = none taken into account: hands off, controls ignored for a reading, "
    "or a gripper or reset tick (see source)"
)
_ACTION = (
    "Action taken, {}; blank = none, 0,0,0 = the arbiter chose to stay. With source = robot it is the best-scored of "
    "the actions that the arm can do from here and that push nothing over"
)


@dataclass(frozen=True)
class TickRow:
    """One decision, a tick long. p and m are the state x at its start, belief and entropy are after its update."""

    participant: str = column("Participant id")
    condition: str = column("Condition id from the study file", words=True)
    trial: int = column("Trial number, from 1", least=1)
    task: int | None = column("Task number in the trial, from 1; blank while the arm resets", least=1)
    kind: str | None = column("Kind of task; blank while the arm resets", levels=KINDS)
    tick: int = column("Tick number in the trial, from 0", least=0)
    cycle: int = column("Pick-and-place cycle in the trial, from 1; each starts in a fresh physics world", least=1)
    trial_s: float = column("Trial time at the start of the tick; stands still while paused", unit="s", least=0)
    goal: str | None = column(
        "Instructed goal (object or bin id); blank while the arm resets. It is no candidate, and so not in `belief`, "
        "while a pickup's object is held and not yet lifted, and after a dropoff's object was let go",
        words=True,
    )
    p_x: float = column("Gripper position at the start of the tick, world frame", unit="m")
    p_y: float = column("Gripper position at the start of the tick, world frame", unit="m")
    p_z: float = column("Gripper position at the start of the tick, world frame", unit="m")
    m_x: float = column("Direction executed in the last tick; 0 after gripper, reset, block or pause", unit="1")
    m_y: float = column("Direction executed in the last tick; 0 after gripper, reset, block or pause", unit="1")
    m_z: float = column("Direction executed in the last tick; 0 after gripper, reset, block or pause", unit="1")
    user_x: int | None = column(_USER.format("x"), unit="1", least=-1, most=1)
    user_y: int | None = column(_USER.format("y"), unit="1", least=-1, most=1)
    user_z: int | None = column(_USER.format("z"), unit="1", least=-1, most=1)
    action_x: int | None = column(_ACTION.format("x"), unit="1", least=-1, most=1)
    action_y: int | None = column(_ACTION.format("y"), unit="1", least=-1, most=1)
    action_z: int | None = column(_ACTION.format("z"), unit="1", least=-1, most=1)
    source: str = column(
        "Who decided the motion of this tick. user = the person gave a direction and it was taken; blend = the person "
        "gave one and the arbiter took another (see departure); robot = no direction, the arbiter chose; idle = no "
        "direction, and the arbiter never moves by itself; gripper = the fingers moved and motion paused; reset = the "
        "arm went back; free = the same because somebody freed it, the first tick of another attempt (event arm_freed)",
        levels=SOURCES,
    )
    blocked: int = column("1 = the motion asked for was refused", unit=YES_NO)
    blocked_reason: str | None = column("Why motion was refused or limited; blank = it was not", words=True)
    gripper_input: str | None = column("Gripper button pressed for this tick", levels=("open", "close"))
    gripper: str = column("Gripper at the end of the tick", levels=("open", "closed", "moving"))
    held: str | None = column("Object id held at the end of the tick; blank = none", words=True)
    after_pause: int = column("1 = first tick after a pause or a lost connection", unit=YES_NO)
    goals: str = column(
        "JSON: candidate goal id to its position [x, y, z] at the start of the tick",
        unit="m",
        json="object",
    )
    belief: str = column("JSON: goal id to probability, after this tick's update", json="object")
    entropy: float = column("Entropy of that belief to base |goals|, 0 to 1; 0 with one goal", unit="1")
    input_seq: int | None = column("Sequence number of the last input this tick took into account")
    started_utc: str | None = column("When the tick started; blank when simulated", unit=UTC)
    late_ms: float | None = column("How late the tick started against its deadline; blank in lockstep", unit="ms")
    digest: str = column("Hash of the world's state at the end of the tick, for verifying a replay")
    departure: float | None = column(
        "How far the action taken departs from the direction the person gave: the length of the difference of the two "
        "as unit vectors. 0 = as given, 1 = stood still instead (or moved where 0,0,0 was given), 2 = the opposite; "
        "blank = the person gave none",
        unit="1",
        least=0,
        most=2,
        default=None,
    )
    attempt: int = column(
        "Attempt at the cycle, from 1: whenever the arm is freed, the cycle begins again with its pickup",
        least=1,
        default=1,
    )


@dataclass(frozen=True)
class AlertRow:
    """One stimulus of the second task: a sensor reading, or that of another kind of distractor."""

    participant: str = column("Participant id")
    condition: str = column("Condition id from the study file", words=True)
    trial: int = column("Trial number, from 1", least=1)
    alert: int = column("Alert number in the trial, from 1", least=1)
    placement: str = column("Where it was shown", levels=("second_device", "same_page_away"))
    reading: str = column(
        "What was shown: the reading to be logged, or the stimulus of another kind, such as the letter of N-back",
        words=True,
    )
    due_trial_s: float = column("Trial time at which the alert was raised", unit="s")
    shown_utc: str | None = column("When the page reported it visible; blank = never reported", unit=UTC)
    heard_utc: str | None = column("When the page reported the sound played; blank = never", unit=UTC)
    answered_utc: str | None = column("When the answer reached the lab; blank = no answer", unit=UTC)
    answered_trial_s: float | None = column("Trial time of the answer; blank = no answer", unit="s")
    answer: str | None = column(
        "What was typed, or the id of the choice taken, such as `same`; blank = no answer", words=True
    )
    correct: int | None = column(
        "1 = right: the typed value equals the reading, or as the kind of distractor judges; blank = no answer",
        unit=YES_NO,
    )
    status: str = column("State of the alert", levels=("open", "answered", "expired", "trial_ended"))


@dataclass(frozen=True)
class SurveyAnswerRow:
    """One answer to one item, as given. Scoring is done in the analysis."""

    participant: str = column("Participant id")
    condition: str | None = column("Condition the answer is about; blank = the whole session", words=True)
    trial: int | None = column("Trial the answer is about; blank = the whole session")
    instrument: str = column("Questionnaire id (also demographics and comprehension)", words=True)
    item: str = column("Item id in the questionnaire", words=True)
    value: str = column(
        "Answer as given: a scale point, the id of an option, a number, or text as it was typed", words=True
    )
    answered_utc: str = column("When the answer reached the lab", unit=UTC)
    typed: str | None = column(
        "What was typed, character by character, where `value` is the number read from it, such as `3,5` for 3.5; "
        "blank = `value` is what was given",
        default=None,
        words=True,
    )


@dataclass(frozen=True)
class EventRow:
    """Anything else that happened, in order."""

    participant: str = column("Participant id")
    trial: int | None = column("Trial running at the time; blank = none")
    tick: int | None = column("Tick running at the time; blank = none")
    utc: str = column("When the lab learned of it", unit=UTC)
    kind: str = column(
        "Name of the event. page.NAME = the participant's page, or second device, noted it by itself; page.own.NAME = "
        "a page of the study's own did"
    )
    source: str = column("Who caused it", levels=("participant", "experimenter", "lab", "robot"))
    data: str = column(
        "JSON: details. by = the experimenter's initials; characters = length of words that somebody wrote and that no "
        "export holds",
        json="object",
    )


@dataclass(frozen=True)
class ChainRow:
    """One link of a participant's chain: a hash over what was written, and over the link before."""

    participant: str = column("Participant id")
    seq: int = column("Number of the link, from 1", least=1)
    row_table: str = column(
        "Table that was written into. sessions, cycles, submissions, identities and tokens are the lab's own, in no "
        "export; begun = what was there when the chain began is linked after this"
    )
    row_key: str | None = column(
        "Which row, by its key without the participant, joined by '_'; blank = the next of a table in order of "
        "arrival. The last link of a key tells of the row as it is now, those before of what it was"
    )
    content: str | None = column(
        "SHA-256 of what was written (see docs/topics/integrity.md); blank = the row was removed"
    )
    marks: str | None = column(
        "Two hex digits for each column of the row: which was changed; blank for the lab's own tables"
    )
    hash: str = column("SHA-256 over the hash of the link before and the other columns of this one")


@dataclass(frozen=True)
class CertificateRow:
    """What there was of somebody when they ended: acknowledged by their pages, stored, and where their chain ended."""

    participant: str = column("Participant id")
    utc: str = column("When it was signed: at the end of the session, and again when a page reported", unit=UTC)
    links: int = column("Number of links of the chain by then", least=0)
    head: str = column("Hash of the last of them")
    ticks: int = column("Rows of `ticks` that were stored", unit="ticks", least=0)
    practice_ticks: int = column("Rows of `practice_ticks` that were stored", unit="ticks", least=0)
    answers: int = column("Rows of `survey_answers` that were stored", least=0)
    messages: int = column("Submits and notes of pages that were stored and acknowledged", least=0)
    told_ticks: int | None = column(
        "Ticks of practice and trials that the pages were told are saved, as they report; blank = no report",
        unit="ticks",
        least=0,
    )
    told_messages: int | None = column(
        "Submits and notes that the pages were told are saved, as they report; blank = no report", least=0
    )
    key: str = column("Public half of the data folder's key (Ed25519), hex")
    signature: str = column("Signature over the other columns as JSON, in the order of their names, hex")


def row_of(row_type: type[Row], values: dict[str, Any]) -> Row:
    """The row with these values of all columns, in their order, which it takes over: `row_type(**values)` without
    setting each by itself, which takes a frozen dataclass five times as long."""
    row = object.__new__(row_type)
    object.__setattr__(row, "__dict__", values)
    return row


TABLES: dict[str, type] = {
    "participants": ParticipantRow,
    "trials": TrialRow,
    "tasks": TaskRow,
    "ticks": TickRow,
    "practice_ticks": TickRow,
    "alerts": AlertRow,
    "survey_answers": SurveyAnswerRow,
    "events": EventRow,
    "certificates": CertificateRow,
    "chain": ChainRow,
}
"""Exported tables in the order they are written."""
DESCRIPTIONS: Mapping[str, str] = {
    "participants": "One row per participant: condition order, study file and consent",
    "trials": "One row per trial: the condition with its parameters, and the objects on the table",
    "tasks": "One row per pickup or dropoff: the instructed goal and the outcome",
    "ticks": f"One row per {TICK_S:g} s decision of the trials: state, input, action and belief",
    "practice_ticks": f"One row per {TICK_S:g} s decision of the practice before a trial; columns as in ticks. "
    "Practice that is repeated goes on with another cycle",
    "alerts": "One row per stimulus of the second task: a sensor reading, unless the study names another kind",
    "survey_answers": "One row per answer to a questionnaire or form, as given; questionnaires.json has the items",
    "events": "Anything else that happened, in order",
    "certificates": "One row per participant who has ended: acknowledged = stored, signed (salab certificate)",
    "chain": "One row per row that was ever written: hashes by which `salab verify` finds what was changed since",
}
KEYS: Mapping[str, tuple[str, ...]] = {
    "participants": ("participant",),
    "trials": ("participant", "trial"),
    "tasks": ("participant", "trial", "task"),
    "ticks": ("participant", "trial", "tick"),
    "practice_ticks": ("participant", "trial", "tick"),
    "alerts": ("participant", "trial", "alert"),
    "certificates": ("participant",),
    "chain": ("participant", "seq"),
}
"""What makes a row unique, and the order of rows within a participant. Other tables keep the order of arrival."""
REFERENCES: Mapping[str, str] = {
    "trials": "participants",
    "tasks": "trials",
    "ticks": "trials",
    "practice_ticks": "participants",
    "alerts": "trials",
    "survey_answers": "participants",
    "events": "participants",
    "certificates": "participants",
    "chain": "participants",
}
"""The table that a row belongs to, by that table's key. Practice comes before its trial has a row."""


@dataclass(frozen=True)
class ColumnInfo:
    """A line of the codebook."""

    table: str
    name: str
    type: str
    optional: bool
    description: str
    unit: str | None
    levels: tuple[str, ...]
    json: str | None
    least: int | None
    most: int | None
    words: bool


def columns(table: str) -> tuple[ColumnInfo, ...]:
    """The columns of a table in order; `StudyError` names the tables there are."""
    if table not in TABLES:
        raise StudyError(f"no table {table!r}; tables are {list(TABLES)}")
    row_type = TABLES[table]
    hints = get_type_hints(row_type)
    infos = []
    for item in dataclasses.fields(row_type):
        parts = [part for part in get_args(hints[item.name]) if part is not type(None)]
        kind = parts[0] if parts else hints[item.name]
        infos.append(
            ColumnInfo(
                table=table,
                name=item.name,
                type=kind.__name__,
                optional=bool(parts),
                **item.metadata,
            )
        )
    return tuple(infos)


def codebook() -> Iterator[ColumnInfo]:
    """Every column of every table."""
    for table in TABLES:
        yield from columns(table)
