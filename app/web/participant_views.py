"""The views of the participant's page: one module for each page of the flow, named in the page's document.

The document says which there are, so that all are loaded before the first is shown and nothing else ever is. Pages with
a robot have one view together, which the participant's page loads by itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path

from app.errors import LabError
from study.flow.flow import Flow
from study.flow.page import FlowPage
from study.flow.protocol import NEEDS, State

FOLDER = "/static/participant/views"
PLACE = "<!-- the views of the flow -->"
"""Where they are named in `participant.html`."""


def addresses(flow: Flow) -> Mapping[State, str]:
    """Where the view of each page is served."""
    return {page.state: f"{FOLDER}/{_name(page)}.js" for page in flow.pages if page.state not in NEEDS}


def own_views(flow: Flow, static: Path) -> Mapping[str, Path]:
    """The files that do not stand in static/, by the address they are served at.

    Raises `LabError` for a page without its view.
    """
    found = {}
    for page in flow.pages:
        if page.state in NEEDS:
            continue
        address = f"{FOLDER}/{_name(page)}.js"
        shipped = static / address.removeprefix("/static/")
        file = page.view if isinstance(page.view, Path) else shipped
        if not file.is_file():
            raise LabError(f"page {page.state!r} of the flow has no view: there is no file {file}")
        if file != shipped:
            if shipped.is_file():
                raise LabError(f"page {page.state!r} of the flow: the lab has a view {shipped.name} of its own")
            found[address] = file
    return found


def with_views(html: str, flow: Flow) -> str:
    """The document of the participant's page, with its views named."""
    links = [
        f'<link rel="modulepreload" data-state="{escape(state)}" href="{escape(address)}" />'
        for state, address in addresses(flow).items()
    ]
    return html.replace(PLACE, "\n    ".join(links))


def _name(page: FlowPage) -> str:
    return page.view if isinstance(page.view, str) else page.state
