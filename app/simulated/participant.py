"""One simulated participant's whole study, headless: the same protocol, `TrialEngine`, distractor and row types as a
live session, with `app.simulated.driver` at the controls. No file, no clock: time is counted in ticks from a fixed day.

    record = simulate_participant(case)          record["ticks"], record["tasks"], ... as in `study.records.TABLES`
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from app.errors import LabError
from app.simulated.answers import Experience, SimulatedPerson
from app.simulated.driver import Driver
from app.simulated.pilot import Sight
from app.simulated.task_state import tasks_before, ticks_of
from app.simulated.traits import Population, Traits, draw_traits, stream
from app.trial.engine import TrialEngine
from app.trial.setup import StudySetup
from app.trial.values import TickResult, TrialView, UserInput
from sim.interface import TICK_S, Robot, Vector3
from study.definition.study import SessionPlan, TrialPlan, plan_session
from study.flow.distractors.state import DistractorState, of_practice, stimuli_of
from study.flow.flow import FLOW, Flow
from study.flow.page import FlowPage, PageContext, StepContext
from study.flow.protocol import Event, Session
from study.records import SCHEMA_VERSION, TABLES, EventRow, ParticipantRow, utc_text

FIRST_DAY_UNIX_S = 946_684_800.0
"""2000-01-01: nobody will take a simulated time for a real one."""
FORM_S = 30.0
"""How long a form takes, on that clock."""
GIVES_UP_TICKS = 4000
"""Ticks of one trial (33 minutes) after which a simulated participant withdraws."""
FREES_AFTER_TICKS = 40
"""Ticks (20 seconds) of pressing in a row in which the arm did not move, after which the arm is freed."""
ANSWER_SHARE = 0.6
"""Share of the time away after which the answer is typed; the rest is the way back."""

Record = dict[str, list[Any]]


@dataclass(frozen=True)
class Case:
    """Everything one simulated participant depends on. `index` from 0 gives the id and the day."""

    setup: StudySetup
    index: int
    seed: int
    order: tuple[str, ...]
    population: Population = field(default_factory=Population)
    flow: Flow = FLOW

    @property
    def participant(self) -> str:
        """The id, as `S001`."""
        return f"S{self.index + 1:03d}"


def simulate_participant(case: Case, make_robot: Callable[[], Robot]) -> Record:
    """Run the whole study; every row it leaves behind, by table."""
    return _Run(case, make_robot).run()


def simulate_trial(
    case: Case, trial: int, make_robot: Callable[[], Robot], kind: Literal["trial", "practice"] = "trial"
) -> Record:
    """One trial (or practice) alone, with the very rows it has in the whole study."""
    run = _Run(case, make_robot)
    run.session = replace(run.session, state=kind, trial=trial)
    if kind == "trial":
        run.trial()
    else:
        run.practice()
    return run.rows


def simulate_trials(case: Case, make_robot: Callable[[], Robot]) -> Record:
    """All trials and their questionnaires, without forms and practice: for whoever only wants the measures.

    Every stream is its own, so ticks, tasks, readings and answers are those of the whole study; times are not.
    """
    run = _Run(case, make_robot)
    for number in range(1, len(case.order) + 1):
        run.session = replace(run.session, state="trial", trial=number, outcome=None)
        run.trial()
        if run.session.state == "survey":
            run.fill_in(case.flow.page("survey"))
    return run.rows


def person_of(case: Case) -> Traits:
    """Who takes part. A study that is done with a gamepad has nobody at a keyboard."""
    traits = draw_traits(case.population, stream(case.seed, "traits"))
    required = case.setup.study.eligibility.gamepad == "required"
    return replace(traits, device="gamepad") if required else traits


class _Run:
    """The session as it goes. `now_s` counts up from the participant's day."""

    def __init__(self, case: Case, make_robot: Callable[[], Robot]) -> None:
        study = case.setup.study
        self.case = case
        self.make_robot = make_robot
        self.traits = person_of(case)
        self.plan: SessionPlan = plan_session(study, case.order, case.seed)
        self.session: Session = case.flow.new_session(case.participant, len(study.conditions), case.flow.skips(study))
        self.rows: Record = {name: [] for name in TABLES}
        self.now_s = FIRST_DAY_UNIX_S + 86_400.0 * case.index
        self.tick: int | None = None
        self.inputs = 0
        self.felt = Experience(0.0, 0, 0, 0.0)
        self.consent: tuple[str, str] | None = None

    def run(self) -> Record:
        """From consent to thanks."""
        created = self.utc
        driving: Mapping[str, Callable[[], None]] = {"practice": self.practice, "trial": self.trial}
        while not self.session.is_over:
            page = self.case.flow.page(self.session.state)
            if page.state in driving:
                driving[page.state]()
            else:
                self.fill_in(page)
        self.rows["participants"].append(self._participant_row(created))
        return self.rows

    # ---- forms --------------------------------------------------------------------------------------------------

    def fill_in(self, page: FlowPage) -> None:
        """Hand in what the page's script says; a page that asks this person nothing is passed by."""
        study, before = self.case.setup.study, self.session
        person = SimulatedPerson(study, self.traits, self.felt, self._stream_of(page))
        given = page.scripted(page.content(before, PageContext(study)), person) if page.scripted else None
        if given is not None:
            self.form(given.step, given.data)
        elif page.leads_on is not None:
            self.advance(Event(page.leads_on))
        if self.session == before:
            raise LabError(f"page {page.state!r}: what a scripted client hands in leads nowhere")

    def _stream_of(self, page: FlowPage) -> np.random.Generator:
        """A stream for each page and trial, so that one page more changes no other answer."""
        seed, trial = self.case.seed, self.session.trial
        if page.state == "survey":
            return stream(seed, "survey", trial)
        if page.state == "demographics":
            return stream(seed, "forms")
        return stream(seed, "page", trial, zlib.crc32(page.state.encode()))

    def form(self, step: str, data: Mapping[str, Any]) -> None:
        """Submit a step just as a page does; the same checks apply."""
        self.now_s += FORM_S
        condition = self.plan.trial(self.session.trial).condition
        context = StepContext(self.case.setup.study, self.session, condition, self.utc)
        outcome = self.case.flow.steps[step](context, data)
        self.event(f"step_{step}", "participant", dict(outcome.log or {}))
        if outcome.consent_hash:
            self.consent = (self.utc, outcome.consent_hash)
        self.rows["survey_answers"] += outcome.answers
        if outcome.event is not None:
            self.advance(outcome.event)

    # ---- practice and trial -------------------------------------------------------------------------------------

    def practice(self) -> None:
        """Until the practice object has been moved."""
        sitting = _Sitting(self, "practice")
        sitting.run()
        self.rows["practice_ticks"] += sitting.ticks
        self._leave(Event("practice_done"), sitting)

    def trial(self) -> None:
        """Three pickups and dropoffs, the distractor among them."""
        number = self.session.trial
        row = self.case.setup.trial_row(self.case.participant, self.plan, number)
        started_utc = self.utc
        sitting = _Sitting(self, "trial")
        sitting.run()
        self.rows["ticks"] += sitting.ticks
        self.rows["tasks"] += sitting.tasks
        self.rows["alerts"] += sitting.alert_rows()
        outcome: Literal["completed", "aborted"] = "completed" if sitting.finished else "aborted"
        self.rows["trials"].append(
            replace(
                row,
                outcome=outcome,
                ticks=len(sitting.ticks),
                started_utc=started_utc,
                finished_utc=self.utc,
            )
        )
        self.felt = sitting.experience()
        self._leave(Event("trial_done"), sitting)

    def _leave(self, done: Event, sitting: _Sitting) -> None:
        given_up = f"simulated participant gave up after {GIVES_UP_TICKS} ticks"
        self.advance(done if sitting.finished else Event("withdraw", given_up))
        self.tick = None

    # ---- the record ---------------------------------------------------------------------------------------------

    @property
    def utc(self) -> str:
        """The simulated time as text."""
        return utc_text(self.now_s)

    def advance(self, event: Event) -> None:
        """Take an event of the protocol and log it as the lab does."""
        before = self.session
        self.session, _ = self.case.flow.advance(before, event, self.now_s)
        self.event(
            "state",
            "lab",
            {"event": event.name, "from": before.state, "to": self.session.state, "reason": event.reason},
            before,
        )

    def event(self, kind: str, source: str, data: Mapping[str, Any], session: Session | None = None) -> None:
        """One line of the event log."""
        session = session or self.session
        in_trial = session.worker is not None
        self.rows["events"].append(
            EventRow(
                participant=self.case.participant,
                trial=session.trial if in_trial else None,
                tick=self.tick if in_trial else None,
                utc=self.utc,
                kind=kind,
                source=source,
                data=json.dumps(dict(data), default=str),
            )
        )

    def _participant_row(self, created_utc: str) -> ParticipantRow:
        consent_utc, consent_hash = self.consent or (None, None)
        return ParticipantRow(
            participant=self.case.participant,
            seed=self.case.seed,
            condition_order=">".join(self.case.order),
            state=self.session.state,
            study_hash=self.case.setup.study.hash,
            created_utc=created_utc,
            consent_utc=consent_utc,
            consent_hash=consent_hash,
            finished_utc=self.utc,
            schema_version=SCHEMA_VERSION,
            language=self.case.setup.study.language,
        )


@dataclass
class _Errand:
    """What a participant will do about one alert; ticks of the trial, None = never."""

    leave: int | None
    answer: int | None
    away: int
    answer_text: str


@dataclass
class _Sitting:
    """One practice or trial: driver, engine and distractor, tick by tick."""

    run_: _Run
    kind: Literal["practice", "trial"]
    ticks: list[Any] = field(default_factory=list)
    tasks: list[Any] = field(default_factory=list)
    robot_moves: int = 0
    contrary_moves: int = 0
    pressed_in_vain: int = 0
    finished: bool = False
    view: TrialView = field(init=False)
    """The trial as it is before the next tick."""

    def __post_init__(self) -> None:
        run, trial = self.run_, self.run_.session.trial
        setup = run.case.setup
        self.plan: TrialPlan = run.plan.trial(trial)
        self.trial_setup = setup.trial_setup(run.case.participant, run.plan, trial, self.kind)
        self.driver = Driver(
            run.traits,
            stream(run.case.seed, self.kind, trial),
            self.trial_setup.timing.speed_m_s * TICK_S,
            setup.layout.aisle_x_m,
            tasks_before(run.case.setup.study.tasks_per_trial, trial, self.kind == "practice"),
        )
        self.distractor = (
            of_practice(setup.distractor, setup.study) if self.kind == "practice" else DistractorState(setup.distractor)
        )
        self.errands: dict[int, dict[int, _Errand]] = {}
        """By the tick in which something is to be done about them, and by their alerts."""

    def run(self) -> None:
        """Every tick, until it is over or the participant gives up."""
        robot = self.run_.make_robot()
        try:
            engine = TrialEngine(self.trial_setup, robot)
            engine.open()
            self.view = engine.view()
            while not engine.finished and engine.next_tick < GIVES_UP_TICKS:
                self._tick(engine)
            self.finished = engine.finished
        finally:
            robot.close()
        if self.kind == "trial":
            self.distractor, _ = self.distractor.close()

    def _tick(self, engine: TrialEngine) -> None:
        run, tick, view = self.run_, engine.next_tick, self.view
        self._attend(tick)
        sight = _sight(engine, view)
        wanted = self.driver.act(view.object, sight)
        run.inputs += 1
        if view.phase != "operating" or self.distractor.locked(tick * TICK_S):
            result = engine.tick(UserInput(seq=run.inputs))
        else:
            free = self.pressed_in_vain >= FREES_AFTER_TICKS
            if free:
                run.event("step_free_arm", "participant", {})
            result = engine.tick(UserInput(wanted.direction, wanted.gripper, run.inputs, free=free))
        row = result.row
        self.pressed_in_vain = self.pressed_in_vain + 1 if row.user_x is not None and row.blocked else 0
        self.view = result.view
        run.tick, run.now_s = tick, run.now_s + TICK_S
        self.ticks.append(row)
        if self.kind == "trial" and result.tasks:
            ended = {task.task for task in result.tasks}  # of a task that is done again, the last row counts
            self.tasks = [*(task for task in self.tasks if task.task not in ended), *result.tasks]
        for item in result.events:
            run.event(item.kind, "participant" if item.kind == "arm_freed" else "robot", item.data)
        self._judge(result, sight, engine.world.position_world_gripper_m)
        self._raise_alerts(tick + 1)

    # ---- the distractor -----------------------------------------------------------------------------------------

    def _raise_alerts(self, tick: int) -> None:
        """New alerts, and what this person will do about them."""
        run, seed, trial = self.run_, self.plan.seed, self._stimuli
        kind = self.distractor.distractor
        if tick * TICK_S < self.distractor.next_change_s:
            return
        self.distractor, changed = self.distractor.advance(
            tick * TICK_S, lambda number: kind.stimulus(seed, trial, number)
        )
        for alert in changed:
            if alert.status == "open":
                self.distractor = self.distractor.shown(alert.alert, run.utc).heard(alert.alert, run.utc)
                errand = self._plan_errand(alert.alert, tick)
                for due in (errand.leave, errand.answer):
                    if due is not None:
                        self.errands.setdefault(due, {})[alert.alert] = errand

    @property
    def _stimuli(self) -> int:
        """What the stimuli, and what this person makes of them, are drawn with."""
        return stimuli_of(self.plan.trial, self.kind == "practice")

    def _plan_errand(self, number: int, tick: int) -> _Errand:
        traits = self.run_.traits
        rng = stream(self.run_.case.seed, "alerts", self._stimuli, number)
        reaction_s, away_s, return_s = (
            mean_s * math.exp(0.2 * rng.standard_normal() - 0.02)
            for mean_s in (traits.reaction_s, traits.away_s, traits.return_s)
        )
        if rng.random() < traits.miss:
            return _Errand(None, None, 0, "")
        stimuli = self.distractor.stimuli(number)
        answer = self.distractor.distractor.simulated_answer(stimuli, traits.typing_error, rng)
        leave = tick + ticks_of(reaction_s)
        return _Errand(leave, leave + ticks_of(ANSWER_SHARE * away_s), ticks_of(away_s + return_s), answer)

    def _attend(self, tick: int) -> None:
        """Hands off, or an answer given, when its tick has come."""
        run = self.run_
        for number, errand in self.errands.pop(tick, {}).items():
            if errand.leave == tick:
                self.driver.leave(errand.away)
            if errand.answer == tick:
                self.distractor, result = self.distractor.answer(number, errand.answer_text, tick * TICK_S, run.utc)
                data = {"alert": number, "result": result, "value": errand.answer_text}
                run.event("alert_answer", "participant", data)

    def alert_rows(self) -> list[Any]:
        """The alerts' rows."""
        case, plan = self.run_.case, self.plan
        return [
            self.distractor.row(alert, case.participant, plan.condition, plan.trial) for alert in self.distractor.alerts
        ]

    # ---- what it was like ---------------------------------------------------------------------------------------

    def _judge(self, result: TickResult, sight: Sight, after_m: Vector3) -> None:
        goal_m = sight.object_m if result.row.kind == "pickup" else sight.release_m
        if result.row.source == "robot" and goal_m is not None and after_m != sight.position_m:
            self.robot_moves += 1
            self.contrary_moves += math.dist(after_m, goal_m) > math.dist(sight.position_m, goal_m)

    def experience(self) -> Experience:
        """The trial as the participant will rate it."""
        alerts = self.distractor.alerts
        return Experience(
            minutes=len(self.ticks) * TICK_S / 60.0,
            failures=sum(1 for task in self.tasks if task.outcome == "failure"),
            missed=sum(1 for alert in alerts if alert.status == "expired" or alert.correct is False),
            contrary=self.contrary_moves / self.robot_moves if self.robot_moves else 0.0,
        )


def _sight(engine: TrialEngine, view: TrialView) -> Sight:
    """What a person sees before a tick."""
    world = engine.world
    return Sight(
        position_m=world.position_world_gripper_m,
        held=world.held,
        gripper=world.gripper,
        object_m=world.object(view.object).grasp_world_m,
        release_m=engine.scene.bin(view.bin).release_world_m if view.bin else None,
    )
