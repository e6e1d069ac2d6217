"""The last pages: thanks, and the four ends before their time. `study.flow.protocol.TERMINAL` names their states."""

from __future__ import annotations

from study.definition.link_placeholders import filled
from study.flow.facts import as_read
from study.flow.page import Content, FlowPage, PageContext
from study.flow.protocol import Session

VIEW = "end"


def done_content(session: Session, context: PageContext) -> Content:
    """Thanks, and the way back to where people came from."""
    link = filled(context.study.recruitment.completion_link, context.ids)
    return {"text": list(as_read(context.study).texts.thanks), "completion_link": link}


def screened_out_content(session: Session, context: PageContext) -> Content:
    """Why it ends here, and the way back to where people came from."""
    link = filled(context.study.recruitment.screened_out_link, context.ids)
    return {"text": list(as_read(context.study).texts.screened_out), "completion_link": link}


def withdrawn_content(session: Session, context: PageContext) -> Content:
    """They stopped."""
    return {"text": list(as_read(context.study).texts.withdrawn), "completion_link": None}


def aborted_content(session: Session, context: PageContext) -> Content:
    """They were stopped."""
    return {"text": list(as_read(context.study).texts.aborted), "completion_link": None}


def lapsed_content(session: Session, context: PageContext) -> Content:
    """They were away for long before they agreed to take part, and came back when every place was taken."""
    rules = as_read(context.study).recruitment
    return {"text": list(rules.full), "completion_link": filled(rules.full_link, context.ids)}


DONE = FlowPage(state="done", content=done_content, view=VIEW)
WITHDRAWN = FlowPage(state="withdrawn", content=withdrawn_content, view=VIEW)
ABORTED = FlowPage(state="aborted", content=aborted_content, view=VIEW)
LAPSED = FlowPage(state="lapsed", content=lapsed_content, view=VIEW)
SCREENED_OUT = FlowPage(state="screened_out", content=screened_out_content, view=VIEW)
