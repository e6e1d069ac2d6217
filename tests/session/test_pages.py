"""What the participant's page receives: the right words, and never what it must not know."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Literal

import pytest

from app.session.pages import FAILURES, VIEWS, instruction, notice, page, tick_message
from app.trial.values import EngineEvent, TickResult, TimeLimits, TrialView, UserInput
from app.trial.verdicts import Verdict
from app.wire import SERVER_MESSAGE, Instruction, Message, Page, Tick
from sim.view import viewpoints
from study.definition.builtin_questionnaires import INSTRUMENTS
from study.definition.study import Study
from study.flow.facts import as_read
from study.flow.flow import FLOW
from study.flow.page import PageContext
from study.flow.protocol import Cause, Event, EventName, Outcome, Session, State
from tests.support.arbiter_cases import CONDITIONS
from tests.support.engine_cases import Person, drive, opened, paper_study, practice_setup, push, run, trial_setup
from tests.support.study_samples import shipped_study

STUDY = shipped_study()
LABELS = paper_study().labels()
SECRET = re.compile(
    r"condition|teleoperation|goal_oriented|balanced|belief|entropy|arbiter|score|alpha|posterior|correct|reversed",
    re.IGNORECASE,
)
"""Words that would tell the page how the robot decides, or the right answers."""
AGAIN = "The arm is free again, and the object stands where it stood. Please pick it up once more."
OVER = "The time for the spray bottle is over. It goes on from here by itself."


def context(study: Study = STUDY, shown: Instruction | None = None) -> PageContext:
    task = shown.model_dump() if shown else None
    link = "http://127.0.0.1/d/token"
    return PageContext(study, "/s/abc/scene/", link, task, worker_ready=True, views=VIEWS)


LEADS_ON: dict[str, EventName] = {
    "eligibility": "eligible",
    "consent": "consent_given",
    "demographics": "demographics_done",
    "setup": "setup_done",
    "instructions": "instructions_done",
    "practice_ready": "start",
    "practice": "practice_done",
    "trial_ready": "start",
    "trial": "trial_done",
    "survey": "survey_done",
    "break": "continue",
    "debrief": "debrief_done",
}


def every_session() -> list[Session]:
    """Every state of a whole study of three trials, paused by each cause wherever that can be, and every end."""
    session, found = FLOW.new_session("p01", 3), []
    while True:
        found.append(session)
        if session.is_over:
            return found
        pauses: list[tuple[EventName, ...]] = [("experimenter_pause",), ("connection_lost",)]
        pauses.append(("connection_lost", "experimenter_pause"))
        for events in pauses:
            other = session
            for name in events:
                other, _ = FLOW.advance(other, name, 0.0)
            found.append(other)
        found += [FLOW.advance(session, Event(name, "a reason"), 0.0)[0] for name in ("withdraw", "abort")]
        if session.state == "eligibility":
            found.append(FLOW.advance(session, Event("screened_out", '["webgl"]'), 0.0)[0])
            found.append(FLOW.advance(session, Event("place_lapsed", "no page for 30 min"), 0.0)[0])
        session, _ = FLOW.advance(session, LEADS_ON[session.state], 0.0)


def secrets_in(message: Message) -> list[str]:
    return sorted({found.group(0) for found in SECRET.finditer(message.model_dump_json())})


# ---- pages ----------------------------------------------------------------------------------------------------------


def test_no_page_of_the_whole_protocol_tells_condition_belief_or_score() -> None:
    sessions = every_session()
    assert {session.state for session in sessions} == set(FLOW.states)
    for session in sessions:
        made = page(session, context())
        assert secrets_in(made) == [], (session.state, made)
        sent = made.model_dump_json()
        assert SERVER_MESSAGE.validate_json(sent).model_dump_json() == sent


def test_the_search_for_secrets_finds_them() -> None:
    assert secrets_in(Page(state="trial", trial=1, trials=3, content={"condition": "x"})) == ["condition"]


def test_a_trial_looks_the_same_whatever_drives_the_robot() -> None:
    """The page is made from the study and the session alone; neither holds which condition comes when."""
    fields = set(Session.__dataclass_fields__)
    assert not {name for name in fields if SECRET.search(name)}
    assert len({repr(page(Session("p01", 3, "trial", trial), context()).content) for trial in (1, 2, 3)}) == 1


@pytest.mark.parametrize(
    ("state", "trial"),
    [("consent", None), ("trial", 2), ("survey", 2), ("break", 2), ("debrief", None), ("done", None)],
)
def test_a_page_names_its_trial_where_there_is_one(state: State, trial: int | None) -> None:
    outcome: Outcome | None = "done" if state == "done" else None
    made = page(Session("p01", 3, state, trial=2, outcome=outcome), context())
    assert (made.state, made.trial, made.trials) == (state, trial, 3)


def test_forms_hold_what_has_to_be_filled_in() -> None:
    pages = {session.state: page(session, context()).content for session in every_session()}
    assert pages["consent"]["hash"] == as_read(STUDY).consent.hash
    assert pages["consent"]["text"] == list(as_read(STUDY).consent.text)
    assert [item["id"] for item in pages["demographics"]["items"]] == [item.id for item in STUDY.demographics]
    assert [set(question) for question in pages["instructions"]["questions"]] == [{"id", "prompt", "options"}] * 3
    items = {form["id"]: form["items"] for form in pages["survey"]["instruments"]}
    assert {name: len(own) for name, own in items.items()} == {"sus_modified": 10, "tlx_raw": 6}
    assert all(set(item) == {"id", "text", "low", "high"} for own in items.values() for item in own)
    assert [form["source"] for form in pages["survey"]["instruments"]] == [INSTRUMENTS[n].source for n in items]
    assert [question["id"] for question in pages["debrief"]["questions"]] == ["comments", "problems"]


def test_the_break_names_the_round_that_comes_next() -> None:
    assert page(Session("p01", 3, "break", trial=1), context()).content["next_trial"] == 2


def test_the_driving_page_knows_the_scene_the_views_and_whether_ticks_run() -> None:
    running = page(Session("p01", 3, "trial", trial=1), context()).content
    waiting = page(Session("p01", 3, "practice_ready", trial=1), context()).content
    assert (running["scene"], running["running"], running["tasks"]) == ("/s/abc/scene/", True, 6)
    assert (waiting["running"], waiting["tasks"], waiting["instruction"]) == (False, 2, None)
    assert [view["name"] for view in running["views"]] == [name for name, _ in VIEWS]
    assert running["away_min_s"] == STUDY.distractor.away_min_s
    assert running["inset"] is True


@pytest.mark.parametrize(
    ("causes", "can_resume", "word"),
    [
        ({"connection"}, True, "connection"),
        ({"experimenter"}, False, "experimenter"),
        ({"connection", "experimenter"}, True, "experimenter"),
    ],
)
def test_a_pause_says_why_and_whether_the_participant_can_end_it(
    causes: set[Cause], can_resume: bool, word: str
) -> None:
    session = Session("p01", 3, "paused", 1, "trial", frozenset(causes))
    content = page(session, context()).content
    assert content["causes"] == sorted(causes)
    assert content["can_resume"] is can_resume
    assert content["can_free"] is True
    assert word in content["text"]
    assert content["running"] is False and content["scene"]


def test_in_a_pause_before_a_start_no_arm_can_be_freed() -> None:
    session = Session("p01", 3, "paused", 1, "trial_ready", frozenset({"experimenter"}))
    assert page(session, context()).content["can_free"] is False


def test_a_pause_without_a_robot_shows_no_scene() -> None:
    session = Session("p01", 3, "paused", 1, "survey", frozenset({"experimenter"}))
    assert "scene" not in page(session, context()).content


def test_a_link_to_the_second_device_is_offered_only_when_the_readings_are_there() -> None:
    def content(**changes: object) -> dict[str, object]:
        distractor = STUDY.distractor.model_copy(update=changes)
        study = STUDY.model_copy(update={"distractor": distractor})
        return page(Session("p01", 3, "setup"), context(study)).content

    assert content(placement="second_device")["panel_link"] == "http://127.0.0.1/d/token"
    assert content(placement="same_page_away")["panel_link"] is None
    assert content(enabled=False)["placement"] == "none"


def test_thanks_end_every_participation() -> None:
    ends: tuple[tuple[State, Outcome], ...] = (
        ("done", "done"),
        ("withdrawn", "withdrawn"),
        ("aborted", "aborted"),
        ("screened_out", "screened_out"),
    )
    for state, outcome in ends:
        session = Session("p01", 3, state, outcome=outcome)
        assert "hank" in " ".join(page(session, context()).content["text"])


def test_only_a_finished_session_leads_back_to_the_recruitment_service() -> None:
    links = {"completion_link": "http://127.0.0.1/back?of={ID}", "screened_out_link": "http://127.0.0.1/out"}
    study = STUDY.model_copy(update={"recruitment": STUDY.recruitment.model_copy(update=links)})

    def link(state: State, study: Study, **ids: str) -> str | None:
        shown = replace(context(study), ids=ids)
        leads_to: str | None = page(Session("p01", 3, state), shown).content["completion_link"]
        return leads_to

    assert link("done", study, ID="7a") == "http://127.0.0.1/back?of=7a"
    assert link("done", study) is None  # somebody with a personal link has no id to send back
    assert link("screened_out", study) == "http://127.0.0.1/out"
    assert [link(state, study, ID="7a") for state in ("withdrawn", "aborted")] == [None, None]
    assert link("done", STUDY, ID="7a") is None


def test_the_views_are_those_of_the_scene() -> None:
    assert dict(VIEWS) == {name: view.label for name, view in viewpoints.VIEWS.items()}
    assert VIEWS[0][0] == viewpoints.DEFAULT_VIEW  # what the page marks as chosen is what the scene shows


# ---- ticks and instructions -----------------------------------------------------------------------------------------


def messages(results: list[TickResult], practice: bool = False, show_assistance: bool = False) -> list[Tick]:
    """What the page is sent, one after another."""
    made: list[Tick] = []
    for result in results:
        before = made[-1].instruction if made else None
        made.append(tick_message(result, 7, before, LABELS, practice, show_assistance))
    return made


@pytest.fixture(scope="module")
def assisted() -> dict[str, list[TickResult]]:
    return {condition: drive(opened(trial_setup(condition)), Person()) for condition in CONDITIONS}


def test_no_tick_tells_who_drives_what_is_believed_or_the_condition(assisted: dict[str, list[TickResult]]) -> None:
    for results in assisted.values():
        for message in messages(results):
            assert secrets_in(message) == []
            assert message.assisting is None
            assert not re.search(r"robot|source|user", message.model_dump_json())


def test_assistance_is_shown_only_if_the_study_says_so(assisted: dict[str, list[TickResult]]) -> None:
    for results in assisted.values():
        shown = messages(results, show_assistance=True)
        assert [message.assisting for message in shown] == [result.row.source == "robot" for result in results]


def test_assistance_is_shown_where_the_robot_overrides_the_person_too() -> None:
    results = run(opened(trial_setup("goal_oriented", gamma=0.0)), [push((0, 0, 1))] * 8)
    (*_, last) = messages(results, show_assistance=True)
    assert (results[-1].row.source, last.assisting) == ("blend", True)
    assert secrets_in(messages(results)[-1]) == []


def test_the_instruction_names_the_object_and_then_the_bin(assisted: dict[str, list[TickResult]]) -> None:
    texts = list(dict.fromkeys(message.instruction.text for message in messages(assisted["teleoperation"])))
    assert texts == [
        "Pick up the spray bottle.",
        "Drop the spray bottle into the left bin.",
        "The arm goes back to its start. Please wait.",
        "Pick up the pack of sponges.",
        "Drop the pack of sponges into the right bin.",
        "Pick up the paper towel roll.",
        "Drop the paper towel roll into the left bin.",
    ]


def test_progress_counts_up_to_all_tasks(assisted: dict[str, list[TickResult]]) -> None:
    sent = messages(assisted["balanced"])
    assert sorted({message.done_tasks for message in sent}) == [0, 1, 2, 3, 4, 5, 6]
    assert {message.tasks for message in sent} == {6}
    assert [message.status for message in sent][-1] == "finished"
    assert {message.status for message in sent} == {"running", "gripper", "resetting", "finished"}
    assert {message.seq for message in sent} == {7}


def test_the_end_of_a_task_is_said_once(assisted: dict[str, list[TickResult]]) -> None:
    notices = [message.notice for message in messages(assisted["teleoperation"]) if message.notice]
    assert notices == [
        "Well done: the spray bottle is in the bin.",
        "Well done: the pack of sponges is in the bin.",
        "Well done: the paper towel roll is in the bin.",
    ]


def test_a_practice_without_a_bin_asks_for_another_place() -> None:
    sent = messages(drive(opened(practice_setup()), Person()), practice=True)
    assert list(dict.fromkeys(message.instruction.text for message in sent)) == [
        "Practice: pick up the practice block.",
        "Practice: move the practice block to another place on the table and let go.",
    ]
    assert {(message.instruction.kind, message.instruction.bin) for message in sent} == {("practice", None)}
    assert sent[-1].notice == "Well done."


def view(
    kind: Literal["pickup", "dropoff"],
    phase: Literal["operating", "gripper", "settling", "reset", "finished"] = "operating",
) -> TrialView:
    return TrialView(
        phase=phase,
        kind=kind,
        object="wipes_tub",
        bin="right_bin",
        done_tasks=0,
        tasks=6,
        gripper="open",
        holding=False,
        blocked=False,
        source="robot",
        ended=None,
    )


def test_a_bin_is_in_the_picture_only_when_it_is_its_turn() -> None:
    pickup, dropoff = instruction(view("pickup"), LABELS, False), instruction(view("dropoff"), LABELS, False)
    waiting = instruction(view("pickup", "reset"), LABELS, False)
    assert (pickup.object, pickup.bin, pickup.bin_label) == ("wipes_tub", None, None)
    assert (dropoff.object_label, dropoff.bin, dropoff.bin_label) == ("tub of wipes", "right_bin", "right bin")
    assert (waiting.kind, waiting.bin) == ("reset", None)


@pytest.mark.parametrize(
    "reason",
    [
        "off_table",
        "knocked_over",
        "out_of_reach",
        "wrong_bin",
        "left_on_table",
        "outside_bin",
        "time_limit",
        "not_moved",
    ],
)
def test_every_failure_has_words_with_the_object_in_them(reason: str) -> None:
    before = instruction(view("pickup"), LABELS, False)
    line = notice(Verdict("failure", reason), before, LABELS)
    assert line is not None and "tub of wipes" in line and "{" not in line
    assert reason in FAILURES


def test_what_slips_is_said_and_what_is_let_go_is_not() -> None:
    before = drive(opened(trial_setup()), Person(), at_most=600, until=lambda r: r.row.tick == 0)[0]
    told = [
        messages([before, replace(before, events=(EngineEvent(kind, {"object": "wipes_tub"}),))])[1]
        for kind in ("slipped", "released")
    ]
    assert [(message.slipped, message.notice) for message in told] == [
        (True, "The tub of wipes slipped out of the gripper."),
        (False, None),
    ]


@pytest.mark.parametrize(
    ("limits", "told"),
    [
        (TimeLimits(), [AGAIN]),
        (TimeLimits(task_ticks=20), ["The arm is free again, and the object stands where it stood.", OVER]),
        (TimeLimits(trial_ticks=20), [OVER]),
    ],
)
def test_another_pickup_is_asked_for_only_where_there_is_time_for_one(limits: TimeLimits, told: list[str]) -> None:
    engine = opened(replace(trial_setup(), limits=limits))
    results = run(engine, [*[UserInput()] * 19, UserInput(free=True), *[UserInput()] * 4])
    assert [message.notice for message in messages(results) if message.notice] == told


def test_without_an_end_there_is_nothing_to_say() -> None:
    before = instruction(view("pickup"), LABELS, False)
    assert notice(None, before, LABELS) is None
    assert notice(Verdict("success"), None, LABELS) is None
    assert notice(Verdict("success"), before, LABELS) is None  # a pickup: the next instruction says enough


def test_a_blocked_tick_says_what_to_do() -> None:
    engine = opened(trial_setup("balanced"))
    sent = messages([engine.tick(UserInput((0, 0, -1))) for _ in range(8)])
    assert sent[-1].hint is not None
    assert sent[-1].hint.model_dump() == {"cause": "low", "ways": ("up",)}
    assert sent[0].hint is None


def test_a_blocked_tick_says_so() -> None:
    result = drive(opened(trial_setup()), Person(), at_most=600, until=lambda r: r.row.tick == 0)[0]
    blocked = replace(result, view=replace(result.view, blocked=True))
    assert [message.blocked for message in messages([result, blocked])] == [False, True]
