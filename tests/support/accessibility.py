"""axe-core on a page as it stands: what people who cannot see, hear or point well would stumble over."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from axe_playwright_python.sync_playwright import Axe

if TYPE_CHECKING:
    from playwright.sync_api import Page

_AXE = Axe()
# Frames hold viser's canvas, which has nothing to read; what stands around them is ours.
_OPTIONS = {"resultTypes": ["violations"], "iframes": False}


def findings(page: Page, where: str) -> list[str]:
    """A line for each finding on the page, however grave, or none."""
    violations: list[dict[str, Any]] = _AXE.run(page, options=_OPTIONS).response["violations"]
    return [
        f"{where}: {found['impact']} {found['id']}: {found['help']}: "
        + "; ".join(f"{node['target'][0]} {node['html'][:160]}" for node in found["nodes"][:3])
        for found in violations
    ]
