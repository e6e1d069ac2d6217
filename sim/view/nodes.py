"""One viser server and the nodes in it: each is made once, and is then only moved, stretched, hidden or renamed.

Measured on viser 1.1.1, hence the rules: one thread writes a server (two inside `atomic()` stop all frames), names are
used again (nodes with ever new names pile up), only changes travel, and each batch is flushed (half the latency).
"""

from __future__ import annotations

import contextlib
import io
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import viser

from sim.interface import QuaternionWxyz, SimError, Vector3
from sim.view import light
from sim.view.meshes import Material, Mesh, cap_glb, to_glb
from sim.view.viewpoints import INSET, CameraView, FollowingView


@lru_cache(maxsize=128)
def glb(make: Callable[..., Mesh], material: Material, *given: Any) -> bytes:
    """`to_glb(make(*given), material)`, made once in a process: a second server shows the same things at once."""
    return to_glb(make(*given), material)


cap = lru_cache(maxsize=128)(cap_glb)
"""`cap_glb`, made once in a process."""


@dataclass
class Node:
    """A handle and what was last sent for it, so that only changes travel."""

    handle: Any
    position: Vector3 = (0.0, 0.0, 0.0)
    wxyz: QuaternionWxyz = (1.0, 0.0, 0.0, 0.0)
    visible: bool = True
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    text: str = ""
    cap: bytes | None = None
    """What fills it where the inset cuts it open."""

    def put(self, position: Sequence[float], wxyz: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> None:
        """Where it is, metres, and how it is turned."""
        # Rounded to 0.02 mm: what is smaller than a pixel need not be sent.
        here = tuple(round(float(value) * 5e4) / 5e4 for value in position)
        turned = tuple(round(float(value), 5) for value in wxyz)
        if here != self.position:
            self.handle.position = here
            self.position = here  # type: ignore[assignment]
        if turned != self.wxyz:
            self.handle.wxyz = turned
            self.wxyz = turned  # type: ignore[assignment]

    def stretch(self, scale: tuple[float, float, float]) -> None:
        """How many times its made size it has along x, y, z."""
        if scale != self.scale:
            self.handle.scale = scale
            self.scale = scale

    def show(self, visible: bool) -> None:
        """Whether it is seen."""
        if visible != self.visible:
            self.handle.visible = visible
            self.visible = visible

    def say(self, text: str) -> None:
        """The words of a label."""
        if text != self.text:
            self.handle.text = text
            self.text = text


STILL_M = 1e-4
"""A following camera that is so near to its place stands there."""


class NodeServer:
    """A viser server on a free port of 127.0.0.1. All methods belong to one thread; viser's own threads only send."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}
        self._server: viser.ViserServer | None = None
        self._framed: dict[int, tuple[str, float]] = {}
        self._caps: dict[int, dict[str, Any]] = {}
        """Handles of the caps by the inset that has them, and by node."""

    @property
    def is_open(self) -> bool:
        """Whether there is a server."""
        return self._server is not None

    @property
    def port(self) -> int:
        """Where it listens."""
        port: int = self.running.get_port()
        return port

    @property
    def clients(self) -> int:
        """How many browsers look on."""
        return len(self.running.get_clients())

    @property
    def running(self) -> viser.ViserServer:
        """The server. Raises `SimError` when it is not open."""
        if self._server is None:
            raise SimError("the view is not open")
        return self._server

    def open(self) -> None:
        """Start it: an empty scene with two lights."""
        # A browser may leave while its camera is being aimed; viser warns of what it then cannot deliver.
        warnings.filterwarnings("ignore", r"Queued a \w+ on a closed connection", UserWarning)
        # viser prints a banner with its address, which is nobody's business but the proxy's.
        with contextlib.redirect_stdout(io.StringIO()):
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        scene = self._server.scene
        with self._server.atomic():
            scene.configure_environment_map(None)
            scene.configure_default_lights(False)
            scene.add_light_hemisphere(
                "/light/sky", sky_color=light.SKY, ground_color=light.GROUND, intensity=light.SKY_INTENSITY
            )
            scene.add_light_directional("/light/key", intensity=light.KEY_INTENSITY, position=light.KEY_FROM_M)

    def close(self) -> None:
        """Stop it; may be called twice."""
        server, self._server = self._server, None
        self.nodes.clear()
        self._framed.clear()
        self._caps.clear()
        if server is not None:
            with contextlib.redirect_stdout(io.StringIO()):
                server.stop()

    @contextlib.contextmanager
    def batch(self) -> Iterator[None]:
        """What is changed in here arrives together, and at once."""
        server = self.running
        with server.atomic():
            yield
        server.flush()

    # -- nodes

    def add(self, name: str, model: bytes, *, visible: bool = True, solid: bool = False) -> Node:
        """A new node with a model (GLB); a `solid` one looks solid where an inset cuts it open."""
        handle = self.running.scene.add_glb(name, model, cast_shadow=False, receive_shadow=False, visible=visible)
        node = self.nodes[name] = Node(handle, visible=visible, cap=cap(model) if solid else None)
        return node

    def node(self, name: str, make: Callable[..., Mesh], material: Material, *given: Any, solid: bool = False) -> Node:
        """The node of that name, made of `make(*given)` when it is new."""
        return self.nodes.get(name) or self.add(name, glb(make, material, *given), solid=solid)

    def label(self, name: str) -> Node:
        """The label of that name: words that stay the same size on the screen, above where it is put."""
        if name not in self.nodes:
            self.nodes[name] = Node(self.running.scene.add_label(name, "", anchor="bottom-center"))
        return self.nodes[name]

    def remove(self, beginning: str) -> None:
        """Take away all nodes whose names begin like this."""
        for name in [name for name in self.nodes if name.startswith(beginning)]:
            self.nodes.pop(name).handle.remove()
            for caps in self._caps.values():
                if name in caps:
                    caps.pop(name).remove()

    # -- cameras

    def start_at(self, view: CameraView) -> None:
        """Where the cameras of those who come later start."""
        camera = self.running.initial_camera
        if camera.fov != view.fov_rad or tuple(camera.position) != view.position_world_m:
            camera.position = view.position_world_m
            camera.look_at = view.look_at_world_m
            camera.fov = view.fov_rad
            camera.near = view.near_m
            camera.far = view.far_m

    def aim(
        self, view: CameraView, following: FollowingView | None = None, gripper_world_m: Vector3 | None = None
    ) -> None:
        """Point every camera that does not yet show what it should; later clients start at `view` by themselves.

        A browser whose near plane is that of `INSET` is the inset (its page says so, `app/web/scene_proxy.py`): it
        shows `following` at the gripper. Every other shows `view`.
        """
        self.start_at(view)
        clients = self.running.get_clients()
        for kept in (self._framed, self._caps):
            for gone in kept.keys() - clients.keys():
                del kept[gone]
        for number, client in clients.items():
            eye = client.camera
            aspect = eye.image_width / eye.image_height if eye.image_width > 0 and eye.image_height > 0 else None
            if math.isclose(eye.near, INSET.near_m, rel_tol=1e-3):
                if following is not None and gripper_world_m is not None and aspect is not None:
                    self._cap(number, client)
                    self._follow(client, following.at(gripper_world_m, aspect))
                continue
            fov_rad = view.fov_rad if aspect is None else view.vertical_fov_rad(aspect)
            wanted = (view.name, round(fov_rad, 3))
            if self._framed.get(number) == wanted:
                continue
            self._framed[number] = wanted
            _turn(client, view, fov_rad)

    def _cap(self, number: int, client: viser.ClientHandle) -> None:
        """Give an inset the caps it lacks. They hang from the nodes that they fill, and no other browser has them."""
        caps = self._caps.setdefault(number, {})
        for name, node in self.nodes.items():
            if node.cap is not None and name not in caps:
                caps[name] = client.scene.add_glb(f"{name}/cap", node.cap, cast_shadow=False, receive_shadow=False)

    def _follow(self, client: viser.ClientHandle, view: CameraView) -> None:
        """The handle's setters send what differs from what the browser last said, so that an echo that was under way
        while the camera moved is put right with the next slice."""
        eye = client.camera
        if (
            math.dist(eye.position, view.position_world_m) < STILL_M
            and math.dist(eye.look_at, view.look_at_world_m) < STILL_M
            and math.isclose(eye.fov, view.fov_rad, rel_tol=1e-3)
        ):
            return
        _turn(client, view, view.fov_rad)


def _turn(client: viser.ClientHandle, view: CameraView, fov_rad: float) -> None:
    """Point a browser's camera, in one message."""
    eye = client.camera
    with client.atomic():
        eye.up_direction = (0.0, 0.0, 1.0)
        eye.position = view.position_world_m
        eye.look_at = view.look_at_world_m
        eye.fov = fov_rad
    client.flush()
