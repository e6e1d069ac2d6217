"""What the analysis reads of an export: completed trials measured, surveys scored, and how good the data are.

Everything is read by `study.export.export.read_table`, but for the ticks, which `study.analysis.ticks` streams.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median
from typing import Any

from study.analysis.measures import TIME_LIMIT, Measures
from study.analysis.summaries import conditions_of
from study.analysis.ticks import AnalysisError, Measured, measured
from study.definition.builtin_questionnaires import Instrument
from study.definition.files_beside import MOST_STUDY_BYTES
from study.definition.questionnaires import own_instruments
from study.definition.toml_reader import parse_toml
from study.export.export import read_meta, read_table
from study.flow.answers import SurveyScore, survey_scores
from study.flow.recorded import ARM_FREED
from study.json_text import parse_json
from study.records import AlertRow, EventRow, ParticipantRow, RecordProblem, TaskRow, TrialRow
from study.text_file import FileProblem, read_text


@dataclass(frozen=True)
class EndedSummary:
    """What did not end by itself under one condition: freed arms and time limits."""

    condition: str
    cycles: int
    """Pick-and-places of the trials analysed."""
    freed_cycles: int
    """Those in which the arm was freed."""
    frees: int
    """How often it was."""
    by_participant: int
    by_experimenter: int
    pickups_over_time: int
    dropoffs_over_time: int
    not_run_for_time: int
    """Tasks that the trial's time limit left undone."""


@dataclass(frozen=True)
class AlertSummary:
    """The distractor under one condition."""

    condition: str
    raised: int
    answered: int
    correct: int
    median_answer_s: float | None
    """Trial time from the alert to its answer."""


@dataclass(frozen=True)
class Failure:
    """Failed tasks of one kind, condition and reason."""

    condition: str
    kind: str
    reason: str
    tasks: int


@dataclass(frozen=True)
class Quality:
    """What a reader has to know about the data before believing the tables."""

    participants: int
    complete_participants: int
    """With a completed trial under every condition that occurs."""
    left_out_participants: dict[str, int]
    """TaskKind (demo, pilot) to participants that are not analysed."""
    trials: int
    trials_left_out: dict[str, int]
    """Outcome to number of trials that were not completed."""
    ticks: int
    missing_ticks: int
    pauses: int
    overruns: int
    position_counts: dict[str, dict[int, int]]
    """Condition to place in the order to number of trials: equal when counterbalanced."""
    failures: tuple[Failure, ...]
    alerts: tuple[AlertSummary, ...]
    missing_surveys: dict[str, int]
    """Questionnaire to completed trials without it."""
    ended: tuple[EndedSummary, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class DataSet:
    """A loaded export."""

    name: str
    meta: dict[str, Any]
    conditions: tuple[str, ...]
    participants: tuple[ParticipantRow, ...]
    trials: tuple[TrialRow, ...]
    measures: Measures
    scores: tuple[SurveyScore, ...]
    parameters: dict[str, tuple[dict[str, Any], ...]]
    """Condition to the different sets of arbiter parameters its trials ran with; one, unless the study was changed."""
    studies: dict[str, dict[str, Any]] = field(default_factory=dict)
    """File name to the study file's contents."""
    quality: Quality = field(kw_only=True)


def load(folder: Path | str, *, without_unusable: bool = False, as_written: bool = False) -> DataSet:
    """Read and measure an export (of `salab export` or `salab simulate`).

    `as_written`: its files are known to be as they were written, such as by `refuse_changed`; then ticks are read from
    Parquet, which is faster. `without_unusable`: participants whose record cannot be used are left out, and the notes
    say who and why; otherwise they are an error as everything else is.

    Raises `StudyError` with one sentence for a folder that is none, a foreign schema version, missing columns, bad
    cells, demo data alone, no completed trial, or one condition alone.
    """
    left_out: dict[str, str] = {}
    while True:
        try:
            return _loaded(Path(folder), left_out, as_written)
        except RecordProblem as problem:
            if not without_unusable or problem.participant in left_out:
                raise
            left_out[problem.participant] = str(problem)


def _loaded(folder: Path, left_out: Mapping[str, str], as_written: bool) -> DataSet:
    if not folder.is_dir():
        raise AnalysisError(f"{folder}: no such folder; give the folder that `salab export` or `salab simulate` wrote")
    meta = read_meta(folder)
    everyone: list[ParticipantRow] = read_table(folder, "participants")
    unwritten = [name for names in meta.get("unwritten_rows", {}).values() for name in names]
    for name in unwritten:
        if name not in left_out:
            raise RecordProblem(name, f"{folder}: rows of participant {name} could not be exported; meta.json has more")
    people = [row for row in _analysed(folder, everyone) if row.participant not in left_out]
    names = {row.participant for row in people}
    every_trial: list[TrialRow] = read_table(folder, "trials")
    _check_participants(folder, "trials", [row for row in every_trial if row.participant not in left_out], everyone)
    all_trials = [row for row in every_trial if row.participant in names]
    studies, notes = _studies(folder, meta)
    notes += [f"{name} is left out, whose record cannot be used: {problem}." for name, problem in left_out.items()]
    completed = [row for row in all_trials if row.outcome == "completed"]
    trials = _not_excluded(folder, completed, studies, notes)
    if not trials:
        found = ", ".join(f"{count} {outcome}" for outcome, count in Counter(t.outcome for t in all_trials).items())
        raise AnalysisError(
            f"{folder}: no completed trial (trials: {found or 'none'}); "
            "let at least one participant finish, then export again"
        )
    if len({row.condition for row in trials}) < 2:
        raise AnalysisError(
            f"{folder}: all {len(trials)} completed trials are under {trials[0].condition}; the analysis compares "
            "conditions, so complete trials under at least two, then export again"
        )
    kept = {(row.participant, row.trial) for row in trials}
    every_task: list[TaskRow] = read_table(folder, "tasks")
    _check_trials(folder, "tasks", [row for row in every_task if row.participant not in left_out], every_trial)
    tasks = [row for row in every_task if (row.participant, row.trial) in kept]
    _check_tasks(folder, trials, tasks)
    known = {(row.participant, row.trial) for row in every_trial}
    passed = measured(folder, tasks, kept, known, as_written=as_written)
    measures = passed.measures
    answers = [
        row
        for row in read_table(folder, "survey_answers")
        if row.trial is not None and (row.participant, row.trial) in kept
    ]
    own: dict[str, Instrument] = {}
    for study in studies.values():
        for name, form in own_instruments(study).items():
            if own.setdefault(name, form) != form:
                notes.append(f"Questionnaire {name} differs between the study files; all its answers are scored alike.")
    scores = survey_scores(answers, own)
    every_alert: list[AlertRow] = read_table(folder, "alerts")
    _check_trials(folder, "alerts", [row for row in every_alert if row.participant not in left_out], every_trial)
    alerts = [row for row in every_alert if (row.participant, row.trial) in kept]
    conditions = conditions_of(measures)
    who_freed = [
        row
        for row in read_table(folder, "events")
        if (row.participant, row.trial) in kept and (freed := ARM_FREED.of(row)) and freed.phase == "trial"
    ]
    ended = _ended(conditions, trials, tasks, who_freed)
    parameters, changed = _parameters(trials)
    quality = _quality(everyone, people, all_trials, trials, measures, scores, alerts, passed, [*notes, *changed])
    data = DataSet(
        name=folder.name,
        meta=meta,
        conditions=conditions,
        participants=tuple(people),
        trials=tuple(trials),
        measures=measures,
        scores=scores,
        parameters=parameters,
        studies=studies,
        quality=replace(quality, ended=ended),
    )
    return data


def _analysed(folder: Path, everyone: list[ParticipantRow]) -> list[ParticipantRow]:
    """Study participants, without pilots and demos; pilots if there is nobody else."""
    people = [row for row in everyone if row.kind == "study"] or [row for row in everyone if row.kind == "pilot"]
    if everyone and not people:
        raise AnalysisError(
            f"{folder}: all {len(everyone)} participants are demo participants, which are not analysed; "
            "export data of real or simulated participants"
        )
    return people


def _check_participants(folder: Path, table: str, rows: Sequence[Any], everyone: Sequence[ParticipantRow]) -> None:
    unknown = sorted({row.participant for row in rows} - {row.participant for row in everyone})
    if unknown:
        raise AnalysisError(
            f"{folder / table}.csv: participant {unknown[0]} is not in participants.csv; export the data again"
        )


def _check_trials(
    folder: Path, table: str, rows: Sequence[TaskRow] | Sequence[AlertRow], every_trial: Sequence[TrialRow]
) -> None:
    known = {(row.participant, row.trial) for row in every_trial}
    unknown = sorted({(row.participant, row.trial) for row in rows} - known)
    if unknown:
        participant, trial = unknown[0]
        raise AnalysisError(
            f"{folder / table}.csv: participant {participant}, trial {trial} is not in trials.csv; "
            "export the data again"
        )


def _check_tasks(folder: Path, trials: list[TrialRow], tasks: list[TaskRow]) -> None:
    with_tasks = {(row.participant, row.trial) for row in tasks}
    without = [row for row in trials if (row.participant, row.trial) not in with_tasks]
    if without:
        raise RecordProblem(
            without[0].participant,
            f"{folder / 'tasks.csv'}: no tasks of participant {without[0].participant}, trial {without[0].trial}, "
            "which was completed; export the data again",
        )
    conditions = {(row.participant, row.trial): row.condition for row in trials}
    for task in tasks:
        if task.condition != conditions[task.participant, task.trial]:
            raise RecordProblem(
                task.participant,
                f"{folder / 'tasks.csv'}: participant {task.participant}, trial {task.trial} is {task.condition} there "
                f"and {conditions[task.participant, task.trial]} in trials.csv; export the data again",
            )


def _studies(folder: Path, meta: dict[str, Any]) -> tuple[dict[str, dict[str, Any]], list[str]]:
    names = sorted(name for name in os.listdir(folder) if name.endswith(".toml"))
    several = [folder / name for name in names if name.startswith("study-")]
    paths = several or [folder / name for name in names if name == "study.toml"]
    if not paths:
        return {}, ["The export holds no study file: the settings of robot, distractor and texts are not stated."]
    studies = {}
    for path in paths:
        try:
            studies[path.name] = parse_toml(read_text(path, MOST_STUDY_BYTES, within=folder).encode(), str(path))[0]
        except FileProblem as problem:
            raise AnalysisError(str(problem)) from None
    notes = []
    if len(meta.get("studies", ())) > 1:
        notes.append(
            f"Participants ran under {len(meta['studies'])} different study files; they are analysed together."
        )
    return studies, notes


def _not_excluded(
    folder: Path, completed: list[TrialRow], studies: dict[str, dict[str, Any]], notes: list[str]
) -> list[TrialRow]:
    """The trials to analyse: all, or without the suspect ones where a study file says so; `notes` tells how many."""
    if not any(study.get("quality", {}).get("exclude_suspect") is True for study in studies.values()):
        return completed
    kept = [row for row in completed if (row.quality_override or row.quality) != "suspect"]
    left_out = len(completed) - len(kept)
    notes.append(f"Suspect trials left out, as the study file says (exclude_suspect): {left_out} of {len(completed)}.")
    if completed and not kept:
        raise AnalysisError(
            f"{folder}: all {left_out} completed trials are suspect and the study file leaves such trials out; "
            "override the verdicts that are wrong, or set exclude_suspect = false in the study file of the export"
        )
    return kept


def _parameters(trials: list[TrialRow]) -> tuple[dict[str, tuple[dict[str, Any], ...]], list[str]]:
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for row in trials:
        try:
            parameters = parse_json(row.parameters)
        except ValueError:
            parameters = None
        if not isinstance(parameters, dict):
            raise RecordProblem(
                row.participant,
                f"participant {row.participant}, trial {row.trial}: parameters are not a JSON object; "
                "export the data again",
            )
        found.setdefault(row.condition, {})[json.dumps(parameters, sort_keys=True)] = parameters
    notes = [
        f"Trials under {condition} ran with {len(sets)} different sets of parameters; they are analysed together."
        for condition, sets in found.items()
        if len(sets) > 1
    ]
    return {condition: tuple(sets.values()) for condition, sets in found.items()}, notes


def _quality(
    everyone: list[ParticipantRow],
    people: list[ParticipantRow],
    all_trials: list[TrialRow],
    trials: list[TrialRow],
    measures: Measures,
    scores: tuple[SurveyScore, ...],
    alerts: list[AlertRow],
    passed: Measured,
    notes: list[str],
) -> Quality:
    conditions = conditions_of(measures)
    kinds = {row.kind for row in people}
    if "pilot" in kinds:
        notes = ["All participants are pilots.", *notes]
    kept = {(row.participant, row.trial) for row in trials}
    run: dict[str, set[str]] = {}
    for row in trials:
        run.setdefault(row.participant, set()).add(row.condition)
    positions: dict[str, dict[int, int]] = {condition: {} for condition in conditions}
    for row in trials:
        places = positions[row.condition]
        places[row.trial] = places.get(row.trial, 0) + 1
    failed = Counter(
        (task.condition, task.kind, task.reason or "unknown") for task in measures.tasks if task.outcome == "failure"
    )
    instruments = sorted({item.instrument for item in scores})
    missing = {
        name: len(kept) - sum(item.instrument == name for item in scores)
        for name in instruments
        if sum(item.instrument == name for item in scores) < len(kept)
    }
    return Quality(
        participants=len(run),
        complete_participants=sum(of == set(conditions) for of in run.values()),
        left_out_participants=dict(Counter(row.kind for row in everyone if row.kind not in kinds)),
        trials=len(trials),
        trials_left_out=dict(Counter(row.outcome for row in all_trials if row.outcome != "completed")),
        ticks=passed.ticks,
        missing_ticks=sum(task.missing_ticks for task in measures.tasks),
        pauses=passed.pauses,
        overruns=sum(row.overruns for row in trials),
        position_counts=positions,
        failures=tuple(Failure(*key, count) for key, count in sorted(failed.items())),
        alerts=tuple(
            _alert_summary(condition, [alert for alert in alerts if alert.condition == condition])
            for condition in conditions
        ),
        missing_surveys=missing,
        notes=tuple(notes),
    )


def _ended(
    conditions: tuple[str, ...], trials: list[TrialRow], tasks: list[TaskRow], freed: list[EventRow]
) -> tuple[EndedSummary, ...]:
    """Of each condition: freed arms, by whom as far as events say so, and what time limits ended."""
    of_trial = {(row.participant, row.trial): row.condition for row in trials}
    asked = Counter((of_trial[row.participant, row.trial or 0], row.source) for row in freed)
    found = []
    for condition in conditions:
        of = [task for task in tasks if task.condition == condition]
        attempts = [task.attempts for task in of if task.kind == "pickup"]
        over = Counter((task.kind, task.outcome) for task in of if task.reason == TIME_LIMIT)
        found.append(
            EndedSummary(
                condition=condition,
                cycles=len(attempts),
                freed_cycles=sum(count > 1 for count in attempts),
                frees=sum(attempts) - len(attempts),
                by_participant=asked[condition, "participant"],
                by_experimenter=asked[condition, "experimenter"],
                pickups_over_time=over["pickup", "failure"],
                dropoffs_over_time=over["dropoff", "failure"],
                not_run_for_time=over["pickup", "not_run"] + over["dropoff", "not_run"],
            )
        )
    return tuple(found)


def _alert_summary(condition: str, alerts: list[AlertRow]) -> AlertSummary:
    answered = [alert for alert in alerts if alert.status == "answered"]
    waits = sorted(a.answered_trial_s - a.due_trial_s for a in answered if a.answered_trial_s is not None)
    return AlertSummary(
        condition=condition,
        raised=len(alerts),
        answered=len(answered),
        correct=sum(alert.correct == 1 for alert in answered),
        median_answer_s=float(median(waits)) if waits else None,
    )
