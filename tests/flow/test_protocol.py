"""The shipped flow, driven with plain values: what is allowed when, and what has to happen."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from study.flow.flow import FLOW
from study.flow.protocol import (
    FREES_CELL,
    NEEDS,
    TERMINAL,
    BeginTicks,
    Effect,
    Event,
    EventName,
    Finish,
    IllegalEvent,
    Outcome,
    PauseTicks,
    ResumeTicks,
    Session,
    StartWorker,
    State,
    StopWorker,
    to_json,
)
from study.records import StudyError

STATES, EVENTS, SKIPPABLE = FLOW.states, FLOW.events, FLOW.skippable
RULES, INTERVENTIONS = FLOW.rules, FLOW.interventions
advance, allowed, from_json, new_session, restore = (
    FLOW.advance,
    FLOW.allowed,
    FLOW.from_json,
    FLOW.new_session,
    FLOW.restore,
)
TO_TRIAL: tuple[EventName, ...] = (
    "consent_given",
    "demographics_done",
    "setup_done",
    "instructions_done",
    "start",
    "practice_done",
    "start",
)


def begun() -> Session:
    """Somebody in a study that asks nothing of their device."""
    return new_session("P001", 3, ["eligibility"])


def run(session: Session, *events: EventName | Event) -> tuple[Session, tuple[Effect, ...]]:
    """The session after these events, a second apart, and all their effects."""
    effects: tuple[Effect, ...] = ()
    for second, event in enumerate(events):
        session, more = advance(session, event, float(second))
        effects += more
    return session, effects


def in_trial() -> Session:
    return run(begun(), *TO_TRIAL)[0]


def test_a_participant_goes_from_consent_to_thanks() -> None:
    each: tuple[EventName, ...] = ("start", "practice_done", "start", "trial_done", "survey_done")
    session, effects = run(begun(), *TO_TRIAL[:4], *each, "continue", *each, "continue", *each, "debrief_done")
    assert (session.state, session.outcome, session.trial) == ("done", "done", 3)
    expected: list[Effect] = []
    for trial in (1, 2, 3):
        expected += [StartWorker("practice", trial), BeginTicks(), StopWorker()]
        expected += [StartWorker("trial", trial), BeginTicks(), StopWorker()]
    assert list(effects) == [*expected, Finish("done")]


def test_states_are_visited_in_the_order_of_the_study() -> None:
    session, visited = new_session("P001", 2), ["eligibility"]
    order: dict[str, EventName] = {
        state: event for state, event in RULES if event not in ("consent_declined", "screened_out", "place_lapsed")
    }
    while not session.is_over:
        session, _ = advance(session, order[session.state], 0.0)
        visited.append(session.state)
    per_trial = ["practice_ready", "practice", "trial_ready", "trial", "survey"]
    head = ["eligibility", "consent", "demographics", "setup", "instructions"]
    assert visited == [*head, *per_trial, "break", *per_trial, "debrief", "done"]


def test_what_a_study_leaves_out_is_not_visited() -> None:
    session = new_session("P001", 2, SKIPPABLE)
    session, effects = run(
        session, "consent_given", "setup_done", "instructions_done", "start", "trial_done", "continue"
    )
    assert (session.state, session.trial) == ("trial_ready", 2)
    assert effects == (StartWorker("trial", 1), BeginTicks(), StopWorker(), StartWorker("trial", 2))
    session, _ = run(session, "start", "trial_done")
    assert session.state == "debrief"


def test_an_illegal_event_names_state_event_and_what_is_allowed() -> None:
    with pytest.raises(IllegalEvent) as caught:
        advance(begun(), "start", 0.0)
    assert (caught.value.state, caught.value.event) == ("consent", "start")
    assert str(caught.value) == (
        "event 'start' is not allowed in state 'consent'; allowed: place_lapsed, consent_given, "
        "consent_declined, connection_lost, picture_lost, experimenter_pause, withdraw, abort"
    )
    done, _ = advance(begun(), "withdraw", 0.0)
    with pytest.raises(IllegalEvent, match="none, the session is over"):
        advance(done, "start", 0.0)


def test_declining_consent_is_not_withdrawing() -> None:
    session, effects = advance(begun(), "consent_declined", 1.0)
    assert (session.state, session.outcome) == ("withdrawn", "declined")
    assert effects == (Finish("declined"),)


def test_whose_device_does_not_fit_never_sees_the_consent() -> None:
    first = new_session("P001", 3)
    assert advance(first, "eligible", 1.0)[0].state == "consent"
    out, effects = advance(first, Event("screened_out", '["webgl"]'), 1.0)
    assert (out.state, out.outcome, out.reason) == ("screened_out", "screened_out", '["webgl"]')
    assert effects == (Finish("screened_out"),)
    assert out.state in FREES_CELL
    with pytest.raises(IllegalEvent):
        advance(begun(), "screened_out", 1.0)


# ---- pausing


def test_a_lost_connection_pauses_a_trial_until_the_participant_resumes() -> None:
    paused, effects = advance(in_trial(), "connection_lost", 50.0)
    assert (paused.state, paused.resume_to, paused.causes) == ("paused", "trial", frozenset({"connection"}))
    assert (paused.since_s, effects) == (50.0, (PauseTicks(),))
    back, effects = advance(paused, "resume", 60.0)
    assert (back.state, back.resume_to, back.causes, back.trial) == ("trial", None, frozenset(), 1)
    assert effects == (ResumeTicks(),)


def test_a_lost_picture_pauses_a_trial_until_it_is_back() -> None:
    paused, effects = advance(in_trial(), Event("picture_lost", "context_lost"), 50.0)
    assert (paused.state, paused.causes, paused.reason) == ("paused", frozenset({"picture"}), "context_lost")
    assert effects == (PauseTicks(),)
    with pytest.raises(IllegalEvent):
        advance(paused, "resume", 51.0)
    back, effects = advance(paused, "picture_back", 60.0)
    assert back == replace(in_trial(), since_s=60.0)
    assert effects == (ResumeTicks(),)
    # Where no page tells of its picture, the experimenter lets it go on.
    assert advance(paused, "experimenter_resume", 60.0)[0] == back


def test_a_picture_that_is_back_waits_for_whoever_else_paused() -> None:
    paused, _ = run(in_trial(), "picture_lost", "connection_lost")
    half, effects = advance(paused, "picture_back", 9.0)
    assert (half.causes, effects) == (frozenset({"connection"}), ())
    assert advance(half, "resume", 9.0)[0].state == "trial"
    for state in ("consent", "survey", "trial_ready", "debrief"):
        session = Session("P001", 3, state=state)
        assert advance(session, "picture_lost", 9.0) == (session, ())
    with pytest.raises(IllegalEvent):
        advance(in_trial(), "picture_back", 9.0)


@pytest.mark.parametrize("state", ["consent", "survey", "practice_ready", "trial_ready", "break", "debrief"])
def test_a_lost_connection_changes_nothing_where_nothing_runs(state: State) -> None:
    session = Session("P001", 3, state=state)
    assert advance(session, "connection_lost", 9.0) == (session, ())


def test_two_causes_must_both_go() -> None:
    paused, effects = run(in_trial(), "connection_lost", "experimenter_pause")
    assert paused.causes == {"connection", "experimenter"}
    assert effects == (PauseTicks(),)
    orders: tuple[tuple[EventName, EventName], ...] = (
        ("resume", "experimenter_resume"),
        ("experimenter_resume", "resume"),
    )
    for first, second in orders:
        half, effects = advance(paused, first, 1.0)
        assert (half.state, effects) == ("paused", ())
        with pytest.raises(IllegalEvent):
            advance(half, first, 2.0)
        whole, effects = advance(half, second, 3.0)
        assert (whole.state, effects) == ("trial", (ResumeTicks(),))


def test_only_the_experimenter_ends_the_experimenters_pause() -> None:
    paused, _ = advance(in_trial(), Event("experimenter_pause", "phone rang"), 1.0)
    assert paused.reason == "phone rang"
    with pytest.raises(IllegalEvent):
        advance(paused, "resume", 2.0)
    assert advance(paused, "experimenter_resume", 2.0)[0] == replace(in_trial(), since_s=2.0)


def test_the_experimenter_pauses_any_live_state_and_comes_back_to_it() -> None:
    for state in STATES:
        if state in TERMINAL or state == "paused":
            continue
        session = Session("P001", 3, state=state, trial=2)
        paused, effects = advance(session, "experimenter_pause", 1.0)
        assert effects == ((PauseTicks(),) if session.is_ticking else ())
        back, _ = advance(paused, "experimenter_resume", 2.0)
        assert (back.state, back.trial) == (state, 2)


def test_a_trial_that_ends_while_a_pause_is_on_its_way_has_ended() -> None:
    paused, _ = advance(in_trial(), "experimenter_pause", 1.0)
    ended, effects = advance(paused, "trial_done", 1.5)
    assert (ended.state, ended.resume_to, effects) == ("paused", "survey", (StopWorker(),))
    assert advance(ended, "experimenter_resume", 2.0)[0].state == "survey"
    # A survey waits for nobody's connection, so that pause is over at once.
    lost, _ = advance(in_trial(), "connection_lost", 1.0)
    ended, effects = advance(lost, "trial_done", 1.5)
    assert (ended.state, ended.causes, effects) == ("survey", frozenset(), (StopWorker(),))


@pytest.mark.parametrize("name", ["withdraw", "abort"])
def test_leaving_stops_the_worker_and_keeps_the_reason(name: EventName) -> None:
    for session in (in_trial(), advance(in_trial(), "connection_lost", 1.0)[0]):
        gone, effects = advance(session, Event(name, "too hot"), 5.0)
        outcome: Outcome = "withdrawn" if name == "withdraw" else "aborted"
        assert (gone.state, gone.outcome, gone.reason) == (outcome, outcome, "too hot")
        assert effects == (StopWorker(), Finish(outcome))


# ---- the experimenter leads aside


def test_practice_is_repeated_before_the_trial_begins_and_a_pause_stays_one() -> None:
    ready, _ = run(begun(), *TO_TRIAL[:-1])
    back, effects = advance(ready, "repeat_practice", 9.0)
    assert (back.state, back.trial, back.since_s) == ("practice_ready", 1, 9.0)
    assert effects == (StopWorker(), StartWorker("practice", 1))
    paused, _ = advance(ready, Event("experimenter_pause", "not understood"), 1.0)
    back, effects = advance(paused, "repeat_practice", 2.0)
    assert (back.state, back.resume_to, back.causes) == ("paused", "practice_ready", frozenset({"experimenter"}))
    assert effects == (StopWorker(), StartWorker("practice", 1))


def test_there_is_no_practice_to_repeat_during_one_in_a_trial_or_in_a_study_without() -> None:
    without, _ = run(new_session("P001", 3, ["eligibility", "practice_ready"]), *TO_TRIAL[:4])
    assert without.state == "trial_ready"
    for session in (without, in_trial(), run(begun(), *TO_TRIAL[:5])[0]):
        with pytest.raises(IllegalEvent):
            advance(session, "repeat_practice", 1.0)


def test_an_aborted_trial_is_over_and_the_session_goes_on() -> None:
    after, effects = advance(in_trial(), "abort_trial", 5.0)
    assert (after.state, after.trial, after.outcome, effects) == ("survey", 1, None, (StopWorker(),))
    paused, _ = advance(in_trial(), "experimenter_pause", 1.0)
    after, effects = advance(paused, "abort_trial", 5.0)
    assert (after.state, after.resume_to, effects) == ("paused", "survey", (StopWorker(),))
    lost, _ = advance(in_trial(), "connection_lost", 1.0)
    assert advance(lost, "abort_trial", 5.0)[0].state == "survey"
    silent, _ = run(new_session("P001", 1, ["eligibility", "survey"]), *TO_TRIAL)
    assert advance(silent, "abort_trial", 5.0)[0].state == "debrief"
    for state in ("practice", "trial_ready", "survey"):
        with pytest.raises(IllegalEvent):
            advance(Session("P001", 3, state=state), "abort_trial", 1.0)


# ---- storing


def test_a_restored_trial_waits_for_its_participant_with_its_worker_back() -> None:
    session, effects = restore(from_json(to_json(in_trial())), 99.0)
    assert (session.state, session.resume_to, session.causes) == ("paused", "trial", frozenset({"connection"}))
    assert effects == (StartWorker("trial", 1),)
    session, effects = advance(session, "resume", 100.0)
    assert (session.state, effects) == ("trial", (ResumeTicks(),))


def test_a_restored_form_is_just_shown_again() -> None:
    session = Session("P001", 3, state="survey", trial=2)
    assert restore(session, 9.0) == (session, ())
    ready = Session("P001", 3, state="practice_ready", trial=2)
    assert restore(ready, 9.0) == (ready, (StartWorker("practice", 2),))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"consent"', '"lunch"', "state = 'lunch'"),
        ('"trial": 1', '"trial": 9', "trial = 9"),
        ('"causes": []', '"causes": ["boredom"]', "causes"),
        ('"resume_to": null', '"resume_to": "trial"', "resume_to"),
        ('"outcome": null', '"outcome": "done"', "outcome"),
        ('"trials"', '"rounds"', "not a stored session"),
        ("{", "", "not a stored session"),
    ],
)
def test_a_damaged_stored_session_is_refused(old: str, new: str, says: str) -> None:
    with pytest.raises(StudyError, match=says):
        from_json(to_json(begun()).replace(old, new, 1))


def test_a_session_needs_a_trial_and_skips_only_what_can_be_skipped() -> None:
    with pytest.raises(StudyError, match="trials is 0"):
        new_session("P001", 0)
    with pytest.raises(StudyError, match=r"cannot skip \['consent'\]"):
        new_session("P001", 3, ["consent"])


# ---- properties


@settings(deadline=None)
@given(
    st.integers(1, 3),
    st.sets(st.sampled_from(sorted(SKIPPABLE))),
    st.lists(st.integers(0, 10**6), max_size=60),
)
def test_no_sequence_of_legal_events_leaves_the_map(trials: int, skips: set[str], choices: list[int]) -> None:
    """Whatever happens: a defined state, effects that fit the worker there is, and an end that is an end."""
    session = new_session("P001", trials, skips)
    worker, ticking = None, False
    for choice in choices:
        events = allowed(session)
        if not events:
            assert session.state in TERMINAL
            break
        session, effects = advance(session, events[choice % len(events)], float(choice))
        assert session.state in STATES
        assert 1 <= session.trial <= trials
        assert not ({session.state, session.resume_to} & set(skips))
        assert (session.state == "paused") == bool(session.causes) == (session.resume_to is not None)
        assert from_json(to_json(session)) == session
        for effect in effects:
            if isinstance(effect, StartWorker):
                assert worker is None
                worker = (effect.kind, effect.trial)
            elif isinstance(effect, StopWorker):
                assert worker is not None
                worker, ticking = None, False
            elif isinstance(effect, (BeginTicks, ResumeTicks)):
                assert worker is not None
                assert not ticking
                ticking = True
            elif isinstance(effect, PauseTicks):
                assert ticking
                ticking = False
            else:
                assert session.is_over
        assert (worker, ticking) == (session.worker, session.is_ticking)
    if session.is_over:
        for event in EVENTS:
            with pytest.raises(IllegalEvent):
                advance(session, event, 0.0)


@settings(deadline=None)
@given(st.sampled_from([state for state in STATES if state != "paused"]), st.sampled_from(EVENTS))
def test_allowed_is_exactly_what_advance_takes(state: State, event: EventName) -> None:
    session = Session("P001", 3, state=state, trial=2)
    if event in allowed(session):
        advance(session, event, 1.0)
    else:
        with pytest.raises(IllegalEvent):
            advance(session, event, 1.0)


def test_every_state_can_be_reached_and_left() -> None:
    reached = {"eligibility", *RULES.values(), "debrief", "paused", "withdrawn", "aborted"}
    assert reached == set(STATES)
    assert {state for state, _ in INTERVENTIONS} | set(INTERVENTIONS.values()) <= reached
    assert {state for state, _ in RULES} | TERMINAL | {"paused"} == set(STATES)
    assert set(NEEDS) <= set(STATES)


def test_the_whole_table_is_the_one_participants_have_always_gone_through() -> None:
    """Derived from the pages, and told here as a table."""
    assert {
        ("eligibility", "eligible"): "consent",
        ("eligibility", "screened_out"): "screened_out",
        **{(state, "place_lapsed"): "lapsed" for state in ("eligibility", "consent")},
        ("consent", "consent_given"): "demographics",
        ("consent", "consent_declined"): "withdrawn",
        ("demographics", "demographics_done"): "setup",
        ("setup", "setup_done"): "instructions",
        ("instructions", "instructions_done"): "practice_ready",
        ("practice_ready", "start"): "practice",
        ("practice", "practice_done"): "trial_ready",
        ("trial_ready", "start"): "trial",
        ("trial", "trial_done"): "survey",
        ("survey", "survey_done"): "break",  # debrief after the last trial
        ("break", "continue"): "practice_ready",  # of the next trial
        ("debrief", "debrief_done"): "done",
    } == RULES
    assert INTERVENTIONS == {("trial_ready", "repeat_practice"): "practice_ready", ("trial", "abort_trial"): "survey"}
    assert {"eligibility", "demographics", "practice_ready", "survey"} == SKIPPABLE
    assert (
        *("eligible", "screened_out", "place_lapsed"),
        *("consent_given", "consent_declined", "demographics_done", "setup_done"),
        *("instructions_done", "start", "practice_done", "trial_done", "survey_done", "continue", "debrief_done"),
        *(
            "connection_lost",
            "picture_lost",
            "picture_back",
            "part_failed",
            "resume",
            "experimenter_pause",
            "experimenter_resume",
        ),
        *("repeat_practice", "abort_trial", "withdraw", "abort"),
    ) == EVENTS
