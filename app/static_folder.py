"""Where the pages' files are: `static/` of a checkout, or beside this file, where a wheel puts them."""

from __future__ import annotations

from pathlib import Path

_HERE = Path(__file__).resolve().parent
STATIC = _HERE / "static" if (_HERE / "static").is_dir() else _HERE.parent / "static"
