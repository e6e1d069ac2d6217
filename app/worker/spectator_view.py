"""The experimenters' 3-D view of a worker's world, there only while somebody looks on.

It lives in the worker's loop thread, which alone writes its server. It is opened and drawn after a slice has been drawn
for the participant, in the time that is left until the next one, and only after every third slice.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from app.trial.engine import TrialEngine

if TYPE_CHECKING:
    from sim.view.spectator import SpectatorView

EVERY_SLICES = 3
"""Ten pictures a second."""


class OnDemandView:
    """See the module's text. `make` makes a view that is not open."""

    def __init__(self, make: Callable[[], SpectatorView]) -> None:
        self._make = make
        self._view: SpectatorView | None = None
        self._looking = False
        self._shown = (0, 0)
        self._slices = 0

    def ask(self, looking: bool) -> None:
        """Whether somebody looks on from now on."""
        self._looking = looking

    def close(self) -> None:
        """Close the view if it is open."""
        view, self._view = self._view, None
        if view is not None:
            view.close()

    def tend(self, engine: TrialEngine) -> tuple[int | None] | None:
        """Open, close or draw, whatever is due. When it was opened or closed, its port now, as a tuple of one."""
        if self._looking and self._view is None:
            self._view = self._make()
            port = self._view.open()
            self._shown = (0, 0)
            self._draw(engine)
            return (port,)
        if not self._looking and self._view is not None:
            self.close()
            return (None,)
        self._slices += 1
        if self._view is not None and (self._slices % EVERY_SLICES == 0 or self._shown != engine.place):
            self._draw(engine)
        return None

    def _draw(self, engine: TrialEngine) -> None:
        assert self._view is not None
        if self._shown != engine.place:
            self._shown = engine.place
            self._view.show(engine.scene, engine.delivered)
        belief = engine.belief.as_dict() if engine.belief is not None else {}
        self._view.update(engine.world, engine.delivered, belief, engine.goal)
