"""The picture of a session: one viser server that shows the robot's world and never changes it.

A session's loop thread owns a `SceneView` and calls it about 30 times a second:

    with SceneView() as view:
        port = view.open()                  a server on 127.0.0.1; the web process proxies it
        view.show(scene_spec)               at every reset: what stands where
        view.update(world_state)            after every slice
        view.set_view("side")

While no browser looks on, an update is kept and not drawn: three quarters of a session's work would be for nobody. The
last one is drawn when a browser comes, with the next update or `tend`.

How nodes get to the browser is `sim.view.nodes`. The look is cheap to draw without a graphics card: no environment map,
no grid, no shadow maps, few triangles, and everything that never moves is unlit with its light in the colours.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import TracebackType

from sim import fetch
from sim.interface import ObjectSpec, Pose, QuaternionWxyz, SceneSpec, SimError, Vector3, WorldState
from sim.view import props
from sim.view.looks import AskedLook, RobotLook, robot_look
from sim.view.nodes import NodeServer
from sim.view.viewpoints import DEFAULT_VIEW, VIEWS, CameraView, FollowingView

LinkPoses = Callable[[Sequence[float], float], Mapping[str, tuple[Vector3, QuaternionWxyz]]]


@dataclass(frozen=True)
class SceneOptions:
    """How the robot is drawn, and what besides the world itself."""

    look: AskedLook = "own"
    """Which of the robot's looks, where none is given."""

    plumb_line: bool = True
    """A line from the gripper down to the surface below it: how deep, how high."""
    shadows: bool = True
    """Soft spots under the objects and the gripper."""
    marked: bool = False
    """Whether `mark` may ring the instructed object or bin."""
    inset: FollowingView | None = None
    """What a browser that shows the inset sees; None = the scene serves none."""
    orbit_from: CameraView | None = None
    """Where browsers start that then steer their own cameras; None = all look where `set_view` says."""
    reset_tween_s: float = 0.6
    """How long the arm's way back takes on screen after a reset (its jump in the world takes no time)."""


@dataclass
class _Tween:
    joints_rad: tuple[float, ...]
    opening_m: float
    began_s: float


@dataclass
class _Shown:
    """What the screen shows now."""

    scene: SceneSpec | None = None
    specs: dict[str, ObjectSpec] = field(default_factory=dict)
    """Of everything that a scene has named so far."""
    joints_rad: tuple[float, ...] | None = None
    opening_m: float = 0.0
    poses: Mapping[str, tuple[Vector3, QuaternionWxyz]] = field(default_factory=dict)
    tween: _Tween | None = None
    marked: str | None = None
    """The object or bin with the ring."""
    began: bool = False
    """Whether the scene has been drawn with everything in its place: whoever comes finds no half of it."""
    undrawn: tuple[WorldState, Mapping[str, Pose] | None] | None = None
    """What came while nobody looked on."""


class SceneView:
    """One session's picture. All methods belong to one thread; viser's own threads only send.

    Args:
        link_poses: forward kinematics, `(joints_rad, finger_opening_m) -> {link: (position, wxyz)}` in the world;
            the Fetch's when None.
        look: the robot's meshes; those that the options name, made or read at `open()`, when None.
        options: what is drawn besides the world.
        clock: seconds, for the tween only.
    """

    def __init__(
        self,
        link_poses: LinkPoses | None = None,
        look: RobotLook | None = None,
        options: SceneOptions = SceneOptions(),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._link_poses = fetch.link_poses if link_poses is None else link_poses
        self._look = look
        self._options = options
        self._clock = clock
        self.server = NodeServer()
        self._fixed_key: object = None
        self._shown = _Shown()
        self._view = options.orbit_from or VIEWS[DEFAULT_VIEW]

    def __enter__(self) -> SceneView:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- life

    def open(self) -> int:
        """Start the server on a free port of 127.0.0.1 and return the port. May be called again."""
        if self.server.is_open:
            return self.server.port
        self._look = robot_look(self._options.look) if self._look is None else self._look
        self.server.open()
        with self.server.batch():
            for link, model in self._look.glb_by_link.items():
                self.server.add(f"/robot/{link}", model, visible=False, solid=True)
            self.server.node("/floor", props.floor_mesh, "blend").put((0.5, 0.0, 0.0))
            self._aim()
        return self.server.port

    def close(self) -> None:
        """Stop the server; may be called twice."""
        self.server.close()
        self._fixed_key = None

    @property
    def look(self) -> RobotLook | None:
        """The robot's meshes, for another view of it. Known after `open()`."""
        return self._look

    @property
    def clients(self) -> int:
        """How many browsers look on."""
        return self.server.clients

    # -- what is seen

    def show(self, scene: SceneSpec, delivered: Mapping[str, Pose] | None = None) -> None:
        """Show a fresh world, nothing marked. The arm glides from where it was seen last to its new place over the next
        updates.

        Args:
            scene: the table, the bins and the objects that stand on it.
            delivered: id → pose of what earlier cycles left in (or beside) the bins; it stays visible. When None,
                what is on screen stays there until the next `update`.

        Raises:
            SimError: not open, or `delivered` names an object that no scene has named.
        """
        shown = self._shown
        self.server.running  # noqa: B018 - says so when it is not open
        shown.scene = scene
        shown.specs.update({spec.id: spec for spec in (*scene.gone, *(placed.spec for placed in scene.objects))})
        if shown.joints_rad is not None:
            shown.tween = _Tween(shown.joints_rad, shown.opening_m, self._clock())
        shown.marked, shown.began, shown.undrawn = None, False, None
        with self.server.batch():
            self._mark(None)
            self._show_fixed(scene)
            standing = {placed.spec.id: placed.rest_pose for placed in scene.objects}
            self._place({**(delivered or {}), **standing}, hide_others=delivered is not None)

    def update(self, state: WorldState, delivered: Mapping[str, Pose] | None = None) -> None:
        """Show the world after a slice; objects neither in `state` nor in `delivered` are hidden.

        Raises:
            SimError: before `show`, or an object no spec is known for.
        """
        if self._shown.scene is None:
            raise SimError("update() before show(): the view does not know what stands where")
        if self.server.clients or not self._shown.began:
            self._draw(state, delivered)
            return
        self._shown.undrawn = state, delivered
        self._shown.joints_rad, self._shown.opening_m = state.joint_positions_rad, state.finger_opening_m
        self._shown.poses = {}

    def _draw(self, state: WorldState, delivered: Mapping[str, Pose] | None) -> None:
        self._shown.undrawn, self._shown.began = None, True
        joints_rad, opening_m = self._tweened(state)
        if (joints_rad, opening_m) != (self._shown.joints_rad, self._shown.opening_m) or not self._shown.poses:
            self._shown.poses = self._link_poses(joints_rad, opening_m)
        self._shown.joints_rad, self._shown.opening_m = joints_rad, opening_m
        poses = self._shown.poses
        with self.server.batch():
            for link, (position, wxyz) in poses.items():
                node = self.server.nodes.get(f"/robot/{link}")
                if node is None:
                    continue
                node.put(position, wxyz)
                node.show(self._view.head or not link.startswith("head_"))
            present = {item.id: item.pose for item in state.objects}
            self._place({**(delivered or {}), **present}, hide_others=True)
            if "gripper_link" in poses:
                self._plumb(poses["gripper_link"][0])
            self._mark(self._shown.marked)
            self._aim()

    def set_view(self, name: str) -> None:
        """Move every browser's camera, and that of those who come later, to a named view.

        Raises:
            SimError: no such view; the message names those there are.
        """
        if name not in VIEWS:
            raise SimError(f"no view {name!r}; there are {list(VIEWS)}")
        self._view = VIEWS[name]
        with self.server.batch():
            self._aim()

    def mark(self, goal: str | None) -> None:
        """Ring the instructed object or bin from now on, None = nothing; only if the options allow it. After `show`.

        The ring of an object goes where the object goes."""
        if not self._options.marked:
            return
        self._shown.marked = goal
        with self.server.batch():
            self._mark(goal)

    def tend(self) -> None:
        """While nothing moves: for browsers that have come, draw what came before them; point the cameras of those, and
        of browsers whose picture has another shape."""
        if self._shown.undrawn is not None and self.server.clients:
            self._draw(*self._shown.undrawn)
        with self.server.batch():
            self._aim()

    # -- inside

    def _aim(self) -> None:
        if self._options.orbit_from is None:
            gripper = self._shown.poses.get("gripper_link")
            self.server.aim(self._view, self._options.inset, None if gripper is None else gripper[0])
        else:
            self.server.start_at(self._view)

    def _show_fixed(self, scene: SceneSpec) -> None:
        key = (scene.table, scene.bins)
        if key == self._fixed_key:
            return
        server = self.server
        server.remove("/fixed/")
        self._fixed_key = key
        server.node("/fixed/table", props.table_mesh, "unlit", scene.table, solid=True).put(scene.table.center_world_m)
        for target in scene.bins:
            x_m, y_m = target.center_xy_m
            server.node(f"/fixed/bin/{target.id}", props.bin_mesh, "unlit", target, solid=True).put((x_m, y_m, 0.0))
            wide_m = max(target.inner_size_m) * 1.25
            if self._options.shadows:
                shade = server.node(f"/fixed/shade/{target.id}", props.shadow_mesh, "blend", wide_m, wide_m)
                shade.put((x_m, y_m, 0.002))
        if self._options.shadows:
            size_m = scene.table.size_m[0] * 1.15, scene.table.size_m[1] * 1.05
            x_m, y_m, _ = scene.table.center_world_m
            server.node("/fixed/shade/table", props.shadow_mesh, "blend", *size_m).put((x_m, y_m, 0.003))
            server.node("/fixed/shade/robot", props.shadow_mesh, "blend", 0.62, 0.6).put((0, 0, 0.004))

    def _surface_z_m(self, x_m: float, y_m: float) -> float:
        """Height of what lies below (x, y): the table, a bin's floor, or the ground."""
        scene = self._shown.scene
        if scene is None:
            return 0.0
        # The arm starts right above the table's edge: a centimetre keeps the line from flickering between heights.
        table = scene.table
        off_m = (abs(x_m - table.center_world_m[0]), abs(y_m - table.center_world_m[1]))
        if off_m[0] <= table.size_m[0] / 2.0 + 0.01 and off_m[1] <= table.size_m[1] / 2.0 + 0.01:
            return table.top_z_m
        inside = any(target.distance_m(x_m, y_m) == 0.0 for target in scene.bins)
        return 0.004 if inside else 0.0

    def _place(self, poses: Mapping[str, Pose], *, hide_others: bool) -> None:
        for object_id, pose in poses.items():
            spec = self._shown.specs.get(object_id)
            if spec is None:
                raise SimError(f"no object {object_id!r}; known are {sorted(self._shown.specs)}")
            node = self.server.node(f"/object/{object_id}", props.object_mesh, "lit", spec, solid=True)
            node.put(pose.position_world_m, pose.quaternion_wxyz)
            node.show(True)
            if self._options.shadows:
                self._shade(spec, pose)
        for name, node in self.server.nodes.items() if hide_others else ():
            if name.startswith(("/object/", "/shade/object/")) and name.rsplit("/", 1)[1] not in poses:
                node.show(False)

    def _shade(self, spec: ObjectSpec, pose: Pose) -> None:
        x_m, y_m, z_m = pose.position_world_m
        wide_m = max(spec.size_m[0], spec.size_m[1])
        shade = self.server.node(f"/shade/object/{spec.id}", props.shadow_mesh, "blend", wide_m, wide_m)
        above_m = z_m - self._surface_z_m(x_m, y_m)
        if above_m < 0.0 or above_m > 0.6:
            shade.show(False)
            return
        shade.put((x_m, y_m, z_m - above_m + 0.0022))
        shade.show(True)

    def _plumb(self, gripper_world_m: Vector3) -> None:
        x_m, y_m, z_m = gripper_world_m
        surface_m = self._surface_z_m(x_m, y_m)
        if self._options.shadows:
            shade = self.server.node("/shade/gripper", props.shadow_mesh, "blend", 0.09, 0.09)
            shade.put((x_m, y_m, surface_m + 0.0028))
        if self._options.plumb_line:
            line = self.server.node("/plumb/line", props.plumb_line_mesh, "unlit")
            mark = self.server.node("/plumb/mark", props.plumb_mark_mesh, "blend")
            line.put((x_m, y_m, z_m))
            line.stretch((1.0, 1.0, round(max(z_m - surface_m, 0.001), 4)))
            mark.put((x_m, y_m, surface_m + 0.0034))

    def _mark(self, marked: str | None) -> None:
        scene = self._shown.scene
        where, name = None, ""
        if scene is not None and marked in [placed.spec.id for placed in scene.objects]:
            x_m, y_m, _ = self.server.nodes[f"/object/{marked}"].position
            where, name = (x_m, y_m, self._surface_z_m(x_m, y_m) + 0.003), "/mark/object"
            self.server.node(name, props.mark_mesh, "blend")
        elif scene is not None and marked is not None:
            target = scene.bin(marked)
            where, name = (*target.center_xy_m, target.height_m), f"/fixed/mark/{marked}"
            self.server.node(name, props.bin_mark_mesh, "blend", target)
        for known, node in self.server.nodes.items():
            if known.startswith(("/mark/", "/fixed/mark/")):
                node.show(known == name)
        if where is not None:
            self.server.nodes[name].put(where)

    def _tweened(self, state: WorldState) -> tuple[tuple[float, ...], float]:
        tween = self._shown.tween
        if tween is None:
            return state.joint_positions_rad, state.finger_opening_m
        duration_s = self._options.reset_tween_s
        share = 1.0 if duration_s <= 0.0 else min((self._clock() - tween.began_s) / duration_s, 1.0)
        if share >= 1.0:
            self._shown.tween = None
            return state.joint_positions_rad, state.finger_opening_m
        share = share * share * (3.0 - 2.0 * share)
        joints_rad = tuple(
            a + share * (b - a) for a, b in zip(tween.joints_rad, state.joint_positions_rad, strict=True)
        )
        return joints_rad, tween.opening_m + share * (state.finger_opening_m - tween.opening_m)
