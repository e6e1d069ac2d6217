"""A flow of other pages than the shipped ones, and pages that make none."""

from __future__ import annotations

import pickle
from dataclasses import replace

import pytest

from study.flow.flow import FLOW, Flow
from study.flow.page import FlowPage, NoData, Outcome, Step, StepContext, button
from study.flow.pages import PAGES
from study.flow.protocol import Ending, Event, Session, State, to_json
from study.records import StudyError
from tests.support.study_samples import shipped_study

REST = FlowPage(state="rest", leads_on="rested", steps={"rested": button("rested")}, per_trial=True)
"""A page that asks nothing, for the places of a trial."""
THANKS = FlowPage(state="thanks", leads_on="thanked", steps={"thanked": button("thanked")})
"""The same outside the trials."""


def visited(flow: Flow, trials: int, *skips: State) -> list[tuple[State, int]]:
    """States and trials from the beginning to the end, by what leads on."""
    session = flow.new_session("P001", trials, skips)
    found = [(session.state, session.trial)]
    while not session.is_over:
        session, _ = flow.advance(session, flow.page(session.state).leads_on or "", 0.0)
        found.append((session.state, session.trial))
    return found


def test_a_page_more_comes_where_it_was_put_in_every_trial() -> None:
    flow = FLOW.with_page(REST, after="practice")
    way = visited(flow, 2)
    of_trials = [(state, trial) for state, trial in way if state in ("practice", "rest", "trial_ready")]
    assert of_trials == [
        *(("practice", 1), ("rest", 1), ("trial_ready", 1)),
        *(("practice", 2), ("rest", 2), ("trial_ready", 2)),
    ]
    assert [entry for entry in way if entry[0] != "rest"] == visited(FLOW, 2)


def test_a_page_more_outside_the_trials_comes_once() -> None:
    assert [state for state, _ in visited(FLOW.with_page(THANKS, after="debrief"), 2)][-3:] == [
        "debrief",
        "thanks",
        "done",
    ]


def test_a_page_without_a_robot_lets_the_worker_go_and_the_next_one_brings_it_back() -> None:
    flow = FLOW.with_page(REST, after="trial_ready")
    session = Session("P001", 3, "trial_ready", trial=2)
    session, effects = flow.advance(session, "start", 0.0)
    assert (session.state, [type(effect).__name__ for effect in effects]) == ("rest", ["StopWorker"])
    session, effects = flow.advance(session, "rested", 0.0)
    assert (session.state, [type(effect).__name__ for effect in effects]) == ("trial", ["StartWorker", "BeginTicks"])


def test_trials_come_round_without_a_break_too() -> None:
    flow = Flow(tuple(page for page in PAGES if page.state != "break"))
    assert [trial for state, trial in visited(flow, 3) if state == "trial"] == [1, 2, 3]
    assert [trial for state, trial in visited(flow, 3, "survey") if state == "trial"] == [1, 2, 3]
    assert visited(flow, 3)[-1] == ("done", 3)


def test_the_last_page_of_a_trial_may_come_after_the_break() -> None:
    way = visited(FLOW.with_page(REST, after="break"), 2)
    assert [entry for entry in way if entry[0] in ("break", "rest")] == [("break", 1), ("rest", 1), ("rest", 2)]


def test_an_aborted_trial_leads_to_the_page_behind_it() -> None:
    flow = FLOW.with_page(REST, after="trial")
    assert flow.advance(Session("P001", 3, "trial"), "abort_trial", 0.0)[0].state == "rest"


def test_a_study_leaves_out_what_a_page_of_ones_own_says() -> None:
    flow = FLOW.with_page(replace(REST, left_out=_everywhere), after="practice")
    assert flow.skips(shipped_study()) == {"eligibility", "rest"}
    session = flow.new_session("P001", 3, flow.skips(shipped_study()))
    assert session.state == "consent"
    assert "rest" not in [state for state, _ in visited(flow, 2, "rest")]


def _everywhere(study: object) -> bool:
    return True


def test_a_page_may_end_the_session() -> None:
    too_tired = Ending("withdrawn", "declined")
    flow = FLOW.with_page(replace(REST, ends={"too_tired": too_tired}), after="practice")
    resting = Session("P001", 3, "rest")
    assert flow.allowed(resting)[:2] == ("rested", "too_tired")
    over, _ = flow.advance(resting, Event("too_tired", "long day"), 0.0)
    assert (over.state, over.outcome, over.reason) == ("withdrawn", "declined", "long day")


def test_a_session_on_a_page_that_the_flow_has_not_is_refused_when_it_is_read() -> None:
    text = to_json(Session("P001", 3, "rest"))
    assert FLOW.with_page(REST, after="practice").from_json(text).state == "rest"
    with pytest.raises(StudyError, match="state = 'rest' cannot be"):
        FLOW.from_json(text)


def test_a_flow_goes_to_another_process_as_it_is() -> None:
    flow = pickle.loads(pickle.dumps(FLOW.with_page(REST, after="practice")))
    assert flow.states == FLOW.with_page(REST, after="practice").states


def test_an_unknown_page_is_named_with_those_there_are() -> None:
    with pytest.raises(StudyError, match=r"no page 'lunch' in this flow; there are eligibility, .*screened_out"):
        FLOW.with_page(REST, after="lunch")


def _other(context: StepContext, data: NoData) -> Outcome:
    return Outcome()


@pytest.mark.parametrize(
    ("page", "after", "says"),
    [
        (replace(REST, state="Rest"), "practice", "small letters"),
        (replace(REST, state="../x"), "practice", "small letters"),
        (replace(REST, state="survey"), "practice", "'survey' stands in the flow 2 times"),
        (replace(REST, per_trial=False), "practice", "pages of a trial must stand together"),
        (REST, "consent", "pages of a trial must stand together"),
        (replace(REST, leads_on="abort"), "practice", "'abort' means the same from every page"),
        (replace(REST, leads_on="consent_declined"), "practice", "leads on here and ends the session in consent"),
        (replace(REST, leads_on="Go on"), "practice", "an event is small letters"),
        (replace(REST, aside={"start": "survey"}), "practice", "leads aside here and on elsewhere"),
        (replace(REST, aside={"jump": "lunch"}), "practice", "names the page 'lunch'"),
        (replace(REST, left_out_with="consent"), "practice", "which no study can leave out"),
        (replace(REST, ends={"eaten": Ending("lunch", "aborted")}), "practice", "names the page 'lunch'"),
        (replace(REST, steps={"start": Step(NoData, _other)}), "practice", "'start' is another one in practice_ready"),
        (replace(REST, steps={"help": button("rested")}), "practice", "'help' is another one in the lab itself"),
        (replace(REST, steps={"alert_me": button("rested")}), "practice", "is another one in the lab itself"),
        (replace(REST, steps={"Rested!": button("rested")}), "practice", "a step is small letters"),
    ],
)
def test_a_page_that_fits_nowhere_is_refused_with_its_name(page: FlowPage, after: State, says: str) -> None:
    with pytest.raises(StudyError, match=says):
        FLOW.with_page(page, after=after)


@pytest.mark.parametrize(
    ("left", "says"),
    [
        ("trial", "the flow has no page 'trial'; every flow has practice_ready"),
        ("withdrawn", "the flow has no page 'withdrawn'"),
        ("paused", "the flow has no page 'paused'"),
    ],
)
def test_a_flow_without_a_page_that_every_flow_has_is_refused(left: State, says: str) -> None:
    with pytest.raises(StudyError, match=says):
        Flow(tuple(page for page in PAGES if page.state != left))


def test_pages_with_a_robot_keep_their_order() -> None:
    shuffled = sorted(PAGES, key=lambda page: page.state == "practice_ready")
    with pytest.raises(StudyError, match=r"the flow must lead to 'done'|must stand in this order"):
        Flow(tuple(shuffled))
