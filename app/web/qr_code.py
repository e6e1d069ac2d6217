"""A link as a QR code."""

from __future__ import annotations

import io

import segno


def qr_svg(link: str) -> bytes:
    """The link as a picture, SVG."""
    picture = io.BytesIO()
    segno.make(link, error="m", micro=False).save(
        picture, kind="svg", scale=8, border=4, dark="#000", light="#fff", xmldecl=False, svgclass=None, lineclass=None
    )
    return picture.getvalue()
