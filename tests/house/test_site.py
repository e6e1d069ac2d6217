"""The site, built as `make docs` does: without a warning, and with nothing that a browser would load from elsewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.slow

LOADED_BY = {"link": ("href",), "use": ("href",), "image": ("href",)}
"""What a browser fetches by itself beside `src`, `srcset`, `poster` and `data`; it follows `a` only when asked."""


class Loads(HTMLParser):
    """The addresses that a page makes a browser fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = ("src", "srcset", "poster", "data", *LOADED_BY.get(tag, ()))
        self.found += [value for name, value in attrs if name in names and value]


def loads_from_elsewhere(text: str, is_page: bool) -> list[str]:
    """Addresses on other hosts that a page or a style would load."""
    found = re.findall(r"(?:@import\s+[\"']|url\(\s*[\"']?)([^\"')\s]+)", text)
    if is_page:
        parser = Loads()
        parser.feed(text)
        found += parser.found
    return [address for address in found if re.match(r"(?:[a-z]+:)?//", address)]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site. The arguments are those of the Makefile."""
    (recipe,) = re.findall(r"-m sphinx (.*) docs build/docs$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert {"-W", "-n"} <= set(recipe.split()), "a warning must be an error, and a link that leads nowhere a warning"
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *recipe.split(), "-d", str(out / "read"), "docs", str(out / "html")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return out / "html"


def test_every_page_is_built(site: Path) -> None:
    for page in (ROOT / "docs").rglob("*.md"):
        assert (site / page.relative_to(ROOT / "docs").with_suffix(".html")).is_file(), page


def test_the_reference_is_filled_in(site: Path) -> None:
    for page, word in (
        ("study-file", "rationality_per_m"),
        ("settings", "worker_restarts"),
        ("command-line", "--public-url"),
        ("export-columns", "blocked_reason"),
        ("http-api", "/api/arbiter/evaluate"),
        ("wire-protocol", "alert_closed"),
        ("packages", "app/autonomy"),
    ):
        text = (site / "reference" / f"{page}.html").read_text(encoding="utf-8")
        assert "generated:" not in text
        assert word in text, page


def test_no_page_loads_anything_from_elsewhere(site: Path) -> None:
    paths = [path for path in site.rglob("*") if path.suffix in {".html", ".css", ".svg"}]
    assert len(paths) > 20
    found = [
        f"{path.relative_to(site)}: {address}"
        for path in paths
        for address in loads_from_elsewhere(path.read_text(encoding="utf-8"), path.suffix != ".css")
    ]
    assert not found, "\n" + "\n".join(found)


@pytest.mark.parametrize(
    "text",
    [
        '<script src="https://cdn.example/a.js"></script>',
        '<link rel="stylesheet" href="//fonts.example/a.css">',
        '<img src="http://pictures.example/a.png">',
        "<style>@import url(https://fonts.example/a.css);</style>",
        '<style>@import "//fonts.example/a.css";</style>',
    ],
)
def test_what_loads_from_elsewhere_is_found(text: str) -> None:
    assert loads_from_elsewhere(text, is_page=True)


def test_a_link_to_follow_is_no_loading() -> None:
    assert loads_from_elsewhere('<a href="https://elsewhere.example">there</a><img src="a.png">', is_page=True) == []
