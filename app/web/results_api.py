"""The HTTP API of what came of it: verdicts over trials and their overriding, counts, questionnaire scores."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Literal

from fastapi import FastAPI, HTTPException, Query
from pydantic import BaseModel, ConfigDict, Field

from app.lab.lab import StudyUnreadable
from app.session.commands import NotNow
from app.web.access import Experimenter, ParticipantId, TheLab, experimenters_router, refusals
from app.web.numbers import Limit, Offset, TrialNumber
from study.definition.study import Study
from study.flow.answers import score
from study.flow.page import Text
from study.records import EventRow, StudyError, TrialRow, utc_text
from study.store import Batch, Store

router = experimenters_router("results")


class VerdictLine(BaseModel):
    """One ended trial. An experimenter's `override` counts instead of the automatic `quality`."""

    participant: str
    """Id, such as P001."""
    trial: int
    """Number of the trial, from 1."""
    condition: str
    """Id of the trial's condition."""
    outcome: str
    """How the trial ended."""
    quality: str | None
    """The automatic verdict: good or suspect."""
    broken: list[str]
    """The rules of the study file that the trial broke."""
    override: str | None
    """The experimenter's verdict; null for none."""
    reason: str | None
    """Why it was overridden; null for none."""
    round_trip_ms: float | None
    """Time to the page and back, in milliseconds; null if not measured."""
    hidden_s: float | None
    """How long the page was hidden, in seconds."""
    missed_ticks: int
    """Ticks that started more than 50 ms late."""
    focus_losses: int | None
    """How often the page lost the focus."""
    pad_losses: int | None
    """How often the gamepad was unplugged."""
    unanswered_alerts: int | None
    """Readings that expired."""


class QualityReply(BaseModel):
    """One page of the trials, newest participant first, beside how many there are."""

    good: int
    """Ended trials whose verdict is good."""
    suspect: int
    """Ended trials whose verdict is suspect."""
    total: int
    """Trials that `show` lets through, on all pages."""
    offset: int
    """How many of them stand on earlier pages."""
    lines: list[VerdictLine]
    """The trials of this page."""


class OverrideRequest(BaseModel):
    """Another verdict, and why."""

    model_config = ConfigDict(extra="forbid")

    verdict: Literal["good", "suspect"]
    """What counts from now on."""
    reason: Annotated[Text, Field(pattern=r"\S")]
    """Why; it is exported with the trial."""


class ScoreLine(BaseModel):
    """The mean score of a questionnaire under one condition, over `n` trials."""

    instrument: str
    """Id of the questionnaire."""
    condition: str
    """Id of the condition."""
    n: int
    """How many trials it is the mean of."""
    mean: float
    """The mean score, on the questionnaire's own scale."""


class SummaryReply(BaseModel):
    """What there is of data. Pilot and demo participants are not counted."""

    trials: dict[str, int]
    """How many there are of each outcome."""
    alerts: dict[str, int]
    """How many readings there are of each status."""
    scores: list[ScoreLine]
    """Mean scores, by questionnaire and condition."""


def _line(row: TrialRow) -> VerdictLine:
    return VerdictLine(
        participant=row.participant,
        trial=row.trial,
        condition=row.condition,
        outcome=row.outcome,
        quality=row.quality,
        broken=_sentences(row.quality_broken),
        override=row.quality_override,
        reason=row.quality_reason,
        round_trip_ms=row.round_trip_ms,
        hidden_s=row.hidden_s,
        missed_ticks=row.overruns,
        focus_losses=row.focus_losses,
        pad_losses=row.pad_losses,
        unanswered_alerts=row.unanswered_alerts,
    )


def _sentences(text: str | None) -> list[str]:
    """The rules that were broken, as stored; what cannot be read is shown as it is."""
    try:
        found = json.loads(text or "[]")
    except (ValueError, RecursionError):
        found = None
    return [str(one) for one in found] if isinstance(found, list) else [str(text)[:200]]


@router.get("/quality")
async def read_quality(
    lab: TheLab,
    who: Experimenter,
    show: Annotated[Literal["all", "good", "suspect"], Query(description="Only trials of this verdict.")] = "all",
    offset: Offset = 0,
    limit: Limit = 50,
) -> QualityReply:
    """The verdict over every trial that has ended, pilots and demos included."""
    # Beside the writing thread, here and in `summary`: ticks do not wait for it.
    rows = await asyncio.to_thread(lambda: list(lab.store.store.rows("trials", include_demo=True, include_pilot=True)))
    ended = [(row.quality_override or row.quality, row) for row in reversed(rows) if row.quality is not None]
    shown = [row for verdict, row in ended if show in ("all", verdict)]
    return QualityReply(
        good=sum(verdict == "good" for verdict, _ in ended),
        suspect=sum(verdict == "suspect" for verdict, _ in ended),
        total=len(shown),
        offset=offset,
        lines=[_line(row) for row in shown[offset : offset + limit]],
    )


@router.post("/quality/{participant}/{trial}", responses=refusals(404))
async def override(
    participant: ParticipantId, trial: TrialNumber, body: OverrideRequest, lab: TheLab, who: Experimenter
) -> VerdictLine:
    """Let another verdict count, with the reason, which is exported with the trial. The automatic one stays beside it,
    and an event says who and when."""
    utc, reason = utc_text(time.time()), body.reason

    def write(store: Store) -> TrialRow | None:
        found = store.rows_of("trials", participant, trial=trial)
        if not found or found[0].quality is None:
            return None
        row: TrialRow = replace(found[0], quality_override=body.verdict, quality_reason=reason)
        data = {"by": who, "from": found[0].quality_override or found[0].quality, "to": body.verdict}
        event = EventRow(participant, trial, None, utc, "quality_override", "experimenter", json.dumps(data))
        store.commit(Batch(trials=(row,), events=(event,)))
        return row

    written = await lab.store.run(write)
    if written is None:
        raise HTTPException(404, f"no trial {trial} of {participant} that has ended")
    return _line(written)


@router.get("/summary")
async def summary(lab: TheLab, who: Experimenter) -> SummaryReply:
    """Trials by outcome, readings by what became of them, and mean questionnaire scores by condition."""
    studies = {}
    for stored in await lab.stored_sessions():
        with contextlib.suppress(StudyUnreadable, StudyError):  # nobody can say how theirs are scored
            studies[stored.participant] = await lab.study_of(stored)
    return await asyncio.to_thread(summarise, lab.store.store, studies)


def summarise(store: Store, studies: Mapping[str, Study]) -> SummaryReply:
    """What `GET /api/summary` answers; three passes over the record, however many participants. As in the report,
    questionnaires about a trial that was not completed do not count.

    `studies` are those that the participants were enrolled in: each is scored by the forms they filled in.
    """
    trials: dict[str, int] = {"completed": 0, "aborted": 0, "running": 0}
    alerts: dict[str, int] = {"answered": 0, "expired": 0, "trial_ended": 0, "open": 0}
    answers: dict[tuple[str, str, int, str], dict[str, int]] = defaultdict(dict)
    completed: set[tuple[str, int | None]] = set()
    with store.snapshot() as recorded:
        for row in recorded.rows("trials"):
            trials[row.outcome] = trials.get(row.outcome, 0) + 1
            if row.outcome == "completed":
                completed.add((row.participant, row.trial))
        for row in recorded.rows("alerts"):
            alerts[row.status] = alerts.get(row.status, 0) + 1
        for row in recorded.rows("survey_answers"):
            if (row.participant, row.trial) in completed and row.value.isdecimal() and len(row.value) < 10:
                answers[row.participant, row.condition, row.trial, row.instrument][row.item] = int(row.value)
    forms = {study.hash: {form.id: form for form in study.instruments} for study in studies.values()}
    scores: dict[tuple[str, str], list[float]] = defaultdict(list)
    for (participant, condition, _, instrument), given in answers.items():
        if participant not in studies:
            continue  # enrolled while the studies were read, or with a study that cannot be
        form = forms[studies[participant].hash].get(instrument, instrument)
        try:
            scores[instrument, condition].append(score(form, given))
        except StudyError:
            continue  # half a questionnaire, or one this study does not know, has no score
    lines = [
        ScoreLine(instrument=instrument, condition=condition, n=len(values), mean=sum(values) / len(values))
        for (instrument, condition), values in sorted(scores.items())
    ]
    return SummaryReply(trials=trials, alerts=alerts, scores=lines)


class FigureLine(BaseModel):
    """A figure of the report, at `/dashboard/report/figures/NAME.svg` and `.png`."""

    name: str
    """The file's name without its ending."""
    title: str
    """What it shows."""


class ReportReply(BaseModel):
    """The report of the data so far: `state` none, making, made or cannot, and how far it is or why it cannot be."""

    state: str
    """Whether there is one: none, making, made or cannot."""
    text: str
    """The step under way, or why there is no report."""
    step: int
    """Number of the step under way."""
    of: int
    """How many steps there are."""
    made_utc: str | None
    """When it was made, in UTC; null for none."""
    participants: int
    """How many people it is about."""
    trials: int
    """How many trials it is about."""
    figures: list[FigureLine]
    """Its figures."""


def _report(lab: TheLab) -> ReportReply:
    status = lab.reporter.status
    figures = [FigureLine(name=name, title=title) for name, title in status.figures]
    return ReportReply.model_validate({**vars(status), "figures": figures})


@router.get("/report")
async def read_report(lab: TheLab, who: Experimenter) -> ReportReply:
    """How far the report is."""
    return _report(lab)


@router.post("/report", status_code=202, responses=refusals(409))
async def make_report(lab: TheLab, who: Experimenter) -> ReportReply:
    """Make the report of the data so far, without pilots and demos, in a process of its own."""
    try:
        lab.reporter.start()
    except NotNow as error:
        raise HTTPException(409, str(error)) from None
    return _report(lab)


def add_results_api(app: FastAPI) -> None:
    """Put all routes of this file into an app whose `state.lab` is the lab."""
    app.include_router(router)
