"""How the site is built: `make docs` writes it to build/docs, with warnings as errors and nothing from outside."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

project = "Shared Autonomy Lab"
author = "Shared Autonomy Lab contributors"
project_copyright = f"2026 {author}"
language = "en-GB"

extensions = ["myst_parser", "docs.reference"]
myst_heading_anchors = 4

html_theme = "furo"
html_title = project
html_static_path = ["style"]
html_css_files = ["wide.css"]
html_copy_source = False
html_show_sourcelink = False
