"""A lab as a user starts it, somebody at the participant's page, somebody at the dashboard: for faults to hit."""

from __future__ import annotations

import asyncio
import contextlib
import csv
import io
import json
import os
import time
import zipfile
from collections import Counter
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import httpx

from app.session.private_text import with_words
from study.store import open_store
from tests.faults import processes
from tests.faults.checker import Evidence
from tests.faults.clock import PROGRAM, FalseClock
from tests.faults.disk import SmallDisk
from tests.faults.experimenter import Experimenter
from tests.faults.person import Person
from tests.faults.proxy import BadNetwork
from tests.faults.row import Setup
from tests.support import lab_server
from tests.support.lab_server import LabDidNotStart, LabServer
from tests.support.wire_client import write_study

TRIAL_WITHIN_S = 60.0
ASKED_WITHIN_S = 60.0
SECOND_DEVICE = {'placement = "same_page_away" ': 'placement = "second_device" ', "first_s = 10.0 ": "first_s = 2.0 "}


class Stage:
    """See the module's text. `spent_s` is how long the fault itself lasted, as whoever did it says; `notes` is what
    else belongs into the report, `problems` what is wrong."""

    def __init__(self, setup: Setup, folder: Path) -> None:
        self.setup = setup
        self.folder = folder
        self.data_dir = folder / "data"
        self.record_dir = self.data_dir
        """Where the record is at the end: elsewhere, when the data folder is gone and what it held was rescued."""
        self.disk = SmallDisk(self.data_dir, setup.disk, setup.disk_mb)
        self.clock = FalseClock(folder / "clock")
        self.network: BadNetwork | None = None
        self.people: list[Person] = []
        self.began_s = 0.0
        self.spent_s = 0.0
        self.notes: list[str] = []
        self.problems: list[str] = []
        self._lab: LabServer | None = None
        self._experimenter: Experimenter | None = None
        self._address = ""

    # ---- the lab ----------------------------------------------------------------------------------------------------

    @property
    def lab(self) -> LabServer:
        """The lab that runs, or ran last."""
        assert self._lab is not None
        return self._lab

    @property
    def pid(self) -> int:
        """Of the web process."""
        return self.lab.process.pid

    @property
    def direct_address(self) -> str:
        """Host and port of the lab itself."""
        return self._address

    @property
    def database(self) -> Path:
        """The file."""
        return self.data_dir / "lab.sqlite"

    async def start(self) -> None:
        """Start the lab, on the port it had before. Raises `LabDidNotStart`."""
        port = self._address.rpartition(":")[2] or "0"
        if self._lab is not None:
            self._lab.close()
        study = self.folder / "study.toml"
        if not study.exists():
            changes = {**self.setup.study, **(SECOND_DEVICE if self.setup.second_device else {})}
            write_study(self.folder, changes)
        false = self.setup.is_clock_false
        environment, program = (self.clock.environment(), PROGRAM) if false else ({}, ("-m", "app"))
        options = (*self.setup.options, "--study", str(study), "--port", port)
        self._lab = await asyncio.to_thread(
            lab_server.start, self.data_dir, *options, environment=environment, program=program
        )
        self._address = urlsplit(self._lab.base_url).netloc
        for person in self.people:
            person.life += 1

    async def start_refused(self) -> str:
        """What the lab says when it must not start; "" when it does."""
        try:
            await self.start()
        except LabDidNotStart as error:
            return str(error)
        return ""

    # ---- people -----------------------------------------------------------------------------------------------------

    @property
    def person(self) -> Person:
        """The one that faults are done to."""
        return self.people[0]

    @property
    def experimenter(self) -> Experimenter:
        """At the dashboard, on the lab's own computer."""
        assert self._experimenter is not None
        return self._experimenter

    async def asked(self, method: str, route: str, body: dict[str, Any] | None = None) -> httpx.Response:
        """The lab's answer to an experimenter's request of `/api/ROUTE`."""
        async with httpx.AsyncClient(trust_env=False, timeout=ASKED_WITHIN_S, headers=self.lab.headers) as client:
            return await client.request(method, f"http://{self._address}/api/{route}", json=body)

    async def invite(self, **body: Any) -> dict[str, Any]:
        """A new participant: id and links."""
        answer = await self.asked("POST", "participants", body)
        assert answer.status_code == 201, answer.text
        made: dict[str, Any] = answer.json()
        return made

    async def arrive(self, *, drives: bool = False) -> Person:
        """Somebody opens a link of their own."""
        made = await self.invite()
        address = self.network.address if self.network is not None else self._address
        person = self._person(made["link"], made["participant"], address, drives)
        self.people.append(person)
        person.begin()
        if self.setup.second_device:
            device = Person(made["panel_link"], f"{made['participant']}-panel", address, role="panel")
            person.second_device = device
            device.begin()
        return person

    def _person(self, link: str, name: str, address: str, drives: bool) -> Person:
        if not self.setup.in_page:
            return Person(link, name, address, drives=drives)
        from tests.faults.page import PagePerson  # playwright takes long to load

        return PagePerson(link, name, address)

    async def open(self) -> None:
        """Lab, network, one participant in their first trial, one dashboard."""
        self.disk.open()
        if self.setup.is_clock_false:
            self.clock.set(0.0)
        await self.start()
        if self.setup.is_network_bad:
            host, _, port = self._address.partition(":")
            self.network = BadNetwork(host, int(port))
            await self.network.open()

    async def begin(self) -> Person:
        """The first participant drives; raises `AssertionError` if they never get that far."""
        person = await self.arrive()
        self._experimenter = Experimenter(self._address, person.name)
        self._experimenter.begin()
        in_trial = await person.until(lambda: len(person.memory.ticks) > 0, TRIAL_WITHIN_S)
        assert in_trial, f"no tick after {TRIAL_WITHIN_S:g} s; the page said {person.sign!r}; {self.lab.log()[-2000:]}"
        return person

    async def begin_driving(self) -> Person:
        """The first of many, who drives a study to its end."""
        return await self.arrive(drives=True)

    async def close(self) -> None:
        """Send everybody home and end the lab."""
        for person in self.people:
            if person.second_device is not None:
                await person.second_device.end()
            await person.end()
        if self._experimenter is not None:
            await self._experimenter.end()
        if self.network is not None:
            await self.network.close()
        if self._lab is not None:
            for pid in [self.pid, *processes.children(self.pid)] if self.lab.process.poll() is None else []:
                processes.go_on(pid)
            await asyncio.to_thread(self._lab.close)
        self.disk.close()

    # ---- what is left -----------------------------------------------------------------------------------------------

    def evidence(self, person: Person, exported: zipfile.ZipFile | None) -> Evidence:
        """What the record and the export hold of somebody."""
        name = person.name
        with open_store(self.record_dir, must_exist=True) as store:
            ticks, events = store.rows_of("ticks", name), store.rows_of("events", name)
            texts = with_words(events, store.identities(name))
            submissions = frozenset(
                identifier
                for identifier in person.remembered().acknowledged
                if store.response(name, identifier) is not None
            )
        words = [data.get("text", "") for row, data in zip(events, texts, strict=True) if row.kind == "step_help"]
        answered = Counter(
            (int(row.trial or 0), int(json.loads(row.data)["alert"])) for row in events if row.kind == "alert_answer"
        )
        return Evidence(
            ticks=tuple(sorted(ticks, key=lambda row: (row.trial, row.tick))),
            events=events,
            submissions=submissions,
            words=tuple(words),
            exported_ticks=None if exported is None else frozenset(
                (int(row["trial"]), int(row["tick"])) for row in _rows(exported, "ticks", name)
            ),
            exported_events=None if exported is None else len(_rows(exported, "events", name)),
            answers=answered,
        )  # fmt: skip

    async def export(self) -> zipfile.ZipFile:
        """The export as the dashboard gives it."""
        answer = await self.asked("GET", "export")
        assert answer.status_code == 200, answer.text[:500]
        return zipfile.ZipFile(io.BytesIO(answer.content))

    def log_bytes(self) -> int:
        """How much the lab has printed."""
        return os.stat(self.lab.log_path).st_size


def _rows(archive: zipfile.ZipFile, table: str, participant: str) -> list[dict[str, str]]:
    (name,) = [name for name in archive.namelist() if name.rpartition("/")[2] == f"{table}.csv"]
    rows = csv.DictReader(io.StringIO(archive.read(name).decode()))
    return [row for row in rows if row["participant"] == participant]


@contextlib.asynccontextmanager
async def staged(setup: Setup, folder: Path) -> AsyncIterator[Stage]:
    """A stage for as long as the block runs."""
    stage = Stage(setup, folder)
    try:
        await stage.open()
        yield stage
    finally:
        await stage.close()


def now_s() -> float:
    """This machine's monotonic time."""
    return time.monotonic()
