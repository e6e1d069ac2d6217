"""How the robot looks: the lab's own shapes, or the Fetch's published meshes. A study says which.

`own` is made of code (`sim.view.own_arm`, `sim.view.own_body`), ships with the lab under its licence, needs nothing.
`published` are Fetch Robotics' meshes (`sim.view.published`), an extra under CC BY-NC-SA 4.0. A study that names one of
them gets it everywhere, or is told that it cannot; what was drawn is recorded.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Literal, get_args

from sim.interface import SimError
from sim.view.meshes import to_glb
from sim.view.own_arm import ARM
from sim.view.own_body import BODY
from sim.view.published import published_glbs, why_missing

LookName = Literal["own", "published"]
AskedLook = Literal["own", "published", "installed"]
"""`installed`: the published meshes on a machine that has them, the lab's own on others."""


@dataclass(frozen=True)
class RobotLook:
    """One GLB per link, in the link's own frame."""

    name: LookName
    """What is drawn."""
    glb_by_link: Mapping[str, bytes]
    note: str = ""
    """Why it is not the one that was asked for; "" when it is."""

    @property
    def facts(self) -> dict[str, str]:
        """What is recorded of it: its name, and twelve digits of the SHA-256 of all that a browser is sent."""
        digest = hashlib.sha256()
        for link in sorted(self.glb_by_link):
            digest.update(f"{link} {len(self.glb_by_link[link])} ".encode() + self.glb_by_link[link])
        return {"look": self.name, "look_sha256": digest.hexdigest()[:12]}


@lru_cache(maxsize=1)
def own_look() -> RobotLook:
    """The lab's own, made once in a process: what moves is lit, what stands still has its light in its colours."""
    moving = {link: to_glb(make()) for link, make in ARM.items()}
    still = {link: to_glb(make(), "unlit") for link, make in BODY.items()}
    return RobotLook("own", MappingProxyType({**still, **moving}))


def chosen(asked: AskedLook) -> LookName:
    """Which look that is on this machine. Raises `SimError` when there is none of that name."""
    if asked not in get_args(AskedLook):
        raise SimError(f"no look {asked!r}; there are {', '.join(get_args(AskedLook))}")
    if asked == "installed":
        return "own" if why_missing() else "published"
    return asked


def robot_look(asked: AskedLook = "own", cache: Path | None = None, source: Path | None = None) -> RobotLook:
    """The look of that name. If the published meshes cannot be had it is the own one with a note: a trial that is under
    way does not stop for a look.

    Args:
        asked: which one.
        cache, source: as `published_glbs`.

    Raises:
        SimError: there is none of that name.
    """
    if chosen(asked) == "own":
        return own_look()
    try:
        return RobotLook("published", published_glbs(cache, source))
    except SimError as error:
        return RobotLook("own", own_look().glb_by_link, f"{error}: the lab's own look is drawn instead")
