"""Export and erasing in processes of their own: with their progress, cancelled, killed, and out of nobody's way."""

from __future__ import annotations

import asyncio
import io
import os
import shutil
import zipfile
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.errors import LabError
from app.jobs import eraser
from app.jobs.export_job import STEPS, make_archive
from app.jobs.exporter import FOLDER, Exporter
from app.jobs.process import JobLost, run_job
from app.session.commands import NotNow
from study.export.export import export_zip
from study.export.placing import NOTES, PREFIX
from study.store import AsyncStore, Store, StoreError, open_store
from tests.support.analysis_samples import data_set, store_study
from tests.support.lab_server import LabServer
from tests.support.study_samples import UTC
from tests.support.wire_client import asked, invite, visit

ENDED = ("none", "made", "cannot")


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lab's data: two participants who completed everything, and a pilot who did too."""
    folder = tmp_path_factory.mktemp("filled") / "data"
    with open_store(folder) as store:
        store_study(store, data_set(2))
        store_study(store, data_set(1, seed=2), "pilot")
    return folder


@pytest.fixture
def data(filled: Path, tmp_path: Path) -> Path:
    """A copy of them."""
    return Path(shutil.copytree(filled, tmp_path / "data"))


@pytest.fixture
async def store(data: Path) -> AsyncIterator[AsyncStore]:
    opened = AsyncStore(open_store(data))
    yield opened
    await opened.close()


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], None]:
    """Call it with True to have every job's process killed as soon as it is there."""
    really, kills = asyncio.create_subprocess_exec, [False]

    async def made(*arguments: Any, **options: Any) -> asyncio.subprocess.Process:
        process = await really(*arguments, **options)
        if kills[0]:
            process.kill()
        return process

    monkeypatch.setattr(asyncio, "create_subprocess_exec", made)
    return lambda killed: kills.__setitem__(0, killed)


def people(archive: Path | io.BytesIO) -> list[str]:
    """Ids in an archive."""
    with zipfile.ZipFile(archive) as opened:
        return [line.split(",")[0] for line in opened.read("participants.csv").decode().splitlines()[1:]]


def left(data: Path) -> list[str]:
    """What exports have left in a data folder."""
    return [name for name in os.listdir(data) if name.startswith(PREFIX) or name in (NOTES, FOLDER)]


# --- the export --------------------------------------------------------------------------------------------------


def test_the_job_says_how_far_it_is_and_makes_what_the_command_makes(data: Path, tmp_path: Path) -> None:
    said: list[dict[str, Any]] = []
    made = make_archive(data, tmp_path / "a.zip", said.append, excel_safe=True)
    assert list(dict.fromkeys(line["step"] for line in said)) == list(range(1, len(STEPS) + 1))
    assert {line["of"] for line in said} == {len(STEPS)}
    assert any("rows)" in line["text"] for line in said) and said[-1]["text"] == "Writing the archive"
    with open_store(data, must_exist=True) as opened:
        rows = export_zip(opened, tmp_path / "b.zip", excel_safe=True)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    assert made == {"bytes": (tmp_path / "a.zip").stat().st_size, "rows": rows["ticks"]}


async def test_one_archive_at_a_time_and_none_after_it_was_cancelled(data: Path) -> None:
    exporter = Exporter(data, lambda: "now")
    exporter.start()
    with pytest.raises(NotNow, match="being made already"):
        exporter.start()
    await exporter.discard()
    assert exporter.status.state == "none" and left(data) == []
    exporter.start(include_pilot=True)
    status = await exporter.finished()
    assert (status.state, status.made_utc, status.include_pilot) == ("made", "now", True), status
    assert status.bytes == exporter.archive.stat().st_size
    assert people(exporter.archive) == ["P001", "P002", "T003"]
    assert exporter.archive.parent.stat().st_mode & 0o777 == 0o700
    own = [await exporter.fresh() for _ in range(2)]
    assert own[0] != own[1] and people(own[1]) == ["P001", "P002"]
    await exporter.discard()  # as when somebody is erased
    assert left(data) == []


async def test_an_export_that_is_killed_or_breaks_is_told(data: Path, children: Callable[[bool], None]) -> None:
    exporter = Exporter(data, lambda: "now")
    children(True)
    exporter.start()
    status = await exporter.finished()
    assert (status.state, status.text) == ("cannot", "The export's process ended with -9; the lab's console says why.")
    with pytest.raises(LabError, match="process ended with -9"):
        await exporter.fresh()
    children(False)
    exporter.start()  # and another one can be made
    assert (await exporter.finished()).state == "made"
    broken = Exporter(data / "nothing", lambda: "now")
    broken.start()
    status = await broken.finished()
    assert status.state == "cannot" and "no lab data here" in status.text


# --- erasing -----------------------------------------------------------------------------------------------------


async def test_erasing_in_another_process_leaves_the_mark_alone_and_no_trace(data: Path, store: AsyncStore) -> None:
    await store.run(lambda opened: opened.add_identity("P001", "label", "Ada Lovelace"))
    assert await eraser.erase(store, data, "P001", UTC) is True
    assert dict(await store.read(lambda opened: opened.erasures())) == {"P001": UTC}
    with pytest.raises(StoreError):
        await store.read(lambda opened: opened.session("P001"))
    for name in ("lab.sqlite", "lab.sqlite-wal"):
        assert not (data / name).exists() or b"Lovelace" not in (data / name).read_bytes()
    with pytest.raises(LabError, match="P001 is not erased: no participant 'P001'"):
        await eraser.erase(store, data, "P001", UTC)


async def test_erasing_that_is_killed_deletes_nothing_and_says_so(
    data: Path, store: AsyncStore, children: Callable[[bool], None]
) -> None:
    children(True)
    with pytest.raises(LabError, match=r"P001 is not erased: the process ended with -9.*Nothing was deleted"):
        await eraser.erase(store, data, "P001", UTC)
    assert (await store.read(lambda opened: opened.session("P001"))).participant == "P001"
    children(False)
    assert await eraser.erase(store, data, "P001", UTC) is True


async def test_erasing_that_was_done_when_it_was_killed_counts(
    data: Path, store: AsyncStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def killed(module: str, arguments: Any, told: Any, environment: Any) -> dict[str, Any]:
        await run_job(module, arguments, told, environment)
        raise JobLost("process ended with -9")

    monkeypatch.setattr(eraser, "run_job", killed)
    assert await eraser.erase(store, data, "P001", UTC) is False  # nobody knows whether the log was emptied


async def test_what_the_lab_has_asked_to_be_written_before_is_written_first(data: Path, store: AsyncStore) -> None:
    def write(opened: Store) -> None:
        opened.add_identity("P001", "note", "the last word")

    last = asyncio.create_task(store.run(write))
    await asyncio.sleep(0)
    assert await eraser.erase(store, data, "P001", UTC) is True
    await last
    assert await store.read(lambda opened: opened.identities("P001")) == ()


# --- in a running lab --------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_an_archive_is_made_fetched_and_gone_when_somebody_is_erased(
    start_lab: Callable[..., LabServer], data: Path
) -> None:
    (data / f"{PREFIX}killed").mkdir()
    (data / FOLDER).mkdir()
    lab = start_lab("--robot", "kinematic", "--no-scene", data_dir=data)
    assert left(data) == []  # what a lab of before has left
    assert asked(lab, "GET", "export/file").status_code == 409
    assert asked(lab, "POST", "export?include_pilot=true").status_code == 202
    options: dict[str, Any] = {"base_url": lab.base_url, "headers": lab.headers, "trust_env": False}
    async with httpx.AsyncClient(**options, timeout=60.0) as client:  # the work has the lowest priority
        states: list[str] = []
        while not states or states[-1] not in ENDED:
            states.append((await client.get("/api/export/progress")).json()["state"])
        assert states[-1] == "made"
        answer = await client.get("/api/export/file")
        assert answer.headers["content-disposition"] == 'attachment; filename="export.zip"'
        assert people(io.BytesIO(answer.content)) == ["P001", "P002", "T003"]
        at_once = await client.get("/api/export")
        assert people(io.BytesIO(at_once.content)) == ["P001", "P002"]
        erased = await client.post("/api/participants/P002/erase", json={"confirm": "P002"})
        assert erased.json() == {"participant": "P002", "overwritten": True}
        assert left(data) == [] and (await client.get("/api/export/file")).status_code == 409
        await client.post("/api/export")
        assert (await client.delete("/api/export")).json()["state"] == "none"
        assert left(data) == []
        assert people(io.BytesIO((await client.get("/api/export")).content)) == ["P001"]
    who = invite(lab, pace="lockstep")
    async with visit(who["link"]) as player:  # a session that is live ends first
        await player.reach("practice")
        reply = asked(lab, "POST", f"participants/{who['participant']}/erase", {"confirm": who["participant"]})
        assert reply.json()["overwritten"] is True
        await player.ended()
