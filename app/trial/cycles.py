"""`CycleStart` as text, for the store: where a worker takes a trial up again."""

from __future__ import annotations

import json
from typing import Any

from app.trial.values import CycleStart
from sim.interface import Pose


def cycle_to_json(start: CycleStart) -> str:
    """The start of a cycle as one line of JSON."""
    delivered = [[name, pose.position_world_m, pose.quaternion_wxyz] for name, pose in start.delivered]
    return json.dumps({"cycle": start.cycle, "first_tick": start.first_tick, "delivered": delivered})


def cycle_from_json(text: str) -> CycleStart:
    """The start of `cycle_to_json`."""
    fields: dict[str, Any] = json.loads(text)
    delivered = tuple((name, Pose(tuple(position), tuple(wxyz))) for name, position, wxyz in fields["delivered"])
    return CycleStart(fields["cycle"], fields["first_tick"], delivered)
