"""The lab as a wheel, in an environment of its own and with no checkout on its path."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import httpx
import pytest

from tests.house.test_tree import tree_files
from tests.support import lab_server
from tests.support.study_samples import small_study

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]
IN_THE_WHEEL = ("app", "sim", "study", "static")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `make wheel` puts into `dist/`."""
    out = tmp_path_factory.mktemp("dist")
    run([sys.executable, "-m", "hatchling", "build", "-d", str(out)], ROOT)
    return out


@pytest.fixture(scope="module")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of commands of an environment with the wheel in it. What it depends on is looked up where the tests
    have it: a path file leads there, and those that stand there, of the editable checkout too, are not followed."""
    place = tmp_path_factory.mktemp("environment")
    run([sys.executable, "-m", "venv", "--without-pip", str(place)], place)
    python = place / "bin" / "python"
    ours, theirs = (
        run([str(one), "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], place).strip()
        for one in (python, sys.executable)
    )
    (Path(ours) / "dependencies.pth").write_text(f"{theirs}\n", encoding="utf-8")
    (wheel,) = built.glob("*.whl")
    quiet = ("--quiet", "--no-deps", "--no-index", "--disable-pip-version-check", "--no-warn-script-location")
    run([sys.executable, "-m", "pip", f"--python={python}", "install", *quiet, str(wheel)], place)
    return place / "bin"


def run(command: Sequence[str], folder: Path) -> str:
    """What a program says, which ends well; it knows nothing of the checkout."""
    clean = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(command, cwd=folder, env=clean, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, f"{command}:\n{done.stdout}{done.stderr}"
    return done.stdout


def test_everything_that_the_lab_reads_is_in_it(built: Path) -> None:
    (wheel,), (source,) = built.glob("*.whl"), built.glob("*.tar.gz")
    files = [path.relative_to(ROOT).as_posix() for path in tree_files()]
    wanted = {name for name in files if name.startswith(tuple(f"{top}/" for top in IN_THE_WHEEL))}
    wanted = {name.replace("static/", "app/static/", 1) if name.startswith("static/") else name for name in wanted}
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
        about = {Path(name).name: name for name in archive.namelist() if ".dist-info/" in name}
        assert archive.read(about["LICENSE"]) == (ROOT / "LICENSE").read_bytes()
        assert b"CC BY-NC-SA 4.0" in archive.read(about["licences.md"])
    assert {name for name in wanted if not name.endswith("/README.md")} - packed == set()
    assert {name.partition("/")[0] for name in packed} == {"app", "sim", "study"}
    assert not [name for name in packed if name.endswith((".md", ".pyc"))]
    with tarfile.open(source) as archive_of_source:
        unpacked = {name.partition("/")[2] for name in archive_of_source.getnames()}
    assert set(files) - unpacked == set()


def test_it_is_read_from_nowhere_else(installed: Path, tmp_path: Path) -> None:
    told = "import app, sim, study, app.static_folder as pages; print(app.__file__, pages.STATIC, *sys.path, sep='\\n')"
    lines = run([str(installed / "python"), "-c", f"import sys; {told}"], tmp_path).splitlines()
    assert all(line.startswith(str(installed.parent)) for line in lines[:2])
    assert str(ROOT) not in lines


def test_a_study_is_made_checked_and_simulated(installed: Path, tmp_path: Path) -> None:
    salab = str(installed / "salab")
    run([salab, "new", "my-study"], tmp_path)
    assert "the paper" in (tmp_path / "my-study.toml").read_text(encoding="utf-8")
    (tmp_path / "small.toml").write_text(small_study().source_text, encoding="utf-8")
    assert "small.toml: fine" in run([salab, "check", "small.toml"], tmp_path)
    run([salab, "simulate", "--study", "small.toml", "--participants", "1", "--out", "pilot"], tmp_path)
    assert "as recorded: 1 participants" in run([salab, "verify", "pilot"], tmp_path)


def test_a_lab_serves_its_pages(installed: Path, tmp_path: Path) -> None:
    with (
        lab_server.start(tmp_path / "data", "--no-scene", interpreter=installed / "python", folder=tmp_path) as lab,
        httpx.Client(base_url=lab.base_url, trust_env=False, timeout=60, follow_redirects=True) as client,
    ):
        assert "Shared Autonomy Lab" in client.get("/").text
        for page in (lab.experimenter_link, lab.demo_link):
            assert client.get(page).status_code == 200
        for path in sorted((ROOT / "static").rglob("*.js")):
            name = path.relative_to(ROOT).as_posix()
            assert client.get(f"/{name}").content == path.read_bytes(), name
