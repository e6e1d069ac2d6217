"""A layout as a picture: from above with everything to scale, and from where the robot stands, for the heights."""

from __future__ import annotations

import warnings
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Rectangle

from sim import fetch, ik
from sim.interface import BIN_WALL_M, PlacedObject, Rgb
from sim.layouts import BASE_RADIUS_M, OPEN_HALF_M, Layout, layout_problems, scene

MM = 1.0 / 25.4
DPI = 160
GRID_M = 0.005
GROUND, TABLE, REACH, INK, WRONG = "#f2f2f0", "#d9d4ca", "#bfe0cf", "#22282f", "#c22727"


def write_layout_picture(layout: Layout, file: Path) -> None:
    """Draw the layout into a PNG, SVG or PDF file, as its name ends; raises `OSError` or `ValueError` if it cannot.

    Objects stand on the places in their order, as an example: in a study each may stand on any. Places with a problem
    are red.
    """
    with (
        # A label may have dollar signs: none of it is mathematics.
        matplotlib.rc_context(
            {"font.size": 7.0, "svg.hashsalt": "layout", "axes.edgecolor": INK, "text.parse_math": False}
        ),
        warnings.catch_warnings(),
    ):
        warnings.filterwarnings("ignore", message="Glyph")  # a sign that the font lacks is drawn as a box
        figure = Figure(figsize=(150 * MM, 250 * MM), layout="constrained")
        above, ahead = figure.subplots(2, 1, sharex=True, height_ratios=(1.05, 1.0))
        figure.suptitle(f"Layout “{layout.name}”", fontsize=11, fontweight="bold")
        placed = scene(layout, [spec.id for spec in layout.objects[: len(layout.places)]]).objects
        _from_above(above, layout, placed)
        _from_the_robot(ahead, layout, placed)
        dated = {"Date": None} if file.suffix.lower() == ".svg" else None
        figure.savefig(file, dpi=DPI, metadata=dated)


def _from_above(axes: Axes, layout: Layout, placed: tuple[PlacedObject, ...]) -> None:
    """x goes up and y to the left, as one sees it from behind the robot."""
    table = layout.table
    wrong = {place[1] for place in (problem.place for problem in layout_problems(layout)) if place[:1] == ("places",)}
    _box(axes, table.center_world_m[:2], table.size_m[:2], TABLE, zorder=1)
    heights_m = sorted({spec.grasp_height_m for spec in (*layout.objects, layout.practice_object)})
    _reach(axes, [table.top_z_m + height_m for height_m in heights_m])
    axes.add_patch(Circle((0.0, 0.0), BASE_RADIUS_M, color="#8b939c", zorder=2))
    axes.text(0.0, 0.2, "robot", ha="center", va="center", color="white", zorder=3)
    for item in layout.bins:
        outer = [side + 2.0 * BIN_WALL_M for side in item.inner_size_m]
        _box(axes, item.center_xy_m, outer, _hex(item.color_rgb), zorder=3)
        _box(axes, item.center_xy_m, item.inner_size_m, _hex(_darker(item.color_rgb)), zorder=3)
        x_m, y_m = item.center_xy_m
        axes.text(y_m, x_m - 0.05, _text(item.label), ha="center", va="center", color="white", zorder=6)
        axes.plot(item.release_world_m[1], item.release_world_m[0], "x", color="white", zorder=6)
    y_m_of_bins = [item.release_world_m[1] for item in layout.bins]
    axes.plot([min(y_m_of_bins), max(y_m_of_bins)], [layout.aisle_x_m] * 2, "--", color=INK, lw=0.8, zorder=4)
    axes.text(0.2, layout.aisle_x_m - 0.024, "aisle", ha="center", color=INK, zorder=4)
    _gripper(axes, layout)
    x_m, y_m = layout.practice_place
    length_m, width_m, _ = layout.practice_object.size_m
    axes.add_patch(
        Rectangle((y_m - width_m / 2, x_m - length_m / 2), width_m, length_m, fill=False, ls=":", ec=INK, zorder=4)
    )
    axes.text(y_m, x_m, "practice", ha="center", va="center", fontsize=4.5, zorder=6)
    for number, place in enumerate(layout.places):
        color = WRONG if number in wrong else INK
        axes.plot(place[1], place[0], "+", color=color, ms=5, zorder=7)
        axes.text(place[1], place[0] + 0.043, f"{number + 1}", ha="center", color=color, fontweight="bold", zorder=7)
        if number in wrong:
            axes.add_patch(Circle((place[1], place[0]), 0.05, fill=False, ec=WRONG, lw=1.4, zorder=7))
    for standing in placed:
        x_m, y_m, _ = standing.base_world_m
        axes.add_patch(_footprint(standing))
        axes.text(y_m, x_m - 0.048, _text(standing.spec.label), ha="center", va="top", fontsize=6, zorder=7)
    axes.set(xlabel="y, metres, to the robot's left", ylabel="x, metres, ahead of the robot", aspect="equal")
    axes.set_facecolor(GROUND)
    axes.set_ylim(0.1, max(1.0, table.center_world_m[0] + table.size_m[0] / 2 + 0.03))
    axes.invert_xaxis()
    axes.set_title(
        "From above. Green: where the gripper can be at every height it grasps at\n"
        f"({_heights(heights_m)} above the table).\n"
        "Objects stand on the places in their order, as an example: each may stand on any.",
        fontsize=7,
        loc="left",
    )


def _from_the_robot(axes: Axes, layout: Layout, placed: tuple[PlacedObject, ...]) -> None:
    table = layout.table
    y_m, width_m, top_m = table.center_world_m[1], table.size_m[1], table.top_z_m
    axes.add_patch(Rectangle((y_m - width_m / 2, top_m - table.size_m[2]), width_m, table.size_m[2], color=TABLE))
    for item in layout.bins:
        y_m, wide_m = item.center_xy_m[1], item.inner_size_m[1] + 2.0 * BIN_WALL_M
        fill = _hex(item.color_rgb)
        axes.add_patch(Rectangle((y_m - wide_m / 2, 0.0), wide_m, item.height_m, color=fill, alpha=0.85))
        axes.text(y_m, item.height_m / 2, item.letter, color="white", ha="center", va="center", fontsize=12)
        axes.plot(item.release_world_m[1], item.release_world_m[2], "x", color=INK, zorder=5)
        axes.text(item.release_world_m[1], item.release_world_m[2] + 0.03, "release", ha="center", fontsize=6, zorder=5)
    for standing in sorted(placed, key=lambda each: -each.base_world_m[0]):
        _, base_y_m, base_z_m = standing.base_world_m
        _, wide_m, high_m = standing.spec.size_m
        fill = _hex(standing.spec.look.color_rgb)
        axes.add_patch(Rectangle((base_y_m - wide_m / 2, base_z_m), wide_m, high_m, fc=fill, ec=INK, lw=0.6, zorder=3))
        grasp_m = base_z_m + standing.spec.grasp_height_m
        axes.plot([base_y_m - wide_m * 0.75, base_y_m + wide_m * 0.75], [grasp_m] * 2, color=INK, lw=1.2, zorder=4)
    axes.plot(layout.start_world_m[1], layout.start_world_m[2], "o", mfc="none", color=INK)
    axes.set(xlabel="y, metres", ylabel="height, metres", aspect="equal", ylim=(0.0, 1.12))
    axes.set_facecolor(GROUND)
    axes.set_title("From where the robot stands. Lines across objects: where the fingers close. Ring: the start.",
                   fontsize=7, loc="left")  # fmt: skip


def _reach(axes: Axes, heights_z_m: list[float]) -> None:
    low, high = ik.WORKSPACE_LOW_M, ik.WORKSPACE_HIGH_M
    x_m, y_m = np.arange(low[0], high[0] + GRID_M, GRID_M), np.arange(low[1], high[1] + GRID_M, GRID_M)
    xs_m, ys_m = np.meshgrid(x_m, y_m, indexing="ij")
    within = np.ones(xs_m.shape, dtype=bool)
    for z_m in heights_z_m:
        points = np.stack([xs_m, ys_m, np.full_like(xs_m, z_m)], axis=-1).reshape(-1, 3)
        within &= (ik.solve_many(points)[1] == 0).reshape(within.shape)
    axes.contourf(y_m, x_m, within.astype(float), levels=[0.5, 1.5], colors=[REACH], alpha=0.6, zorder=1.5)


def _gripper(axes: Axes, layout: Layout) -> None:
    """The open gripper at the start, seen from above."""
    x_m, y_m, _ = layout.start_world_m
    length_m, width_m, _ = fetch.FINGER_SIZE_M
    for side in (-1, 1):
        _box(
            axes,
            (x_m + fetch.FINGER_CENTER_X_M, y_m + side * (OPEN_HALF_M - width_m / 2)),
            (length_m, width_m),
            "#59626c",
            zorder=5,
        )
    _box(axes, (x_m + fetch.PALM_CENTER_M[0], y_m), fetch.PALM_SIZE_M[:2], "#59626c", zorder=5)
    axes.text(y_m, x_m + fetch.PALM_CENTER_M[0], "start", ha="center", va="center", color="white", zorder=6)


def _footprint(item: PlacedObject) -> Patch:
    x_m, y_m, _ = item.base_world_m
    length_m, width_m, _ = item.spec.size_m
    fill = _hex(item.spec.look.color_rgb)
    if item.spec.shape == "cylinder":
        return Circle((y_m, x_m), length_m / 2, fc=fill, ec=INK, lw=0.6, zorder=6)
    return Rectangle((y_m - width_m / 2, x_m - length_m / 2), width_m, length_m, fc=fill, ec=INK, lw=0.6, zorder=6)


def _box(
    axes: Axes, center_m: tuple[float, ...], size_m: tuple[float, ...] | list[float], color: str, zorder: float
) -> None:
    (x_m, y_m), (length_m, width_m) = center_m, size_m
    axes.add_patch(Rectangle((y_m - width_m / 2, x_m - length_m / 2), width_m, length_m, color=color, zorder=zorder))


def _hex(color: Rgb) -> str:
    return "#" + "".join(f"{channel:02x}" for channel in color)


def _darker(color: Rgb) -> Rgb:
    red, green, blue = (channel * 2 // 3 for channel in color)
    return red, green, blue


def _heights(heights_m: list[float]) -> str:
    return ", ".join(f"{height_m:g}" for height_m in heights_m) + " m"


def _text(label: str) -> str:
    return "".join(sign if sign.isprintable() else " " for sign in label)
