"""`salab reconcile`: a recruitment service's list beside the roster."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands import options
from app.commands.groups import RUN_A_STUDY
from app.commands.options import file, flow_of, place
from app.config import LabConfig
from app.errors import LabError
from study.store import DataPlace

if TYPE_CHECKING:
    from study.flow.reconcile import Finding, Known
    from study.store import Store

MOST_BYTES = 50_000_000

commands = typer.Typer()


@commands.command(rich_help_panel=RUN_A_STUDY, epilog="Example: salab reconcile prolific_export.csv --data data")
def reconcile(
    context: typer.Context,
    service: Annotated[
        Path, typer.Argument(metavar="SERVICE.csv", parser=place, help="the list that was exported there")
    ],
    data: Annotated[
        DataPlace, options.data("folder of the database, or address of one on a server")
    ] = LabConfig().data,
    own_folder: Annotated[Path | None, options.own_folder()] = None,
    id_column: Annotated[str | None, typer.Option(metavar="NAME", help="its column with people's ids")] = None,
    status_column: Annotated[
        str | None, typer.Option(metavar="NAME", help="its column that says what became of them")
    ] = None,
    out: Annotated[Path | None, file("write every line to this CSV file too")] = None,
    apply: Annotated[
        bool, typer.Option("--apply", help="free the places that are proposed to be; no lab runs on the data")
    ] = False,
) -> None:
    """Compare a recruitment service's list with the roster.

    Says who is complete there and not here, gone there and holding a place here, unknown on either side, or there
    twice, and proposes what to do. Reads the lists of Prolific, CloudResearch, Mechanical Turk and SONA as they are.
    Changes nothing without --apply, and then frees the places of those alone who have not agreed to take part; ending
    and rejecting is done on the dashboard. At the service nothing is changed at all.
    """
    from study.flow.reconcile import MEANINGS, reconcile, summary
    from study.flow.recruiter_list import ListError, read_list
    from study.records import utc_text
    from study.store import open_store
    from study.text_file import read_text

    try:
        listed = read_list(read_text(service, MOST_BYTES), id_column=id_column, status_column=status_column)
    except ListError as error:
        raise LabError(f"{service}: {error}") from None
    data = options.beside(data, own_folder)
    with open_store(data, must_exist=True, exclusive=apply, flow=flow_of(context)) as store:
        findings = reconcile(listed, roster_of(store))
        for kind, count in summary(findings).items():
            print(f"{count:5d}  {MEANINGS[kind]}")
        for finding in findings:
            if finding.kind != "agrees":
                print(_line(finding))
        if out is not None:
            _write(out, findings)
            print(f"written to {out}")
        free = [finding for finding in findings if finding.act == "free_place"]
        if free and not apply:
            print(f"places that could be freed: {len(free)}; say --apply to do it, while no lab runs on {data}")
        for finding in free if apply else ():
            reason = f"recruitment service: {finding.service or 'not listed'}"
            is_free = store.lapse(finding.participant, reason, utc_text(time.time()))
            print(
                f"{finding.participant}: {'the place is free' if is_free else 'has agreed meanwhile; nothing was done'}"
            )


def roster_of(store: Store) -> tuple[Known, ...]:
    """Everybody with the ids they go by."""
    from study.flow.reconcile import Known
    from study.flow.roster import Enrolled

    ids, labels = store.link_ids(), store.labels()
    sessions, unreadable = store.everyone()
    everyone = [
        *(Enrolled(one.participant, one.kind, one.session.state, one.order, one.rejected) for one in sessions),
        *(Enrolled(one.participant, one.kind, "unreadable", (), False, one.reason) for one in unreadable),
    ]
    return tuple(
        Known(
            one,
            tuple(ids.get(one.participant, {}).values()) or tuple(filter(None, [labels.get(one.participant)])),
            one.participant in ids,
        )
        for one in everyone
    )


def _line(finding: Finding) -> str:
    from study.flow.reconcile import MEANINGS

    here = " ".join(filter(None, [finding.participant or "nobody", finding.lab and f"({finding.lab})"]))
    there = finding.service or "not listed"
    return f"{finding.person or '-'}  {there} / {here}: {MEANINGS[finding.kind]}. {finding.advice}".rstrip()


def _write(path: Path, findings: tuple[Finding, ...]) -> None:
    import csv
    import dataclasses

    from study.flow.reconcile import Finding

    names = [each.name for each in dataclasses.fields(Finding)]
    try:
        with path.open("w", encoding="utf-8", newline="") as target:
            lines = csv.writer(target, lineterminator="\n")
            lines.writerow(names)
            lines.writerows([getattr(finding, name) for name in names] for finding in findings)
    except OSError as error:
        raise LabError(f"{path}: cannot be written: {error.strerror or error}") from None
