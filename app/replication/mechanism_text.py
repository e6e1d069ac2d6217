"""What `salab mechanism` prints and draws."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from html import escape
from pathlib import Path

from app.errors import LabError
from app.replication.formats import columns, percent
from app.replication.mechanism import Mechanism
from app.replication.paper import BALANCED, CONDITIONS_IN_ORDER, DIFFERENCES, reported

_BALANCED = CONDITIONS_IN_ORDER.index(BALANCED)
_PANEL_W, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM, _BETWEEN = 400, 400, 64, 24, 56, 56, 70
_INK, _MARKED, _PAPER = "#1b6ca8", "#d1495b", "#888"


def table(found: Sequence[Mechanism]) -> str:
    """One line a variant, the paper's numbers last."""
    rows = [
        [
            "",
            "information",
            "alpha",
            "by place",
            "reverses",
            "pickup ticks T/G/B",
            "gain /1000",
            f"signs of {len(DIFFERENCES)}",
        ]
    ]
    for one in found:
        rows.append(
            [
                one.name,
                one.information,
                f"{one.alpha:.4g}",
                percent(one.share_by_place),
                percent(one.reversals),
                _three(one.ticks, 1.0, 0),
                _three(one.gains, 1000.0, 1),
                f"{one.signs:.1f}",
            ]
        )
    ticks, gains = reported("efficiency_ticks", "pickup").means, reported("belief_gain", "pickup").means
    paper = [[of[name] for name in CONDITIONS_IN_ORDER] for of in (ticks, gains)]
    rows.append(["paper", "next", "", "", "", _three(paper[0], 1.0, 0), _three(paper[1], 1000.0, 1), ""])
    return columns(rows)


def _three(values: Sequence[float], scale: float, decimals: int) -> str:
    return "/".join("-" if value != value else f"{value * scale:.{decimals}f}" for value in values)


def write(found: Sequence[Mechanism], marked: Collection[str], file: Path) -> None:
    """The trade as a picture. Raises `LabError` when it cannot be written."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(picture(found, marked), encoding="utf-8")
    except OSError as error:
        raise LabError(f"{file}: cannot be written: {error.strerror or error}") from None


def picture(found: Sequence[Mechanism], marked: Collection[str]) -> str:
    """Share by place against agreement with the paper, and against belief gain, as SVG. `marked` variants are drawn in
    another colour, larger."""
    width = 2 * (_LEFT + _PANEL_W) + _BETWEEN + _RIGHT
    gain = reported("belief_gain", "pickup").means[BALANCED] * 1000.0
    most_gain = max([gain, *(one.gains[_BALANCED] * 1000.0 for one in found if one.gains[_BALANCED] > 0.0)])
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {_HEIGHT}" font-family="sans-serif" '
        f'font-size="12"><rect width="{width}" height="{_HEIGHT}" fill="white"/>',
        *_panel(
            0,
            f"Differences with the paper's sign, of {len(DIFFERENCES)}",
            float(len(DIFFERENCES)),
            float(len(DIFFERENCES)),
            [(one, one.signs) for one in found],
            marked,
        ),
        *_panel(
            _LEFT + _PANEL_W + _BETWEEN,
            "Belief gain in balanced pickups, thousandths",
            most_gain * 1.1,
            gain,
            [(one, one.gains[_BALANCED] * 1000.0) for one in found],
            marked,
        ),
    ]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _panel(
    left: float,
    title: str,
    most: float,
    paper: float,
    points: Sequence[tuple[Mechanism, float]],
    marked: Collection[str],
) -> list[str]:
    inner_h, x0 = _HEIGHT - _TOP - _BOTTOM, left + _LEFT

    def y(value: float) -> float:
        return _TOP + inner_h * (1.0 - value / most)

    parts = [f'<text x="{x0}" y="26" font-size="14">{escape(title)}</text>']
    for step in range(6):
        share = step / 5.0
        x, at = x0 + _PANEL_W * share, y(most * share)
        parts.append(
            f'<line x1="{x0}" x2="{x0 + _PANEL_W}" y1="{at:.1f}" y2="{at:.1f}" stroke="#ddd"/>'
            f'<text x="{x0 - 8}" y="{at + 4:.1f}" text-anchor="end">{most * share:.3g}</text>'
            f'<text x="{x:.1f}" y="{_TOP + inner_h + 18}" text-anchor="middle">{share:.0%}</text>'
        )
    parts.append(
        f'<line x1="{x0}" x2="{x0 + _PANEL_W}" y1="{y(paper):.1f}" y2="{y(paper):.1f}" stroke="{_PAPER}" '
        f'stroke-dasharray="5 4"/><text x="{x0 + _PANEL_W}" y="{y(paper) - 5:.1f}" text-anchor="end" fill="{_PAPER}">'
        "paper</text>"
        f'<text x="{x0 + _PANEL_W / 2}" y="{_HEIGHT - 14}" text-anchor="middle">share of information by place</text>'
    )
    taken: list[tuple[float, float]] = []
    for one, value in points:
        if value != value or one.share_by_place != one.share_by_place:
            continue
        x, at = x0 + _PANEL_W * one.share_by_place, y(value)
        parts.append(_mark(one.name, x, at, _free(taken, x, at), x > x0 + 0.6 * _PANEL_W, one.name in marked))
    return parts


def _free(taken: list[tuple[float, float]], x: float, y: float) -> float:
    """A height for a label next to (x, y) on which no other stands."""
    place: Callable[[float], bool] = lambda at: all(abs(at - b) > 13 or abs(x - a) > 130 for a, b in taken)  # noqa: E731
    at = next(at for step in range(40) for at in (y + 7 * step, y - 7 * step) if place(at))
    taken.append((x, at))
    return at


def _mark(name: str, x: float, y: float, label_y: float, to_the_left: bool, is_marked: bool) -> str:
    color, size, weight = (_MARKED, 7, "bold") if is_marked else (_INK, 4.5, "normal")
    side, anchor = (-11, "end") if to_the_left else (11, "start")
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{size}" fill="{color}"/><text x="{x + side:.1f}" y="{label_y + 4:.1f}" '
        f'text-anchor="{anchor}" fill="{color}" font-weight="{weight}">{escape(name)}</text>'
    )
