"""Pages of the flow without a lab: what a scripted client hands in, given what a page shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from study.definition.study import Study
from study.flow.flow import FLOW, Flow
from study.flow.page import PageContext, Person
from study.flow.protocol import Session, State


def handed_in(study: Study, state: State, person: Person, flow: Flow = FLOW) -> Mapping[str, Any]:
    """What this person hands in on the page of this state, in the second of three trials."""
    page = flow.page(state)
    assert page.scripted is not None
    given = page.scripted(page.content(Session("p01", 3, state, trial=2), PageContext(study)), person)
    assert given is not None
    return given.data
