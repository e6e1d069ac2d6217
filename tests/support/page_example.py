"""The example of a page of one's own, `docs/examples/08_page`, as those who run it have it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from study.flow.flow import Flow
from tests.support.lab_server import ROOT

FILE = ROOT / "docs" / "examples" / "08_page" / "comfort.py"
PROGRAM = (str(FILE),)
ENVIRONMENT = {"PYTHONPATH": str(ROOT)}


def example_flow() -> Flow:
    """The lab's flow with that page."""
    name = "salab_page_example"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, FILE)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
    flow: Flow = sys.modules[name].MY_FLOW
    return flow


def copied(folder: Path) -> Path:
    """The example's file and its view in another folder."""
    for path in (FILE, FILE.with_suffix(".js")):
        (folder / path.name).write_bytes(path.read_bytes())
    return folder / FILE.name
