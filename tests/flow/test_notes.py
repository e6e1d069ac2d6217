"""What a page may note: names, forms, bounds and who may say it."""

from __future__ import annotations

from typing import Annotated, Any

import pytest
from pydantic import Field, ValidationError

from app.wire import client_message
from study.flow.flow import FLOW, Flow
from study.flow.notes import NAMESPACE, note_types, read_note
from study.flow.page import FlowPage, Refused, StepData
from study.flow.recorded import READ_BACK
from study.records import StudyError


class Looked(StepData):
    """Where the person looked."""

    where: str
    s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0


def flow_with(**notes: type[StepData]) -> Flow:
    return FLOW.with_page(FlowPage(state="mine", leads_on="mine_done", notes=notes), after="consent")


def refusal(flow: Flow, name: str, data: dict[str, Any], role: str = "participant") -> tuple[str | None, str]:
    with pytest.raises(Refused) as caught:
        read_note(flow, name, data, role)  # type: ignore[arg-type]
    return caught.value.problems[0]


def test_a_note_becomes_an_event_in_the_namespace_of_pages_with_the_page_that_said_it() -> None:
    assert read_note(FLOW, "hidden", {}, "participant") == ("page.hidden", {"role": "participant"})
    assert read_note(FLOW, "panel_heard", {"heard": True}, "panel") == (
        "page.panel_heard",
        {"heard": True, "role": "panel"},
    )


def test_nothing_that_the_lab_goes_by_can_be_said_by_a_page_but_what_is_meant_for_it() -> None:
    goes_by = {event.kind for event in READ_BACK}
    sayable = {f"{NAMESPACE}{name}" for name in note_types(flow_with(hidden=Looked))}
    assert goes_by & sayable == {"page.hidden", "page.visible", "page.pad_unplugged", "page.received"}


@pytest.mark.parametrize(
    ("name", "data", "field"),
    [
        ("abort", {}, "name"),
        ("page.hidden", {}, "name"),
        ("own.where", {}, "name"),
        ("hidden", {"words": "note-1"}, "data.words"),
        ("pad_unplugged", {"pad_id": "x" * 201}, "data.pad_id"),
        ("pad_unplugged", {"pad_id": 3}, "data.pad_id"),
        ("view_switched", {}, "data.view"),
        ("view_switched", {"view": ["top"]}, "data.view"),
        ("heartbeat_by_timer", {"why": "because"}, "data.why"),
    ],
)
def test_what_a_note_has_not_is_refused_and_named(name: str, data: dict[str, Any], field: str) -> None:
    assert refusal(FLOW, name, data)[0] == field


def test_each_page_says_its_own_notes() -> None:
    assert refusal(FLOW, "panel_heard", {"heard": True})[0] == "name"
    assert refusal(FLOW, "hidden", {}, "panel") == ("name", "'hidden' is noted by participant, and this page is panel")


def test_a_page_of_ones_own_declares_what_it_notes() -> None:
    flow = flow_with(looked=Looked)
    assert read_note(flow, "own.looked", {"where": "left", "s": 1}, "participant") == (
        "page.own.looked",
        {"where": "left", "s": 1.0, "role": "participant"},
    )
    assert refusal(flow, "own.looked", {"where": "left", "s": 61})[0] == "data.s"
    assert refusal(flow, "own.looked", {"where": "x" * 3000})[0] == "data"
    assert refusal(flow, "own.other", {})[0] == "name"
    wire = client_message(flow)
    assert wire.validate_python({"type": "note", "id": "a", "name": "own.looked", "data": {"where": "left"}})
    for name in ("own.other", "looked"):
        with pytest.raises(ValidationError):
            wire.validate_python({"type": "note", "id": "a", "name": name, "data": {}})


def test_a_page_whose_notes_have_no_proper_name_is_no_page() -> None:
    with pytest.raises(StudyError, match="note 'Looked at': a note is small letters"):
        flow_with(**{"Looked at": Looked})
