"""The pages of the participant's flow, in their order.

    eligibility → consent → demographics → setup → instructions
            → (practice_ready → practice → trial_ready → trial → survey → break) for each trial, no break after the last
            → debrief → done

A page that another one leads on to stands behind it. The pause stands beside the line, and so do the ends before their
time.
"""

from study.flow.page import FlowPage
from study.flow.pages import (
    consent,
    debrief,
    demographics,
    driving,
    eligibility,
    endings,
    instructions,
    setup,
    survey,
    waiting,
)

PAGES: tuple[FlowPage, ...] = (
    eligibility.PAGE,
    consent.PAGE,
    demographics.PAGE,
    setup.PAGE,
    instructions.PAGE,
    driving.PRACTICE_READY,
    driving.PRACTICE,
    driving.TRIAL_READY,
    driving.TRIAL,
    survey.PAGE,
    waiting.BREAK,
    waiting.PAUSE,
    debrief.PAGE,
    endings.DONE,
    endings.WITHDRAWN,
    endings.ABORTED,
    endings.SCREENED_OUT,
    endings.LAPSED,
)
