"""When a worker is taken to hang: by a clock that only goes forward, by what it sends, never for what a lab does."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from app.clock import SteadyClock
from app.processes import VitalSigns
from app.session.interfaces import LabServices
from app.session.worker_link import LOCKSTEP, READY, STARTING, STOPPED_S, Patience, WorkerLink
from app.worker.messages import Alive, Asking, Begin, Free, Hold, PartFailed, SetView, WorkerCommand, WorkerReport


class Machine:
    """Its clocks, and the one worker that it runs."""

    def __init__(self) -> None:
        self.wall_unix_s, self.monotonic_s = 1_700_000_000.0, 5.0
        self.clock = SteadyClock(lambda: self.wall_unix_s, lambda: self.monotonic_s)
        self.killed, self.start_allowance_s, self.is_prepared = 0, 0.0, True
        self.metrics = SimpleNamespace(worker_lost=lambda: None)
        self.signs: VitalSigns | None = VitalSigns(stopped=False, cpu_s=0.0)
        self.told: list[WorkerCommand] = []
        self.reports: list[WorkerReport] = []
        self.link = WorkerLink(
            cast(LabServices, self), "P001", lambda epoch, report: self.reports.append(report), lambda epoch: None
        )

    def now_unix_s(self) -> float:
        return self.clock.now_unix_s()

    def may_begin(self) -> bool:
        return self.is_prepared

    async def make_spec(self, kind: str, trial: int) -> Any:
        return type("Spec", (), {"setup": None})

    async def start_worker(self, spec: Any, on_report: Any, on_exit: Any) -> Machine:
        self.says = on_report
        return self

    def send(self, command: WorkerCommand) -> None:
        self.told.append(command)

    async def stop(self) -> None:
        """It ends."""

    def kill(self) -> None:
        self.killed += 1

    def vital_signs(self) -> VitalSigns | None:
        return self.signs

    def passes(self, seconds: float) -> None:
        self.monotonic_s += seconds
        self.wall_unix_s += seconds


@pytest.fixture
async def machine() -> Machine:
    made = Machine()
    await made.link.start("trial", 1)
    return made


PLACES = [(True, False, READY), (True, True, LOCKSTEP), (False, False, STARTING), (False, True, STARTING)]


@pytest.mark.parametrize(("ready", "in_lockstep", "patience"), PLACES)
def test_one_that_says_nothing_hangs_ready_or_not_in_real_time_and_in_lockstep(
    machine: Machine, ready: bool, in_lockstep: bool, patience: Patience
) -> None:
    machine.link.ready = ready
    for _ in range(2):
        machine.passes(patience.idle_s - 0.1)
        assert machine.link.end_if_hung(in_lockstep) is None and machine.killed == 0
        machine.says(Alive())
    machine.passes(patience.idle_s + 0.1)
    machine.link.end_if_hung(in_lockstep)
    assert machine.killed == 1
    machine.passes(0.2)
    machine.link.end_if_hung(in_lockstep)
    assert machine.killed == 1, "its exit is on the way"
    assert machine.reports == [], "a sign of life is nothing to be dealt with"


@pytest.mark.parametrize(("ready", "in_lockstep", "patience"), PLACES)
@pytest.mark.parametrize("is_told", [True, False])
def test_one_that_works_is_given_longer_and_not_for_ever(
    machine: Machine, ready: bool, in_lockstep: bool, patience: Patience, is_told: bool
) -> None:
    """As it is where the machine tells nothing of its processes."""
    machine.link.ready = ready
    waited_s = 0.0
    while not machine.killed:
        machine.passes(0.25)
        waited_s += 0.25
        machine.signs = VitalSigns(stopped=False, cpu_s=waited_s) if is_told else None
        machine.link.end_if_hung(in_lockstep)
    assert waited_s == pytest.approx(patience.busy_s, abs=0.3)


def test_none_is_started_while_what_all_need_is_being_made_ready() -> None:
    machine = Machine()
    machine.is_prepared = False
    assert not machine.link.may_start
    machine.is_prepared = True
    assert machine.link.may_start


def test_one_that_makes_its_imports_itself_has_longer_to_its_first_word_and_not_after_it(machine: Machine) -> None:
    machine.start_allowance_s = 30.0
    machine.passes(30.0 + STARTING.idle_s - 0.1)
    machine.link.end_if_hung(in_lockstep=False)
    assert machine.killed == 0
    machine.says(Alive())
    machine.passes(STARTING.idle_s + 0.1)
    machine.link.end_if_hung(in_lockstep=False)
    assert machine.killed == 1


def test_one_that_was_stopped_before_it_was_ready_has_not_the_time_of_a_start(machine: Machine) -> None:
    machine.signs = VitalSigns(stopped=True, cpu_s=0.5)
    machine.link.end_if_hung(in_lockstep=False)
    machine.passes(STOPPED_S + 0.1)
    machine.link.end_if_hung(in_lockstep=False)
    assert machine.killed == 1


def test_the_computers_clock_makes_nobody_hang(machine: Machine) -> None:
    machine.link.ready = True
    for by_s in (3600.0, -7200.0):
        machine.wall_unix_s += by_s
        machine.link.end_if_hung(in_lockstep=False)
        machine.passes(READY.idle_s / 2)
        machine.says(Alive())
    assert machine.killed == 0


def test_what_the_lab_has_not_dealt_with_was_said_all_the_same(machine: Machine) -> None:
    """A slow database holds up the session's queue, in which reports wait."""
    machine.link.ready = True
    for _ in range(10):
        machine.passes(READY.idle_s / 2)
        machine.says(cast(WorkerReport, "a tick"))
        machine.link.end_if_hung(in_lockstep=False)
    assert machine.killed == 0
    assert len(machine.reports) == 10


def test_a_lab_that_did_not_listen_blames_nobody(machine: Machine) -> None:
    machine.link.ready = True
    machine.passes(60.0)
    machine.link.excuse()
    machine.link.end_if_hung(in_lockstep=False)
    assert machine.killed == 0


def test_one_that_asks_a_part_has_the_time_of_that_part(machine: Machine) -> None:
    machine.link.ready = True
    machine.says(Asking("arbiter 'own'", 5.0))
    machine.passes(4.9)
    assert machine.link.end_if_hung(in_lockstep=False) is None
    machine.passes(0.2)
    hangs = machine.link.end_if_hung(in_lockstep=False)
    assert hangs == PartFailed("arbiter 'own'", "gave no answer for 5 s and was ended")
    assert machine.killed == 1


async def test_another_worker_is_told_again_what_it_is_to_do(machine: Machine) -> None:
    link = machine.link

    def say() -> None:
        link.ticks(True)
        link.free(True)
        link.view("top")

    say()
    assert machine.told == [], "it is not ready"
    link.ready = True
    say()
    say()
    assert machine.told == [Begin(), Free(), SetView("top")]
    link.ticks(False)
    assert machine.told[3:] == [Hold()]
    link.lost()
    await link.start("trial", 1)
    link.ready = True
    say()
    assert machine.told[4:] == [Begin(), Free(), SetView("top")]


def test_one_that_could_not_be_started_is_tried_again_later_and_later(machine: Machine) -> None:
    waits_s: list[float] = []
    for _ in range(5):
        failing_s = machine.link.could_not_start("no memory")
        assert failing_s == pytest.approx(sum(waits_s), abs=0.5)
        waited_s = 0.0
        while not machine.link.may_start:
            machine.passes(0.1)
            waited_s += 0.1
        waits_s.append(round(waited_s, 1))
    assert waits_s == [0.1, 0.5, 1.0, 2.0, 2.0]
    machine.link.could_not_start("no memory")
    machine.link.anew()  # somebody lets the session go on
    assert machine.link.may_start
