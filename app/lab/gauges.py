"""How much there is of what in a running lab at this moment, for `app.monitoring.metrics`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from typing import get_args

from app.lab.crowding import Crowding
from app.lab.health import Health
from app.limits import Refusals
from app.monitoring.metrics import Gauge
from app.session.session import LiveSession
from study.flow.flow import Flow
from study.flow.protocol import PAUSED, TERMINAL
from study.store import AsyncStore, TroubleKind


def gauges(
    sessions: Collection[LiveSession],
    store: AsyncStore,
    health: Health,
    flow: Flow,
    dashboards: int,
    refusals: Refusals,
    crowding: Crowding,
) -> Iterator[Gauge]:
    """Of the live sessions, not of everybody ever enrolled: nothing is read from the disk."""
    states = Counter(session.session.state for session in sessions)
    known = dict.fromkeys((*flow.states, PAUSED, *sorted(TERMINAL)), 0)
    yield Gauge("salab_sessions", "Live sessions, by the state that they are in.", {**known, **states}, "state")
    yield Gauge("salab_people", "People who take part now in real time, as the lab counts them for its open link.",
                {"": crowding.running})  # fmt: skip
    yield Gauge("salab_people_capacity", "How many people the lab takes at once; no value where nobody knows.",
                {} if crowding.most is None else {"": crowding.most})  # fmt: skip
    queues = [session.queue_length for session in sessions]
    yield Gauge("salab_session_queue_length", "What waits to be dealt with in the live sessions, in all.",
                {"": sum(queues)})  # fmt: skip
    yield Gauge("salab_session_queue_longest", "What waits in the session with the most.", {"": max(queues, default=0)})
    yield Gauge("salab_store_queue_length", "What waits to be written.", {"": store.waiting})
    yield Gauge("salab_store_last_write_seconds", "How long the last write took.", {"": store.last_write_s})
    trouble = store.trouble
    yield Gauge("salab_store_trouble", "1 for what is wrong with the store now.",
                {kind: int(trouble is not None and trouble.kind == kind) for kind in get_args(TroubleKind)},
                "kind")  # fmt: skip
    yield Gauge("salab_healthy", "1 while a check of the lab is well, 0 while it fails.",
                {check.name: int(check.is_well) for check in health.checks()}, "check")  # fmt: skip
    yield Gauge("salab_connections", "Connected pages of participants and second devices, experimenters who look at a "
                "session in 3-D, and open dashboards.",
                {"participant": sum(session.connected for session in sessions),
                 "panel": sum(session.panel_connected for session in sessions),
                 "spectator": sum(session.spectators.count for session in sessions),
                 "dashboard": dashboards}, "role")  # fmt: skip
    yield Gauge(
        "salab_workers", "Sessions' processes that are up.", {"": sum(session.has_worker for session in sessions)}
    )
    yield Gauge("salab_bounds_reached", "How often each bound on what a client may cost was reached.",
                {str(bound): count for bound, count in refusals.counts.items()}, "bound", is_counter=True)  # fmt: skip
    yield Gauge("salab_outgoing_queue_longest", "What waits to be sent to the slowest page.",
                {"": max((session.unsent for session in sessions), default=0)})  # fmt: skip
