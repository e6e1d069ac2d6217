"""What the pictures show of depth, and what somebody who steers by them alone picks up. See `tests.bench`."""

from __future__ import annotations

from collections.abc import Iterator

from sim.view.viewpoints import DEFAULT_VIEW, INSET, VIEWS, CameraView
from tests.bench.figure import Figure
from tests.simulated.test_seeing_depth import picks_up

SEEDS = range(48)
PAGE, SIDE = (930, 664), (307, 202)
"""Width and height of the picture and of the inset, pixels of a page of 1280 by 720."""
START_M = (0.70, 0.0, 0.88)


def depth_figures() -> Iterator[Figure]:
    """What a centimetre is on the screen, and objects picked up: the same figures on every run."""
    yield Figure("view, pixels a centimetre forward, up", _centimetres(VIEWS[DEFAULT_VIEW], *PAGE))
    yield Figure("inset, pixels a centimetre forward, up", _centimetres(INSET.at(START_M, SIDE[0] / SIDE[1]), *SIDE))
    for inset, what in ((False, "without the inset"), (True, "with the inset")):
        yield Figure(f"of {len(SEEDS)} objects picked up, {what}", str(sum(picks_up(seed, inset) for seed in SEEDS)))


def _centimetres(view: CameraView, width_px: int, height_px: int) -> str:
    x_m, y_m, z_m = START_M
    here, forward, up = (
        view.in_picture(point_m, width_px / height_px)
        for point_m in (START_M, (x_m + 0.01, y_m, z_m), (x_m, y_m, z_m + 0.01))
    )
    lengths_px = [
        ((right - here[0]) ** 2 * width_px**2 + (above - here[1]) ** 2 * height_px**2) ** 0.5 / 2.0
        for right, above in (forward, up)
    ]
    return ", ".join(f"{length_px:.1f}" for length_px in lengths_px)
