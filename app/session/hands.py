"""The state of the hands on its way from the page to the worker. It does not queue: the worker takes the newest."""

from __future__ import annotations

from dataclasses import replace

from app.session.connections import refuse
from app.session.context import SessionContext
from app.session.interfaces import Client
from app.wire import Heartbeat, Input
from app.worker.messages import ControlsState

MAX_SEQ_STEP = 1_000_000
"""Inputs may be numbered with gaps, but one number must not use up all that come after it."""


class Hands:
    """Of one session's participant."""

    def __init__(self, context: SessionContext) -> None:
        self._context = context

    def on_hands(self, client: Client, message: Input | Heartbeat) -> None:
        """A page told of the hands."""
        context = self._context
        if client.role != "participant":
            refuse(client, "illegal", "type", "the second device does not drive the robot")
        elif not context.connections.holds(client):
            pass  # taken over, or not let in yet: the page says its state again with the next heartbeat
        elif isinstance(message, Heartbeat):
            self._on_heartbeat(message)
        elif not context.last_seq < message.seq <= context.last_seq + MAX_SEQ_STEP:
            text = (
                f"seq {message.seq} does not follow {context.last_seq}, the last one taken "
                f"(at most {MAX_SEQ_STEP} may be left out); it was ignored"
            )
            refuse(client, "out_of_order", "seq", text)
        else:
            context.history.heard(context.services.now_unix_s())
            context.last_seq = message.seq
            self._on_input(client, message)

    def _on_heartbeat(self, message: Heartbeat) -> None:
        context = self._context
        vitals = context.vitals
        context.history.heard(context.services.now_unix_s())
        before = replace(vitals)
        vitals.visible, vitals.focused, vitals.device = message.visible, message.focused, message.device
        if message.focused != before.focused and before.focused is not None:
            context.notice("focus_back" if message.focused else "focus_lost", "participant", {})
        if vitals != before:
            context.services.changed(context.enrolment.participant)
        if context.enrolment.pace == "real_time":
            # It repeats an input, so it cannot be ahead of the last one: that one was lost with the connection.
            seq = min(message.seq, context.last_seq)
            context.link.send(ControlsState(seq, None if context.is_away() else message.direction, beat=True))

    def _on_input(self, client: Client, message: Input) -> None:
        context = self._context
        if context.enrolment.pace == "lockstep" and not (context.session.is_ticking and context.link.ready):
            text = f"no tick can run in state {context.session.state!r} now; the input was ignored"
            refuse(client, "illegal", "type", text)
            return
        direction, pressed = (None, None) if context.is_away() else (message.direction, message.gripper)
        context.link.send(ControlsState(message.seq, direction, pressed))
