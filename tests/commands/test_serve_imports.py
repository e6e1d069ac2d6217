"""What a lab does not load before it is ready: it would be longer in coming, and each would take memory for good."""

from __future__ import annotations

import contextlib
import gc
import subprocess
import sys
from pathlib import Path

from app.processes import without_collections
from tests.support.lab_server import ROOT

NOT_AT_FIRST = {
    *("pybullet", "pybullet_data", "mujoco", "viser", "trimesh"),  # of sessions' processes alone
    *("scipy", "pandas", "pyarrow", "matplotlib", "PIL", "study.analysis", "study.analysis.dataset"),  # of reports
    *("alembic", "rich", "tqdm", "httpx", "app.simulated.participant", "app.replication.replicate"),
    *("sim.bullet", "sim.mujoco", "sim.view.scene", "sim.view.nodes", "app.worker.worker"),
}
PROGRAM = """
import os, sys
from app.__main__ import main
from app.commands import serve

def announce(lab):
    print("LOADED", *sys.modules, flush=True)
    os._exit(0)

serve._announce = announce
main(["serve", "--data", sys.argv[1], "--port", "0", "--robot", "kinematic"])
"""


def test_a_lab_is_ready_without_physics_scene_statistics_or_plotting(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path / "data")], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("LOADED"))
    loaded = set(line.split()[1:])
    assert {"app.lab.lab", "app.web.server", "uvicorn"} <= loaded
    assert not sorted(NOT_AT_FIRST & loaded)


def test_garbage_is_looked_for_again_after_a_start_whatever_came_of_it() -> None:
    with without_collections():
        assert not gc.isenabled()
        with without_collections():
            pass
        assert not gc.isenabled()
    assert gc.isenabled()
    with contextlib.suppress(ZeroDivisionError), without_collections():
        _ = 1 / 0
    assert gc.isenabled()
