"""The HTTP API of the roster: who is enrolled, counterbalancing, links and QR codes; reject, withdraw, erase."""

from __future__ import annotations

from collections import Counter
from typing import Annotated, Literal, get_args

from fastapi import FastAPI, HTTPException, Query
from fastapi.responses import Response
from pydantic import BaseModel, Field

from app.lab.lab import Lab, NoSuchParticipant, RecordUnreadable
from app.lab.withdrawing import withdraw_from
from app.session.commands import NotNow
from app.web.access import Experimenter, ParticipantId, RequestBody, TheLab, experimenters_router, not_now, refusals
from app.web.numbers import Limit, Offset
from app.web.qr_code import qr_svg
from app.web.sessions_api import Known, in_order_of_enrolment, number_of
from study.flow import roster
from study.flow.answers import MAX_TEXT_CHARACTERS
from study.flow.open_link import open_link
from study.flow.page import Text
from study.flow.roster import ACTS, Act, Enrolled
from study.integrity.certificate import state_of
from study.records import CertificateRow
from study.store import Store, UnreadableSession

PAGE = 50
"""Lines of the roster sent at once, unless asked otherwise."""

router = experimenters_router("roster")

Show = Literal[
    "all",
    "study",
    "pilot",
    "demo",
    "erased",
    "waiting",
    "under_way",
    "done",
    "rejected",
    "withdrawn",
    "aborted",
    "screened_out",
    "lapsed",
    "unreadable",
]
Reason = Annotated[Text, Field(pattern=r"\S")]


class CellReply(BaseModel):
    """Who holds a cell, and how far it is filled."""

    participant: str
    """Id, such as P001."""
    cell: Literal["waiting", "under_way", "done"]
    """How far it is filled."""


class GridReply(BaseModel):
    """One order of the conditions. The next participant gets the order marked `next`."""

    order: list[str]
    """The conditions' ids, first to last."""
    next: bool
    """Whether the next participant gets it."""
    cells: list[CellReply]
    """Its cells that are taken."""
    counts: dict[str, int]
    """How many have completed it (`done`), are under way, have not begun (`waiting`), and how many places lapsed; the
    lapsed ones hold no cell."""


class CertificateReply(BaseModel):
    """What was stored when somebody ended, against what their pages were told is saved."""

    state: Literal["complete", "less", "more", "unconfirmed"]
    """complete: the same; less or more: pages were told of so; unconfirmed: no page reported."""
    ticks: int
    """Ticks stored, practice included."""
    messages: int
    """Submits and notes stored."""
    links: int
    """Links of their chain by then."""
    head: str
    """Hash of the last of them."""


class RosterLine(BaseModel):
    """One participant. `why_not` says for every act why it is not possible, "" where it is."""

    participant: str
    """Id, such as P001."""
    label: str | None
    """The experimenter's name for them, never exported; null for none."""
    ids: dict[str, str]
    """The ids of the open link they came over; never exported."""
    kind: str
    """study, pilot or demo; `erased` for a mark."""
    state: str
    """The state of the session; `erased` for a mark."""
    order: list[str]
    """The conditions' ids, first to last."""
    rejected: bool
    """Whether their cell was given out again."""
    erased_utc: str | None
    """When they were erased, in UTC; null for who is still there."""
    created_utc: str | None
    """When they were enrolled, in UTC; null for a mark."""
    why_not: dict[str, str]
    """Act to the reason why it is not possible; "" when it is."""
    problem: str | None = None
    """Why this session cannot be read; null as a rule."""
    certificate: CertificateReply | None = None
    """What was certified when they ended; null before."""


class RecruitmentReply(BaseModel):
    """The open link of this study, and how many of its places are taken."""

    open: bool
    """Whether the study file opens the link."""
    quota: int
    """At most so many hold a cell."""
    held: int
    """How many hold a cell now."""
    link: str
    """The link to give to a recruitment service."""


class RosterReply(BaseModel):
    """One page of the roster, newest first, beside the whole grid."""

    title: str
    """The study's title."""
    withdrawal: Literal["keep", "erase"]
    """What the consent text says becomes of the data of somebody who withdraws."""
    words_limit: int
    """How many characters free words may have: reasons, remarks, notes, messages."""
    recruitment: RecruitmentReply
    """The open link."""
    grid: list[GridReply]
    """Every order and who holds its cells."""
    counts: dict[str, int]
    """How many there are, by state and by kind."""
    total: int
    """Lines that `show` and `search` let through, on all pages."""
    offset: int
    """How many of them stand on earlier pages."""
    lines: list[RosterLine]
    """The lines of this page."""


class RejectRequest(RequestBody):
    """Why the data cannot be used."""

    reason: Reason
    """In words; kept apart from the record and never exported."""


class WithdrawRequest(RequestBody):
    """Somebody's wish to stop. `keep` says whether what was recorded stays; if left out, the study file decides."""

    reason: Text | None = None
    """In words, if there are any; kept apart from the record and never exported."""
    keep: bool | None = None
    """Whether their data stay; left out, as the consent they gave says."""


class EraseRequest(RequestBody):
    """The id once more, so that nobody is erased by a slip."""

    confirm: Annotated[str, Field(max_length=100)]
    """Must equal the id in the path."""


class EraseReply(BaseModel):
    """What became of it."""

    participant: str
    """Id, such as P001."""
    overwritten: bool | None
    """Whether the space is overwritten already. If not, another process was reading; the next erasure does it. Null:
    the database is on a server, which promises no overwriting."""


class LinkReply(BaseModel):
    """A link that carries a token; it cannot be shown again."""

    participant: str
    """Id, such as P001."""
    link: str
    """The link; whoever has it is the participant."""
    panel_link: str
    """Another one for the second device; empty where the study has none."""


class QrRequest(RequestBody):
    """A link of this lab. It travels in the body: addresses end up in logs."""

    link: Annotated[str, Field(min_length=1, max_length=500)]
    """Begins with the lab's address."""


def enrolment(
    store: Store,
) -> tuple[
    list[Known], dict[str, str], dict[str, dict[str, str]], tuple[tuple[str, str], ...], dict[str, CertificateRow]
]:
    """Everybody, their labels, the ids of their links, the marks of those erased and the certificates: as many queries
    for a thousand as for one."""
    certificates = {row.participant: row for row in store.rows("certificates", include_demo=True, include_pilot=True)}
    return (
        *(in_order_of_enrolment(*store.everyone()), store.labels(), store.link_ids(), store.erasures()),
        certificates,
    )


def _certificate(row: CertificateRow | None) -> CertificateReply | None:
    if row is None:
        return None
    return CertificateReply(
        state=state_of(row),
        ticks=row.ticks + row.practice_ticks,
        messages=row.messages,
        links=row.links,
        head=row.head,
    )


def _enrolled(lab: Lab, known: Known) -> Enrolled:
    if isinstance(known, UnreadableSession):
        return Enrolled(known.participant, known.kind, "unreadable", (), False, known.reason)
    live = lab.live_session(known.participant)
    session = live.session if live else known.session
    return Enrolled(known.participant, known.kind, session.state, known.order, known.rejected)


async def _one(lab: Lab, participant: str) -> Enrolled:
    try:
        return _enrolled(lab, await lab.stored_session(participant))
    except RecordUnreadable as error:
        return Enrolled(participant, "study", "unreadable", (), False, str(error))
    except NoSuchParticipant as error:
        raise HTTPException(404, str(error)) from None


async def _may(lab: Lab, act: Act, participant: str) -> None:
    why = roster.why_not(act, await _one(lab, participant))
    if why:
        raise HTTPException(409, f"{participant}: {why}")


@router.get("/roster")
async def read_roster(
    lab: TheLab,
    who: Experimenter,
    offset: Offset = 0,
    limit: Limit = PAGE,
    show: Annotated[Show, Query(description="Only participants of this kind or in this state.")] = "all",
    search: Annotated[
        str, Query(max_length=200, description="Only participants whose id, label or link's ids have this in them.")
    ] = "",
) -> RosterReply:
    """One page of everybody ever enrolled, erased ones as a mark, and how the counterbalancing is filled."""
    stored, labels, ids, erasures, certificates = await lab.store.run(enrolment)
    people = {one.participant: (_enrolled(lab, one), one) for one in stored}
    lines = [
        RosterLine(
            participant=name,
            label=labels.get(name),
            ids=ids.get(name, {}),
            kind=one.kind,
            state=one.state,
            order=list(one.order),
            rejected=one.rejected,
            erased_utc=None,
            created_utc=known.created_utc,
            why_not={act: roster.why_not(act, one) for act in ACTS},
            problem=one.problem or None,
            certificate=_certificate(certificates.get(name)),
        )
        for name, (one, known) in people.items()
        if roster.matches(one, " ".join([labels.get(name, ""), *ids.get(name, {}).values()]), show, search)
    ]
    if show in ("all", "erased"):
        lines += [_mark(name, utc) for name, utc in erasures if search.strip().lower() in name.lower()]
    lines.sort(key=lambda line: number_of(line.participant), reverse=True)
    everyone = [one for one, _ in people.values()]
    study = lab.setup.study
    return RosterReply(
        title=study.title,
        withdrawal=study.consent.on_withdrawal,
        words_limit=MAX_TEXT_CHARACTERS,
        recruitment=RecruitmentReply(
            open=study.recruitment.open,
            quota=study.recruitment.quota,
            held=sum(one.holds_cell for one in everyone),
            link=open_link(lab.base_url, study.recruitment),
        ),
        grid=[
            GridReply(
                order=list(row.order),
                next=row.is_next,
                cells=[CellReply(participant=name, cell=cell) for name, cell in row.cells],
                counts={**_counted(row), "lapsed": row.lapsed},
            )
            for row in roster.grid(study, everyone)
        ],
        counts={
            **roster.counts(everyone),
            "pilot": sum(one.kind == "pilot" for one in everyone),
            "demo": sum(one.kind == "demo" for one in everyone),
            "erased": len(erasures),
        },
        total=len(lines),
        offset=offset,
        lines=lines[offset : offset + limit],
    )


def _counted(row: roster.GridRow) -> dict[str, int]:
    found = Counter(cell for _, cell in row.cells)
    return {cell: found[cell] for cell in get_args(roster.Cell)}


def _mark(participant: ParticipantId, utc: str) -> RosterLine:
    gone = "Erased: nothing is left but this mark."
    return RosterLine(
        participant=participant,
        label=None,
        ids={},
        kind="erased",
        state="erased",
        order=[],
        rejected=False,
        erased_utc=utc,
        created_utc=None,
        why_not=dict.fromkeys(ACTS, gone),
    )


@router.post("/participants/{participant}/reject", responses=refusals(404, 409))
async def reject(participant: ParticipantId, body: RejectRequest, lab: TheLab, who: Experimenter) -> dict[str, str]:
    """Give the cell of a completed session out again because its data cannot be used. The data stay, marked."""
    await _may(lab, "reject", participant)
    if not await lab.reject(participant, body.reason.strip(), who):
        raise HTTPException(409, f"{participant}: Rejected already.")
    return {"participant": participant, "state": "rejected"}


@router.post("/participants/{participant}/withdraw", responses=refusals(404, 409))
async def withdraw(participant: ParticipantId, body: WithdrawRequest, lab: TheLab, who: Experimenter) -> dict[str, str]:
    """End the session at the participant's wish; their data stay or are erased, as asked or as the consent says."""
    await _may(lab, "withdraw", participant)
    keep = body.keep
    if keep is None:
        agreed = await lab.study_of(await lab.stored_session(participant))
        keep = agreed.consent.on_withdrawal == "keep"
    reason = (body.reason or "").strip() or None
    try:
        await withdraw_from(lab, participant, reason, who, keep=keep)
    except NotNow as error:
        raise not_now(error) from None
    except NoSuchParticipant as error:
        raise HTTPException(404, str(error)) from None
    return {"participant": participant, "state": "withdrawn" if keep else "erased"}


@router.post("/participants/{participant}/erase", responses=refusals(404, 409))
async def erase(participant: ParticipantId, body: EraseRequest, lab: TheLab, who: Experimenter) -> EraseReply:
    """Delete everything about a participant for good; a session that is live ends first. A mark without content stays.

    Copies that the lab made of the database before a migration are deleted too. Exports made before and copies made
    elsewhere are not reached from here.
    """
    await _may(lab, "erase", participant)
    if body.confirm != participant:
        raise HTTPException(422, f"confirm: must be the id, {participant}, to erase this participant")
    try:
        return EraseReply(participant=participant, overwritten=await lab.erase(participant))
    except NoSuchParticipant as error:
        raise HTTPException(404, str(error)) from None


@router.post("/participants/{participant}/link", status_code=201, responses=refusals(404, 409))
async def new_link(participant: ParticipantId, lab: TheLab, who: Experimenter) -> LinkReply:
    """Other links to the same participant's pages, for those that were lost. Earlier links go on working."""
    await _may(lab, "new_link", participant)
    link, panel_link = await lab.new_links(participant)
    return LinkReply(participant=participant, link=link, panel_link=panel_link)


@router.post(
    "/qr",
    response_class=Response,
    responses={200: {"description": "A picture, image/svg+xml", "content": {"image/svg+xml": {}}}},
)
async def qr_code(body: QrRequest, lab: TheLab, who: Experimenter) -> Response:
    """A link of this lab as a QR code (SVG)."""
    if not body.link.startswith(f"{lab.base_url}/"):
        raise HTTPException(422, f"link: must begin with {lab.base_url}/")
    return Response(qr_svg(body.link), media_type="image/svg+xml")


def add_roster_api(app: FastAPI) -> None:
    """Put all routes of this file into an app whose `state.lab` is the lab."""
    app.include_router(router)
