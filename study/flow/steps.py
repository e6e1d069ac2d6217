"""Everything that can be handed in over the wire: the steps of the pages, and those about alerts."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel

from study.flow.flow import FLOW, Flow
from study.flow.page import Count, StepData, Text


class AlertData(StepData):
    """Which reading, and what was typed."""

    alert: Count
    """Number of the reading, as in `alert`."""
    value: Text | None = None
    """What was typed, for `alert_answer`."""


ALERT_STEPS = ("alert_shown", "alert_heard", "alert_answer")


def step_names(flow: Flow = FLOW) -> tuple[str, ...]:
    """Every step that a page or the second device can submit."""
    return (*flow.steps, *ALERT_STEPS)


STEP_DATA: Mapping[str, type[BaseModel]] = {
    **{name: step.data for name, step in FLOW.steps.items()},
    **dict.fromkeys(ALERT_STEPS, AlertData),
}
"""What each step must contain, those about alerts included."""
