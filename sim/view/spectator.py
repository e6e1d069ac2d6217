"""What experimenters see of a session: the same world on a server of its own, with what the robot believes over it.

It is another server because what one viser server shows, all its browsers get, and nothing of this may reach the
participant. Each spectator steers their own camera.

    column over a goal      its height is the goal's probability (`FULL_M` = certain)
    label over the column   the goal's name and probability
    ring, ▸                 the instructed goal
"""

from __future__ import annotations

from collections.abc import Mapping

from sim.interface import Pose, SceneSpec, Vector3, WorldState
from sim.view import props
from sim.view.looks import RobotLook
from sim.view.scene import SceneOptions, SceneView
from sim.view.viewpoints import SPECTATOR

FULL_M = 0.30
ABOVE_M = 0.03
"""Between a thing's top and the foot of its column."""


class SpectatorView:
    """The experimenters' picture of one session. All methods belong to the thread that made it.

    Args:
        look: the robot's meshes; the lab's own when None.
    """

    def __init__(self, look: RobotLook | None = None) -> None:
        self._view = SceneView(look=look, options=SceneOptions(marked=True, orbit_from=SPECTATOR))
        self._scene: SceneSpec | None = None

    def open(self) -> int:
        """Start the server on a free port of 127.0.0.1 and return the port."""
        return self._view.open()

    def close(self) -> None:
        """Stop it; may be called twice."""
        self._view.close()

    def show(self, scene: SceneSpec, delivered: Mapping[str, Pose] | None = None) -> None:
        """Show a fresh world, as `SceneView.show`."""
        self._scene = scene
        self._view.show(scene, delivered)

    def update(
        self, state: WorldState, delivered: Mapping[str, Pose], belief: Mapping[str, float], goal: str | None
    ) -> None:
        """Show the world with a belief over it: object or bin id → probability; `goal` is the instructed one."""
        self._view.update(state, delivered)
        self._view.mark(goal)
        with self._view.server.batch():
            tops = self._tops(state)
            shown = {name: belief[name] for name in belief if name in tops}
            for name, probability in shown.items():
                self._column(name, tops[name], probability, name == goal)
            for name, node in self._view.server.nodes.items():
                if name.startswith("/belief/"):
                    node.show(name.rsplit("/", 1)[1] in shown)

    def _column(self, name: str, top_world_m: Vector3, probability: float, instructed: bool) -> None:
        x_m, y_m, z_m = top_world_m
        high_m = max(FULL_M * probability, 0.002)
        column = self._view.server.node(f"/belief/column/{name}", props.belief_mesh, "lit")
        column.put((x_m, y_m, z_m + ABOVE_M))
        column.stretch((1.0, 1.0, round(high_m, 4)))
        label = self._view.server.label(f"/belief/label/{name}")
        label.put((x_m, y_m, z_m + ABOVE_M + high_m + 0.01))
        label.say(f"{'▸ ' if instructed else ''}{self._words(name)} {probability:.2f}")

    def _tops(self, state: WorldState) -> dict[str, Vector3]:
        """Where the columns stand: on the objects as they are now and on the bins."""
        assert self._scene is not None
        tops: dict[str, Vector3] = {}
        for item in state.objects:
            x_m, y_m, z_m = item.pose.position_world_m
            tops[item.id] = (x_m, y_m, z_m + self._scene.object(item.id).spec.size_m[2] / 2.0)
        for target in self._scene.bins:
            tops[target.id] = (*target.center_xy_m, target.height_m)
        return tops

    def _words(self, name: str) -> str:
        assert self._scene is not None
        placed = [item.spec.label for item in self._scene.objects if item.spec.id == name]
        return placed[0] if placed else self._scene.bin(name).label
