"""One viser server and the nodes in it: each is made once, and is then only moved, stretched, hidden or renamed.

Measured on viser 1.1.1, hence the rules: one thread writes a server (two inside `atomic()` stop all frames), names are
used again (nodes with ever new names pile up), only changes travel, and each batch is flushed (half the latency).
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import viser

from sim.interface import QuaternionWxyz, SimError, Vector3
from sim.meshes import Material, Mesh, to_glb
from sim.views import CameraView


@lru_cache(maxsize=128)
def glb(make: Callable[..., Mesh], material: Material, *given: Any) -> bytes:
    """`to_glb(make(*given), material)`, made once in a process: a second server shows the same things at once."""
    return to_glb(make(*given), material)


@dataclass
class Node:
    """A handle and what was last sent for it, so that only changes travel."""

    handle: Any
    position: Vector3 = (0.0, 0.0, 0.0)
    wxyz: QuaternionWxyz = (1.0, 0.0, 0.0, 0.0)
    visible: bool = True
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    text: str = ""

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


class NodeServer:
    """A viser server on a free port of 127.0.0.1. All methods belong to one thread; viser's own threads only send."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}
        self._server: viser.ViserServer | None = None
        self._framed: dict[int, tuple[str, float]] = {}

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
        warnings.filterwarnings("ignore", r"Queued a Set\w+ on a closed connection", UserWarning)
        # viser prints a banner with its address, which is nobody's business but the proxy's.
        with contextlib.redirect_stdout(io.StringIO()):
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        scene = self._server.scene
        with self._server.atomic():
            scene.configure_environment_map(None)
            scene.configure_default_lights(False)
            scene.add_light_hemisphere(
                "/light/sky", sky_color=(255, 255, 255), ground_color=(120, 120, 130), intensity=1.7
            )
            scene.add_light_directional("/light/key", intensity=2.3, position=(-1.2, 1.6, 3.0))

    def close(self) -> None:
        """Stop it; may be called twice."""
        server, self._server = self._server, None
        self.nodes.clear()
        self._framed.clear()
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

    def add(self, name: str, model: bytes, *, visible: bool = True) -> Node:
        """A new node with a model (GLB)."""
        handle = self.running.scene.add_glb(name, model, cast_shadow=False, receive_shadow=False, visible=visible)
        node = self.nodes[name] = Node(handle, visible=visible)
        return node

    def node(self, name: str, make: Callable[..., Mesh], material: Material, *given: Any) -> Node:
        """The node of that name, made of `make(*given)` when it is new."""
        return self.nodes.get(name) or self.add(name, glb(make, material, *given))

    def label(self, name: str) -> Node:
        """The label of that name: words that stay the same size on the screen, above where it is put."""
        if name not in self.nodes:
            self.nodes[name] = Node(self.running.scene.add_label(name, "", anchor="bottom-center"))
        return self.nodes[name]

    def remove(self, beginning: str) -> None:
        """Take away all nodes whose names begin like this."""
        for name in [name for name in self.nodes if name.startswith(beginning)]:
            self.nodes.pop(name).handle.remove()

    # -- cameras

    def start_at(self, view: CameraView) -> None:
        """Where the cameras of those who come later start."""
        camera = self.running.initial_camera
        if camera.fov != view.fov_rad or tuple(camera.position) != view.position_world_m:
            camera.position = view.position_world_m
            camera.look_at = view.look_at_world_m
            camera.fov = view.fov_rad
            camera.near = 0.05
            camera.far = 20.0

    def aim(self, view: CameraView) -> None:
        """Point every camera that does not yet show the view; later clients start there by themselves."""
        self.start_at(view)
        clients = self.running.get_clients()
        for gone in self._framed.keys() - clients.keys():
            del self._framed[gone]
        for number, client in clients.items():
            eye = client.camera
            fov_rad = view.fov_rad
            if eye.image_width > 0 and eye.image_height > 0:
                fov_rad = view.vertical_fov_rad(eye.image_width / eye.image_height)
            wanted = (view.name, round(fov_rad, 3))
            if self._framed.get(number) == wanted:
                continue
            self._framed[number] = wanted
            with client.atomic():
                eye.up_direction = (0.0, 0.0, 1.0)
                eye.position = view.position_world_m
                eye.look_at = view.look_at_world_m
                eye.fov = fov_rad
            client.flush()
