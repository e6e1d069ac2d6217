"""Nobody is stuck in a real browser: what cannot be loaded, drawn or reached is said, with what to do about it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest
from playwright.sync_api import expect

from tests.support import lab_server as labs
from tests.support.fake_lab import FakeLab
from tests.support.fake_pages import CONTENT, tick
from tests.support.lab_server import LabServer
from tests.support.participant_page import in_thread, left_at, opened, visible
from tests.support.wire_client import SHORT, asked, events, invite, seen_by_experimenter, visit, write_study

if TYPE_CHECKING:
    from playwright.sync_api import Page, Route

WORKER = "**/wire/heartbeat_worker.js"


def beats(lab: FakeLab, mark: int, count: int) -> None:
    """That many heartbeats after a mark."""
    for _ in range(count):
        lab.wait_for(lambda message: message["type"] == "heartbeat", after=mark)
        mark = next(i for i in range(mark, lab.mark()) if lab.received[i]["type"] == "heartbeat") + 1


# --- what cannot be loaded -----------------------------------------------------------------------------------------


def blocked(route: Route) -> None:
    route.abort("blockedbyclient")


def missing(route: Route) -> None:
    route.fulfill(status=404, body="")


def emptied(route: Route) -> None:
    route.fulfill(status=200, content_type="text/javascript", body="")


@pytest.mark.parametrize("answer", [blocked, missing, emptied])
def test_without_its_worker_the_heartbeat_goes_on_and_the_lab_is_told(page: Page, lab: FakeLab, answer: Any) -> None:
    page.context.route(WORKER, answer)
    opened(page, lab, "trial")
    told = lab.wait_for(lambda message: message["type"] == "note" and message["name"] == "heartbeat_by_timer")
    assert told["data"]["why"] == ("silent" if answer is emptied else "error")
    beats(lab, lab.mark(), 4)


def test_a_browser_that_makes_no_workers_beats_too(page: Page, lab: FakeLab) -> None:
    page.add_init_script("window.Worker = class { constructor() { throw new Error('no workers here'); } };")
    opened(page, lab, "trial")
    told = lab.wait_for(lambda message: message["type"] == "note" and message["name"] == "heartbeat_by_timer")
    assert told["data"]["why"] == "threw"
    beats(lab, lab.mark(), 4)


def test_with_its_worker_nothing_is_told(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "trial")
    beats(lab, lab.mark(), 12)  # longer than it may be silent
    assert not [message for message in lab.received if message.get("name") == "heartbeat_by_timer"]


@pytest.mark.parametrize("module", ["readings/sound.js", "participant/scene.js", "hands/gamepad.js", "common/dom.js"])
def test_a_module_that_does_not_come_through_leaves_no_empty_page(page: Page, lab: FakeLab, module: str) -> None:
    page.context.route(f"**/static/{module}", blocked)
    page.goto(lab.participant_url)
    said = page.get_by_text("Reload the page. If that does not help")
    said.wait_for()
    assert "switch off what blocks content" in said.inner_text()


def test_the_second_device_and_the_dashboard_say_so_too(page: Page, lab: FakeLab) -> None:
    page.context.route("**/static/common/dom.js", blocked)
    for address in (lab.panel_url, f"{lab.base_url}/dashboard"):
        page.goto(address)
        page.get_by_text("Reload the page. If that does not help").wait_for()


def test_a_page_that_came_through_never_shows_it(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "consent")
    assert page.locator(".boot").count() == 1
    assert not page.locator(".boot").is_visible()


# --- how many questions --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("count", "words"), [(3, "3 short questions."), (1, "One short question."), (0, None)])
def test_the_instructions_count_their_questions(page: Page, lab: FakeLab, count: int, words: str | None) -> None:
    asked = CONTENT["instructions"]
    lab.content["instructions"] = {**asked, "questions": asked["questions"][:count]}
    opened(page, lab, "instructions")
    assert page.get_by_test_id("instructions-questions").count() == (0 if words is None else 1)
    if words is None:
        page.get_by_test_id("instructions-submit").click()
        assert lab.wait_submit("instructions")["data"] == {"answers": {}}
    else:
        assert words in page.get_by_test_id("instructions-questions").inner_text()


# --- messages ------------------------------------------------------------------------------------------------------

COVERED = """() => {
  const toasts = document.querySelector(".toasts").getBoundingClientRect();
  const hit = (box) => box.width && box.left < toasts.right && box.right > toasts.left
    && box.top < toasts.bottom && box.bottom > toasts.top;
  return [...document.querySelectorAll("button, iframe, input, a")]
    .filter((one) => one.checkVisibility() && !one.closest(".toasts") && hit(one.getBoundingClientRect()))
    .map((one) => one.dataset.testid ?? one.outerHTML);
}"""


@pytest.mark.parametrize("size", [(1280, 720), (1920, 1080), (640, 360), (390, 844)])
def test_messages_cover_neither_the_scene_nor_a_control(page: Page, lab: FakeLab, size: tuple[int, int]) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    opened(page, lab, "trial")
    lab.send(tick(0))
    for number in range(5):
        lab.send({"type": "notice", "text": f"Message {number}"})
    page.get_by_text("3 more messages").wait_for()
    assert page.evaluate(COVERED) == []
    page.get_by_test_id("view-side").click()  # what messages used to lie on
    lab.wait_for(lambda message: message["type"] == "view")


def test_messages_wait_for_their_turn_and_are_dismissed_one_by_one(page: Page, lab: FakeLab) -> None:
    opened(page, lab, "break")
    for number in range(4):
        lab.send({"type": "notice", "text": f"Message {number}"})
    page.get_by_text("2 more messages").wait_for()
    for number in range(4):
        assert f"Message {number}" in page.get_by_test_id("toast").first.inner_text()
        page.get_by_role("button", name="Dismiss this message").first.click()
    assert page.get_by_test_id("toast").count() == 0
    assert page.get_by_test_id("toasts-more").is_hidden()


# --- a call for help -----------------------------------------------------------------------------------------------

RINGING = """() => {
  const { sound } = salab.calls;
  const samples = new Float32Array(sound.analyser?.fftSize ?? 1);
  sound.analyser?.getFloatTimeDomainData(samples);
  return Math.max(...samples.map(Math.abs)) > 0.01;
}"""


def test_a_call_for_help_is_heard_and_seen_first_with_its_words(page: Page, quick_lab: LabServer) -> None:
    caller, later = invite(quick_lab), invite(quick_lab)
    participant = caller["participant"]
    page.goto(quick_lab.experimenter_link)
    page.get_by_test_id("page-dashboard").wait_for()
    page.get_by_test_id("initials").fill("AB")
    page.get_by_test_id("initials").press("Tab")

    async def call() -> None:
        async with visit(caller["link"]) as player:
            await player.done("help", {"text": "The <b>arm</b> is stuck."})

    in_thread(call())
    banner = page.get_by_test_id("help-calls")
    banner.get_by_text("“The <b>arm</b> is stuck.”").wait_for()
    assert page.title().startswith(f"(1) Help: {participant}")
    page.wait_for_function(RINGING)
    first = page.get_by_test_id("session-row").first
    assert first.get_attribute("data-participant") == participant
    assert first.get_attribute("data-participant") != later["participant"]
    banner.get_by_test_id("help-seen").click()
    banner.locator("li").wait_for(state="detached")
    assert "Help" not in page.title()
    told = [(kind, data.get("by")) for kind, data in events(quick_lab, participant, "step_help", "help_seen")]
    assert told == [("step_help", None), ("help_seen", "AB")]


def test_the_participant_is_told_that_their_call_was_seen(page: Page, quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    page.goto(made["link"])
    page.get_by_test_id("help-button").click()
    page.get_by_test_id("dialog-confirm").click()
    page.get_by_text("The experimenter has been told.").wait_for()
    answered = asked(quick_lab, "POST", f"sessions/{made['participant']}/help_seen", {})
    assert answered.status_code == 200
    page.get_by_text("The experimenter has seen your call for help.").wait_for()


# --- the second device ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def two_device_lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LabServer]:
    folder = tmp_path_factory.mktemp("two")
    changes = {**SHORT, 'placement = "same_page_away" ': 'placement = "second_device" '}
    study = str(write_study(folder, changes))
    with labs.start(folder / "data", "--robot", "kinematic", "--no-scene", "--study", study) as running:
        yield running


def test_the_set_up_waits_for_the_second_device_and_asks_there_for_the_sound(
    page: Page, two_device_lab: LabServer
) -> None:
    made = invite(two_device_lab)
    left_at(made["link"], "setup")
    page.goto(made["link"])
    page.get_by_test_id("device-keyboard").click()
    assert page.get_by_test_id("setup-sound").count() == 0, "the alarm does not sound on this device"
    state = page.get_by_test_id("panel-state")
    expect(state).to_have_text("Waiting for the second device")
    page.wait_for_function("document.querySelector('[data-testid=panel-qr]').naturalWidth > 0")
    page.get_by_test_id("setup-submit").click()
    page.get_by_text("Open the second device first").wait_for()
    panel = page.context.new_page()
    panel.goto(page.get_by_test_id("panel-link").input_value())
    expect(state).to_contain_text("turn its sound on")
    panel.get_by_test_id("panel-start").click()
    panel.get_by_test_id("panel-silent").click()
    expect(state).to_contain_text("nobody heard its alarm")
    panel.get_by_test_id("panel-heard").click()
    expect(state).to_contain_text("its alarm was heard")
    page.get_by_test_id("setup-submit").click()
    visible(page, "page-instructions")
    (setup,) = events(two_device_lab, made["participant"], "step_setup")
    assert setup[1]["sound"] is True


def test_a_round_starts_when_the_second_device_is_there_and_says_how_to_open_it(
    page: Page, two_device_lab: LabServer
) -> None:
    made = invite(two_device_lab)
    left_at(made["link"], "trial_ready")
    page.goto(made["link"])
    start = page.get_by_test_id("start-button")
    expect(page.get_by_test_id("panel-state")).to_have_text("Waiting for the second device")
    expect(start).to_be_disabled()
    expect(page.get_by_test_id("state-sign")).to_contain_text("Waiting for the second device")
    link = page.get_by_test_id("panel-link").input_value()
    panel = page.context.new_page()
    panel.goto(link)
    expect(start).to_be_enabled()
    panel.close()
    expect(start).to_be_disabled()
    # The experimenter has a way of their own.
    given = asked(two_device_lab, "POST", f"participants/{made['participant']}/link").json()
    panel = page.context.new_page()
    panel.goto(given["panel_link"])
    expect(start).to_be_enabled()
    start.click()
    page.locator("[data-testid=state-sign][data-state=running]").wait_for()
    # It may go in the middle of a round, too: nobody is left with readings that they cannot see.
    lost = page.get_by_test_id("second-lost")
    expect(lost).to_be_hidden()
    panel.close()
    expect(lost).to_contain_text("Waiting for the second device")
    page.wait_for_function("document.querySelector('[data-testid=panel-qr]').naturalWidth > 0")
    assert seen_by_experimenter(two_device_lab, made["participant"])["panel_missing"]
    panel = page.context.new_page()
    panel.goto(lost.get_by_test_id("panel-link").input_value())
    expect(lost).to_be_hidden()
    assert not seen_by_experimenter(two_device_lab, made["participant"])["panel_missing"]


def test_whoever_cannot_open_it_goes_on_and_the_record_says_so(page: Page, two_device_lab: LabServer) -> None:
    made = invite(two_device_lab)
    left_at(made["link"], "setup")
    page.goto(made["link"])
    page.get_by_test_id("device-keyboard").click()
    page.get_by_test_id("setup-submit").click()
    page.get_by_test_id("panel-later").click()
    visible(page, "page-instructions")
    assert events(two_device_lab, made["participant"], "page.panel_later")
    assert events(two_device_lab, made["participant"], "step_setup")[0][1]["sound"] is False


def test_a_study_without_a_second_device_gives_out_no_link_of_one(page: Page, quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    assert made["second_device"] is False
    assert asked(quick_lab, "POST", f"participants/{made['participant']}/link").json()["panel_link"] == ""
    page.goto(made["panel_link"])
    page.get_by_text("This study has no second device").wait_for()
    page.goto(quick_lab.experimenter_link)
    page.get_by_text("makes its demo when it is first opened").wait_for()  # until then the roster counts none
    page.get_by_test_id("create-participant").click()
    page.get_by_test_id("participant-link").wait_for()
    assert page.get_by_test_id("second-device-link").count() == 0


# --- turned away ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("why", "shown"), [("unusable", "page-unusable"), ("too_many", "page-too-many")])
def test_whoever_is_not_let_in_reads_why(page: Page, lab: FakeLab, why: str, shown: str) -> None:
    lab.accepts = False
    page.context.route("**/s/test/why", lambda route: route.fulfill(json={"why": why}))
    page.goto(lab.participant_url)
    visible(page, shown)
    assert page.get_by_role("button", name="Reload the page").is_visible()


def test_whoever_is_erased_while_they_look_reads_that_their_link_is_over(page: Page, quick_lab: LabServer) -> None:
    made = invite(quick_lab)
    page.goto(made["link"])
    visible(page, "page-consent")
    participant = made["participant"]
    assert asked(quick_lab, "POST", f"participants/{participant}/erase", {"confirm": participant}).status_code == 200
    visible(page, "page-denied")
