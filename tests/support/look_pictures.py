"""The robot's two looks side by side, as a browser draws them; see `tests.support.take_pictures`."""

from __future__ import annotations

import io
import math
from typing import TYPE_CHECKING

from PIL import Image, ImageDraw

from app.contracts.driving import START_JOINTS_RAD
from app.web.scene_proxy import PICTURE_STYLE
from sim import fetch
from sim.interface import ObjectState, WorldState
from sim.layouts import scene
from sim.view.looks import LookName, robot_look
from sim.view.scene import SceneOptions, SceneView
from sim.view.viewpoints import SPECTATOR, VIEWS, CameraView
from tests.support.shipped_world import LAYOUTS, STUDY_OBJECTS

if TYPE_CHECKING:
    from playwright.sync_api import Page

SIZE_PX = (640, 520)
BAND_PX = 30
DRAWN_WITHIN_MS = 30_000

WHOLE = CameraView("whole", "The robot in its place", (1.45, 2.85, 1.75), (0.33, 0.0, 0.68), math.radians(31))
NEAR = CameraView("near", "Arm and gripper", (1.28, -0.72, 1.36), (0.42, 0.0, 0.99), math.radians(38))
HEAD = CameraView("head", "Head", (0.98, 0.62, 1.62), (0.04, 0.0, 1.28), math.radians(34))
BEHIND = CameraView("behind", "From behind", (-2.0, 1.5, 1.7), (0.15, 0.0, 0.66), math.radians(38))
SEEN = {view.name: view for view in (WHOLE, NEAR, HEAD, BEHIND, SPECTATOR, *VIEWS.values())}


def world_at_rest(opening_m: float = fetch.MAX_OPENING_M) -> WorldState:
    """The shipped study's objects where they stand, the arm at its start."""
    items = scene(LAYOUTS["crescent"], list(STUDY_OBJECTS)).objects
    objects = tuple(ObjectState(item.spec.id, item.rest_pose, item.rest_pose.position_world_m, True) for item in items)
    position_m = fetch.link_poses(START_JOINTS_RAD, opening_m)["gripper_link"][0]
    return WorldState(0.0, position_m, tuple(START_JOINTS_RAD), opening_m, "open", None, False, objects)


def drawn(page: Page, name: LookName, view: CameraView) -> Image.Image:
    """One look from one camera."""
    options = SceneOptions(orbit_from=view)
    with SceneView(look=robot_look(name), options=options) as shown:
        port = shown.open()
        shown.show(scene(LAYOUTS["crescent"], list(STUDY_OBJECTS)))
        shown.update(world_at_rest())
        if not view.head:
            for link, node in shown.server.nodes.items():
                if link.startswith("/robot/head_"):
                    node.show(False)
        page.set_viewport_size({"width": SIZE_PX[0], "height": SIZE_PX[1]})
        page.goto(f"http://127.0.0.1:{port}/?fixedDpr=1&hideViserLogo")
        page.add_style_tag(content=PICTURE_STYLE)
        page.locator("canvas").first.wait_for(timeout=DRAWN_WITHIN_MS)
        before, same = b"", 0
        while same < 3:  # until nothing more arrives
            page.wait_for_timeout(400)
            now = page.screenshot()
            same, before = (same + 1 if now == before else 0), now
    return Image.open(io.BytesIO(before)).convert("RGB")


def side_by_side(page: Page, view: CameraView) -> bytes:
    """Both looks from one camera, named, as a PNG."""
    titles: tuple[tuple[LookName, str], ...] = (
        ("own", "the lab's own look"),
        ("published", "the Fetch's published meshes"),
    )
    wide, high = SIZE_PX
    sheet = Image.new("RGB", (2 * wide + 8, high + BAND_PX), (255, 255, 255))
    draw = ImageDraw.Draw(sheet)
    for place, (name, title) in enumerate(titles):
        left = place * (wide + 8)
        sheet.paste(drawn(page, name, view), (left, BAND_PX))
        draw.text((left + 8, 6), title, fill=(20, 24, 30), font_size=17)
    out = io.BytesIO()
    sheet.save(out, "PNG")
    return out.getvalue()
