"""The running lab: who is enrolled, which sessions are live, and what they live on."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal

from app.clock import SteadyClock
from app.config import LabConfig, Pace
from app.errors import LabError
from app.jobs import eraser
from app.jobs.exporter import Exporter
from app.lab.crowding import Doorkeeper
from app.lab.gauges import gauges
from app.lab.health import ANSWER_WITHIN_S, Health, why_no_room
from app.lab.lapsing import Lapsing
from app.lab.resuming import cycle_under_way, resumed
from app.lab.tokens import check_strength, new_token, same_token, token_hash
from app.limits import Refusals
from app.monitoring.log_lines import about
from app.monitoring.metrics import Gauge, Metrics
from app.report.process import Reporter
from app.session.commands import Command, Remark
from app.session.interfaces import Enrolment, LabServices, Resumed
from app.session.private_text import apart
from app.session.session import LiveSession
from app.sizing import capacity
from app.sizing.machine import machine
from app.trial.guarded_distractor import GuardedDistractor
from app.trial.robots import chosen_robot, look_here, robot_facts, why_no_look
from app.trial.setup import StudySetup, setup_to_end, study_setup
from app.trial.world import open_study, parse_stored
from app.wire import client_message
from app.worker.messages import WorkerReport, WorkerSpec
from app.worker.one_answer import Question, one_answer
from app.worker.probes import prepared_scene, why_no_process
from app.worker.process import WorkerProcess
from app.worker.process_source import process_source
from app.worker.time_limit import TimeLimit
from study.definition.study import Study, plan_session
from study.flow.distractors.interface import Distractor
from study.flow.distractors.state import DistractorState
from study.flow.flow import FLOW, Flow
from study.flow.open_link import ids_among
from study.flow.roster import EnrolmentKind
from study.integrity.signing import key_problem
from study.parts.errors import PartError
from study.records import EventRow, StudyError, utc_text
from study.store import (
    AsyncStore,
    SessionUnreadable,
    Store,
    StoredSession,
    StoreTroubled,
    fingerprint_id,
    machine_fingerprint,
    open_store,
)

log = logging.getLogger(__name__)

PROBE_EVERY_S = 2.0
LOOK_AFTER_EVERY_S = 0.25
"""How often workers are asked for a sign of life."""
NOT_LISTENING_S = 0.5
"""A lab that looks so much later than it meant to has not listened: no worker is blamed for that."""
DESERTED_S = 600.0
"""A session without a page for this long gives its worker back; it comes back with its page."""
CONNECTS_WITHIN_S = 5.0
"""Whoever was let in has connected by then."""
MOST_OF_A_REASON = 300
"""So many characters say why a session cannot be shown."""
ROLES = ("participant", "panel")
_ENDING = ("abort", "withdraw")
"""Commands after which nothing of a session runs any more: they work whatever became of its parts."""


@dataclass(frozen=True)
class Invitation:
    """A new participant and the tokens of their links; the tokens are known only here and now."""

    participant: str
    public_id: str
    participant_token: str
    panel_token: str


class NoSuchParticipant(LabError):
    """An id that belongs to nobody."""


class RecordUnreadable(LabError):
    """What is stored of somebody's session cannot be read."""


class StudyUnreadable(LabError):
    """Somebody was enrolled with a study file that this version of the lab does not take any more."""


class Lab:
    """Owns the store, the source of processes and the live sessions. `open` before use, `close` at the end.

    Attributes:
        config: how the lab runs.
        flow: the pages that participants go through.
        client_message: what a page may say.
        setup: the study that new participants get.
        reporter: makes the report of the data so far.
        exporter: makes the archive of the data that can be downloaded.
        refusals: how often each bound on what a client may cost was reached.
        lapsing: looks after the places of those who closed the tab before they agreed to take part.
        door: counts how many people take part, and how many the lab takes.
        metrics: what is counted and measured.
        health: whether the lab does what it is for.
        base_url: what links begin with; the server sets it when it knows its port.
    """

    def __init__(
        self,
        config: LabConfig,
        experimenter_token: str | None = None,
        now_unix_s: Callable[[], float] = time.time,
        flow: Flow = FLOW,
        metrics_token: str | None = None,
    ) -> None:
        self.config = config
        self.flow = flow
        self.refusals = Refusals()
        self.client_message = client_message(flow)
        self.base_url = config.public_url or ""
        self.experimenter_token = experimenter_token or new_token()
        self.metrics_token = metrics_token
        self.demo_token = new_token()
        self._demo_public_id = secrets.token_hex(8)
        self._demo = asyncio.Lock()
        self._now_unix_s = now_unix_s
        self._store: AsyncStore | None = None
        self._ran_on: dict[str, str] = {}
        self._studies: dict[str, Study] = {}
        self._setups: dict[str, StudySetup] = {}
        self._setup: StudySetup | None = None
        self._live: dict[str, LiveSession] = {}
        self._opening: dict[str, asyncio.Lock] = {}
        self._tasks: tuple[asyncio.Task[None], ...] = ()
        self._later: set[asyncio.Task[None]] = set()
        self._not_shown: dict[str, str] = {}
        self._watchers: list[Callable[[str], None]] = []
        self.robot = chosen_robot(config.robot)
        self._workers = process_source(self.robot.name, config.start_method, scene=config.scene)
        self.metrics = Metrics(self._gauges)
        self.health = Health(
            lambda: self.store.trouble,
            {"workers": lambda: why_no_process(self._workers), "room": lambda: why_no_room(config.data_dir)},
            (lambda: prepared_scene(self._workers, self.setup.study.view)) if config.scene else None,
            ANSWER_WITHIN_S + self._workers.allowance_s,
        )
        self.reporter = Reporter(config.data, lambda: utc_text(now_unix_s()))
        self.exporter = Exporter(config.data, lambda: utc_text(now_unix_s()))
        self.lapsing = Lapsing(self)
        self.door = Doorkeeper(None, lambda: self.live_sessions)

    # ---- life ---------------------------------------------------------------------------------------------------

    def prepare(self) -> None:
        """What can go wrong before anything is served: the study file, the robot, the data folder.

        Raises `StudyError` (of which the errors of study file, parts and store are kinds), or `LabError` for a robot
        that cannot be made, or cannot be drawn as the study says.
        """
        check_strength(self.experimenter_token)
        if self.metrics_token is not None:
            check_strength(self.metrics_token, "the metrics' token")
        study = open_study(self.config.study_file, self.config.trust)
        if self.config.scene and (reason := why_no_look(study.view)):
            raise LabError(reason)
        with ThreadPoolExecutor(1) as beside:
            tried = beside.submit(self._workers.warm_up, self.robot.name)
            self._studies[study.hash] = study
            self._setup = self._setups[study.hash] = study_setup(study, self.config.trust)
            machine = fingerprint_id(machine_fingerprint())
            self._ran_on = {**robot_facts(self.robot.name), "machine": machine}
            tried.result()
        store = open_store(self.config.data, exclusive=True, flow=self.flow)
        try:
            lost = [one for one in store.unreadable_sessions() if one.lacks_page]
        except StudyError:
            store.close()
            raise
        if lost:
            store.close()
            raise StudyError(f"{lost[0].participant}: {lost[0].reason}")
        self._store = AsyncStore(store)
        self.door.most, self.door.note = self._taken_at_once()

    async def open(self) -> None:
        """Start looking after the sessions. Call `prepare` first."""
        self.store.watch()
        await self._discard_made()  # of a lab that was killed
        self._tasks = (
            asyncio.create_task(self._probe_sessions(), name="probe sessions"),
            asyncio.create_task(self._look_after_sessions(), name="look after sessions"),
            asyncio.create_task(self.health.watch(), name="watch health"),
        )
        if reason := key_problem(self.config.data_dir):
            log.warning("who ends gets no certificate: put the key of a backup back", extra=about(reason=reason))
        if self.door.note:
            log.warning("nobody knows how many people this lab takes", extra=about(reason=self.door.note))
        if self.robot.note:
            log.warning("another robot moves than usual", extra=about(reason=self.robot.note))
        known = about(robot=self.robot.name, look=self.look, pace=self.config.pace, scene=self.config.scene)
        log.info("the lab serves", extra=known)
        if self.config.scene and self.setup.study.view.look == "installed":
            log.warning("the study file leaves open how the robot looks", extra=about(look=self.look))

    async def close(self) -> None:
        """End every worker and close the store. Sessions go on where they were when a lab opens again."""
        for task in (*self._tasks, *self._later):
            task.cancel()
        await asyncio.gather(*self._tasks, *self._later, return_exceptions=True)
        await self._discard_made()
        for one in await asyncio.gather(*(live.close() for live in self._live.values()), return_exceptions=True):
            if isinstance(one, Exception):
                log.error("a session could not be closed", exc_info=one)
        self._live.clear()
        if self._store is not None:
            await self._store.close()
        log.info("the lab has ended")

    def _gauges(self) -> Iterator[Gauge]:
        dashboards, crowding = len(self._watchers), self.door.crowding()
        return gauges(self.live_sessions, self.store, self.health, self.flow, dashboards, self.refusals, crowding)

    def _taken_at_once(self) -> tuple[int | None, str]:
        """How many people, and what to say of a measured number that is not used."""
        if self.config.capacity is not None:
            return self.config.capacity or None, ""
        if not capacity.is_kept(self.config.data_dir):
            return None, ""
        found, note = capacity.read(self.config.data_dir, machine(), self.robot.name, self.config.scene)
        return None if found is None else found.sessions, note

    @property
    def store(self) -> AsyncStore:
        """The store; there is one after `prepare`."""
        if self._store is None:
            raise LabError("the lab is not prepared; call prepare() first")
        return self._store

    @property
    def setup(self) -> StudySetup:
        """The study that new participants get."""
        if self._setup is None:
            raise LabError("the lab is not prepared; call prepare() first")
        return self._setup

    @property
    def look(self) -> str:
        """How the robot is drawn for new participants; `none` without a scene."""
        return look_here(self.setup.study.view) if self.config.scene else "none"

    # ---- who may do what ----------------------------------------------------------------------------------------

    def is_experimenter(self, token: str) -> bool:
        """Whether this is the experimenter's token."""
        return same_token(token, self.experimenter_token)

    def reads_metrics(self, token: str) -> bool:
        """Whether this token opens the metrics: the experimenter's, or the one that opens nothing else."""
        is_own = self.metrics_token is not None and same_token(token, self.metrics_token)
        return is_own or self.is_experimenter(token)

    async def holder(self, token: str) -> tuple[StoredSession, Literal["participant", "panel"]] | None:
        """Whose link this token is, and for which page; None if nobody's."""
        digest = token_hash(token)

        def look_up(store: Store) -> tuple[StoredSession, Any] | None:
            found = store.participant_for_token(digest)
            return None if found is None else (store.session(found[0]), found[1])

        try:
            return await self.store.read(look_up)
        except SessionUnreadable as error:
            self.cannot_show(str(error).partition(":")[0], error)
            return None

    async def place(self, token: str) -> tuple[str, Literal["participant", "panel"]] | None:
        """Which pages a link opens, as (public id, role); None if it opens none. Nothing comes to be by asking."""
        if same_token(token, self.demo_token):
            return self._demo_public_id, "participant"
        found = await self.holder(token)
        return None if found is None else (found[0].public_id, found[1])

    async def admit(self, token: str) -> tuple[StoredSession, Literal["participant", "panel"]] | None:
        """As `holder`, for a page that connects: the demo link makes its participant when its page first does.

        What only fetches the link (a mail scanner, a preview) never gets here.
        """
        if same_token(token, self.demo_token):
            async with self._demo:
                if await self.holder(token) is None:
                    tokens = {"participant": token, "panel": new_token()}
                    await self.invite(kind="demo", tokens=tokens, public_id=self._demo_public_id)
        found = await self.holder(token)
        if found is not None and await self.lapsing.give_back(found[0]):
            return await self.holder(token)
        return found

    # ---- participants -------------------------------------------------------------------------------------------

    async def invite(
        self,
        *,
        kind: EnrolmentKind = "study",
        pace: Pace | None = None,
        identities: Mapping[str, str] | None = None,
        tokens: Mapping[str, str] | None = None,
        public_id: str | None = None,
    ) -> Invitation:
        """Enrol someone in the least-filled order. Pilot and demo participants take no cell, no export has them."""
        tokens = tokens or {role: new_token() for role in ROLES}
        study = self.setup.study
        stored = await self.store.run(
            lambda store: store.create_participant(
                study,
                seed=secrets.randbits(48),
                public_id=public_id or secrets.token_hex(8),
                utc=utc_text(self._now_unix_s()),
                tokens={role: token_hash(token) for role, token in tokens.items()},
                kind=kind,
                pace=pace or self.config.pace,
                identities=identities,
            )
        )
        self.changed(stored.participant)
        return Invitation(stored.participant, stored.public_id, tokens["participant"], tokens["panel"])

    def note_identity(self, participant: str, kind: str, value: str) -> None:
        """Keep something that identifies a person, once; it is never exported. Nobody waits for it."""

        def write(store: Store) -> None:
            if (kind, value) not in store.identities(participant):
                store.add_identity(participant, kind, value)

        self.later(self.store.keep(write), "note identity")

    def later(self, work: Coroutine[Any, Any, None], name: str) -> None:
        """Have something done that nobody waits for."""
        task = asyncio.create_task(work, name=name)
        self._later.add(task)
        task.add_done_callback(self._later.discard)

    def link(self, token: str, role: Literal["participant", "panel"] = "participant") -> str:
        """The link that carries a token."""
        return f"{self.base_url}/{'p' if role == 'participant' else 'd'}/{token}"

    def experimenter_link(self) -> str:
        """The dashboard's link. The token stands behind `#`, so that no server or proxy logs it."""
        return f"{self.base_url}/dashboard#token={self.experimenter_token}"

    async def new_links(self, participant: str) -> tuple[str, str]:
        """Other links to the participant's page and to their second device ("" in a study without one), for those that
        were lost. Raises `NoSuchParticipant`."""
        stored = await self.stored_session(participant)
        study = await self.study_of(stored)
        panel = await self._panel_link(participant) if study.distractor.on_second_device else ""
        return self.link(await self.new_token(participant)), panel

    async def new_token(
        self, participant: str, role: Literal["participant", "panel"] = "participant", *, alone: bool = False
    ) -> str:
        """Another key to one of the participant's pages: of those given out before, only hashes are known. `alone`:
        they open nothing any more."""
        token, utc = new_token(), utc_text(self._now_unix_s())
        await self.store.run(lambda store: store.add_token(participant, role, token_hash(token), utc, alone=alone))
        return token

    async def reject(self, participant: str, reason: str, by: str) -> bool:
        """Give the participant's cell out again; False when somebody was quicker. What was recorded stays."""
        data, private = apart("rejected", reason)
        utc = utc_text(self._now_unix_s())
        event = EventRow(participant, None, None, utc, "rejected", "experimenter", json.dumps({"by": by, **data}))

        def write(store: Store) -> bool:
            if not store.reject(participant, event):
                return False
            for name, words in private:
                store.add_identity(participant, name, words)
            return True

        rejected = await self.store.run(write)
        self.changed(participant)
        return rejected

    async def erase(self, participant: str) -> bool | None:
        """End the session if it is live and delete everything about the participant but the mark that there was one.

        Returns `Store.erase`'s word on the space. Raises `NoSuchParticipant`, and `LabError` when nothing was deleted.
        """
        utc = utc_text(self._now_unix_s())
        async with self._opening.setdefault(participant, asyncio.Lock()):
            with contextlib.suppress(RecordUnreadable):  # whoever cannot be read can be erased
                await self.stored_session(participant)
            live = self._live.pop(participant, None)
            if live is not None:
                await live.close()
            await self._discard_made()  # their processes may be reading: the log could not be emptied
            is_clean = await eraser.erase(self.store, self.config.data, participant, utc)
            await self._discard_made()  # of those begun in between
        self.changed(participant)
        return is_clean

    async def _discard_made(self) -> None:
        """End and remove what is made of the data: it may hold what was measured of somebody."""
        await asyncio.gather(self.reporter.discard(), self.exporter.discard())

    async def stored_sessions(self) -> tuple[StoredSession, ...]:
        """Everyone whose session can be read, as stored."""
        return await self.store.read(lambda store: store.sessions())

    def cannot_show(self, participant: str, error: Exception) -> str:
        """Why somebody's session is not shown, for the line that stands for it. Logged when it is new."""
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:MOST_OF_A_REASON]
        if self._not_shown.get(participant) != reason:
            self._not_shown[participant] = reason
            log.warning("a session cannot be shown", extra=about(participant=participant), exc_info=error)
        return reason

    # ---- who looks on -------------------------------------------------------------------------------------------

    def now_unix_s(self) -> float:
        """The time, by the lab's clock."""
        return self._now_unix_s()

    @contextlib.contextmanager
    def watching(self, watcher: Callable[[str], None]) -> Iterator[None]:
        """Have `watcher(participant)` called whenever something about a participant may have changed.

        It must neither block nor raise: it is called in between two pieces of a session's work.
        """
        self._watchers.append(watcher)
        try:
            yield
        finally:
            self._watchers.remove(watcher)

    def changed(self, participant: str) -> None:
        """Tell those who look on."""
        for watcher in tuple(self._watchers):
            try:
                watcher(participant)
            except Exception:  # one that looks on must not end what it looks at
                log.exception("somebody who looks on could not be told")

    # ---- live sessions ------------------------------------------------------------------------------------------

    def live_session(self, participant: str) -> LiveSession | None:
        """The participant's session if it is live."""
        return self._live.get(participant)

    @property
    def live_sessions(self) -> tuple[LiveSession, ...]:
        """All that are live."""
        return tuple(self._live.values())

    async def session(self, stored: StoredSession, to_end: bool = False) -> LiveSession:
        """The participant's live session, brought up where it was left if need be.

        `to_end`: it is brought up to be ended, which takes nothing of what it ran with. Raises `StudyUnreadable`.
        """
        participant = stored.participant
        async with self._opening.setdefault(participant, asyncio.Lock()):
            if participant not in self._live:
                fresh = await self.stored_session(participant)  # it may have been erased meanwhile
                session = await self._bring_up(fresh, to_end or fresh.session.is_over)
                await session.open()
                self._live[participant] = session
                log.info("a session is taken up", extra=about(participant=participant))
                self.changed(participant)
            self._live[participant].expect()
            return self._live[participant]

    async def command(self, participant: str, command: Command, by: str) -> LiveSession:
        """Something an experimenter does with a session.

        Raises `NoSuchParticipant`, and `app.session.commands.NotNow` when the session has moved on.
        """
        session = await self.session(await self.stored_session(participant), command.name in _ENDING)
        await session.command(command, by)
        return session

    async def remark(self, participant: str, remark: Remark, by: str) -> LiveSession:
        """An experimenter's note, mark or message. Raises `NoSuchParticipant` and `app.session.commands.NotNow`."""
        session = await self.session(await self.stored_session(participant))
        await session.remark(remark, by)
        return session

    async def stored_session(self, participant: str) -> StoredSession:
        """One participant, as stored. Raises `NoSuchParticipant`, and `RecordUnreadable` for what cannot be read."""
        try:
            return await self.store.read(lambda store: store.session(participant))
        except StoreTroubled:
            raise
        except SessionUnreadable as error:
            self.cannot_show(participant, error)
            raise RecordUnreadable(f"what is stored of {error}") from None
        except StudyError:
            raise NoSuchParticipant(f"no participant {participant!r}") from None

    async def _bring_up(self, stored: StoredSession, to_end: bool) -> LiveSession:
        study, can_run = await self.study_of(stored), True
        try:
            setup = await self._setup_of(stored)
        except StudyUnreadable:
            if not to_end:
                raise
            setup, can_run = setup_to_end(study), False
        plan = plan_session(study, stored.order, stored.seed)
        pace: Pace = "lockstep" if stored.pace == "lockstep" else "real_time"
        distractor = GuardedDistractor(setup.distractor.inner, TimeLimit)
        where = await self._where(stored, distractor, to_end)
        ids = await self.store.run(lambda store: ids_among(store.identities(stored.participant)))
        enrolment = Enrolment(stored.participant, stored.public_id, plan, pace, stored.demo, ids)
        clock = SteadyClock(self._now_unix_s, not_before_unix_s=where.last_unix_s)
        services = LabServices(
            store=self.store,
            study=study,
            distractor=distractor,
            config=self.config,
            labels=setup.labels(),
            start_worker=self._start_worker,
            make_spec=lambda kind, trial: self._worker_spec(
                enrolment, setup if can_run else None, kind, trial, clock.offset_s
            ),
            trial_row=lambda trial: setup.trial_row(enrolment.participant, plan, trial),
            clock=clock,
            ran_on=self._ran_on,
            changed=self.changed,
            metrics=self.metrics,
            may_begin=lambda: pace == "lockstep" or not self.health.prepares_scene,
            start_allowance_s=self._workers.allowance_s,
            panel_link=lambda: self._panel_link(stored.participant),
            flow=self.flow,
        )
        return LiveSession(enrolment, stored.session, where, services)

    async def _where(self, stored: StoredSession, distractor: Distractor[Any], to_end: bool) -> Resumed:
        """Where a session stood. A record that cannot be read keeps nobody from ending it."""
        try:
            return await self.store.run(lambda store: resumed(store, stored, distractor))
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            reason = self.cannot_show(stored.participant, error)
            if not to_end:
                raise RecordUnreadable(f"what is stored of {stored.participant}: {reason}") from None
            return Resumed(DistractorState(distractor))

    async def study_of(self, stored: StoredSession) -> Study:
        """The study a participant was enrolled in, even when the lab now runs another. Raises `StudyUnreadable`."""
        study_hash = stored.study_hash
        if study_hash not in self._studies:
            text = await self.store.run(lambda store: store.study_text(study_hash))
            try:
                self._studies[study_hash] = parse_stored(text, f"stored study {study_hash[:12]}")
            except StudyError as error:
                problem = str(error).partition("\n")[0]
                raise StudyUnreadable(
                    f"this version of the lab cannot read the study they were enrolled with: {problem}; "
                    "open the data folder with the version that enrolled them"
                ) from None
        return self._studies[study_hash]

    async def _setup_of(self, stored: StoredSession) -> StudySetup:
        """What a participant's study runs with. Raises `StudyUnreadable` when it is not what it was when they were
        enrolled: nobody goes on with another arbiter than they began with."""
        if stored.study_hash not in self._setups:
            study = await self.study_of(stored)
            try:
                made = await asyncio.to_thread(study_setup, study, self.config.trust)
            except PartError as error:
                raise StudyUnreadable(f"{stored.participant} cannot go on: {error}") from None
            self._setups[stored.study_hash] = made
        return self._setups[stored.study_hash]

    async def _panel_link(self, participant: str) -> str:
        """A fresh link for the second device."""
        return self.link(await self.new_token(participant, "panel"), "panel")

    async def _worker_spec(
        self,
        enrolment: Enrolment,
        setup: StudySetup | None,
        kind: Literal["practice", "trial"],
        trial: int,
        clock_offset_s: float,
    ) -> WorkerSpec | None:
        """A worker that takes the phase up where the log ends; None without a set-up."""
        if setup is None:
            return None
        participant = enrolment.participant
        start, past = await self.store.keep(lambda store: cycle_under_way(store, participant, trial, kind))
        return WorkerSpec(
            setup=setup.trial_setup(participant, enrolment.plan, trial, kind),
            start=start,
            log=past,
            robot=self.robot.name,
            pace=enrolment.pace,
            scene=self.config.scene and enrolment.pace == "real_time",
            heartbeat_timeout_s=setup.study.heartbeat_timeout_s,
            view=setup.study.view,
            clock_offset_s=clock_offset_s,
            log_format=self.config.log_format,
        )

    async def _start_worker(
        self, spec: WorkerSpec, on_report: Callable[[WorkerReport], None], on_exit: Callable[[], None]
    ) -> WorkerProcess:
        worker = WorkerProcess(self._workers, spec, on_report, on_exit)
        await worker.start()
        self.metrics.worker_started()
        return worker

    def one_answer(self, question: Question) -> int:
        """What an arbiter that does not ship chooses, asked in a process of its own. Blocks; raises `PartError`."""
        return one_answer(self._workers, question)

    async def _probe_sessions(self) -> None:
        while True:
            await asyncio.sleep(PROBE_EVERY_S)
            for participant, session in tuple(self._live.items()):
                try:
                    if session.connected:
                        session.probe()
                except Exception as error:  # the others are looked after all the same
                    self.cannot_show(participant, error)
            await self.let_go(DESERTED_S)
            try:
                await self.lapsing.look()
            except (StudyError, LabError):
                log.exception("places could not be looked after")

    @contextlib.asynccontextmanager
    async def while_away(self, participant: str) -> AsyncIterator[bool]:
        """Nobody can connect meanwhile, and the session is not live; False, and all stays as it is, where somebody is
        connected or about to be."""
        async with self._opening.setdefault(participant, asyncio.Lock()):
            live = self._live.get(participant)
            if live is not None and not live.deserted(CONNECTS_WITHIN_S):
                yield False
                return
            if live is not None:
                del self._live[participant]
                await live.close()
            yield True

    async def _look_after_sessions(self) -> None:
        """Workers that hang, what went wrong in sessions, and the process that workers come from."""
        tending: asyncio.Future[None] | None = None
        while True:
            due_s = time.monotonic() + LOOK_AFTER_EVERY_S
            await asyncio.sleep(LOOK_AFTER_EVERY_S)
            has_slept = time.monotonic() - due_s > NOT_LISTENING_S
            for participant, session in tuple(self._live.items()):
                try:
                    if has_slept:
                        session.excuse_worker()
                    session.look_after()
                except Exception as error:  # the others are looked after all the same
                    self.cannot_show(participant, error)
            if tending is None or tending.done():
                tending = asyncio.ensure_future(asyncio.to_thread(self._workers.tend))

    async def let_go(self, deserted_s: float) -> None:
        """Close the sessions nobody has been connected to for so long, and with them their workers."""
        for participant, session in tuple(self._live.items()):
            if session.deserted(deserted_s):
                async with self._opening.setdefault(participant, asyncio.Lock()):
                    if session.deserted(deserted_s) and self._live.pop(participant, None) is not None:
                        await session.close()
                        log.info("a session nobody is connected to is put aside", extra=about(participant=participant))


__all__ = ["Invitation", "Lab", "NoSuchParticipant", "RecordUnreadable", "StudyUnreadable"]
