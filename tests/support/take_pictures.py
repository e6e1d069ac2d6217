"""`python -m tests.support.take_pictures`: the pictures, from a real lab, browser and pybullet.

Takes three minutes. Look at every picture before it is committed.
"""

from __future__ import annotations

import argparse
import io
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL import Image
from playwright.sync_api import sync_playwright

from app.report.layout_picture import write_layout_picture
from app.simulated.pilot import Pilot
from app.trial.world import layout_of, open_study
from sim.interface import TICK_S
from sim.view.published import why_missing
from tests.conftest import CHROMIUM_ARGUMENTS
from tests.support import chromium
from tests.support import lab_server as labs
from tests.support.browser_person import BrowserPerson
from tests.support.look_pictures import NEAR, WHOLE, side_by_side
from tests.support.study_samples import shipped_study
from tests.support.wire_client import COMPREHENSION, OPEN, invite, write_study

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "pictures"
EXAMPLE = FOLDER.parent / "examples" / "05_layout" / "study.toml"
MAX_BYTES = 150_000
WIDTH_PX, HEIGHT_PX = 1280, 720
SHIPPED = shipped_study().source_text
STEP_M = shipped_study().robot.speed_m_s * TICK_S
SHORT = {"practice = true ": "practice = false ", "pickups_per_trial = 3 ": "pickups_per_trial = 1 "}
SECOND_DEVICE = {
    **SHORT,
    'placement = "same_page_away" ': 'placement = "second_device" ',
    "first_s = 10.0": "first_s = 2.0",
}
PEOPLE = ("Tuesday, 10:00", "recruited by mail", "walk-in")


def keep(name: str, png: bytes) -> None:
    """Store a picture small enough for a repository: as it is if it may be, else with 256 colours."""
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    for chosen in (picture, with_few_colours(picture)):
        small = io.BytesIO()
        chosen.save(small, "PNG", optimize=True)
        if small.tell() <= MAX_BYTES:
            break
    else:
        raise RuntimeError(f"{name} has {small.tell()} bytes; at most {MAX_BYTES} are wanted")
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.png").write_bytes(small.getvalue())
    print(f"{name}: {small.tell() // 1000} kB", flush=True)


def with_few_colours(picture: Image.Image) -> Image.Image:
    """256 colours: most of them where most pixels are (or gradients show as rings), a few so that
    small things keep theirs."""
    common = picture.quantize(208, Image.Quantize.MEDIANCUT).getpalette() or []
    rare = picture.quantize(48, Image.Quantize.MAXCOVERAGE).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette(common[: 3 * 208] + rare[: 3 * 48])
    return picture.quantize(palette=palette, dither=Image.Dither.NONE)


class Camera:
    """A browser whose pages are photographed."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser

    def page(self) -> Page:
        """A page of somebody new."""
        context = self._browser.new_context(
            viewport={"width": WIDTH_PX, "height": HEIGHT_PX}, reduced_motion="reduce", locale="en-GB"
        )
        return context.new_page()

    def shooter(self, page: Page, wanted: Mapping[str, str]) -> Callable[[str], None]:
        """Photographs the page whenever a moment of `wanted` (moment: name of the picture) comes, once each."""
        left = dict(wanted)

        def shoot(moment: str) -> None:
            if name := left.pop(moment, None):
                for note in page.get_by_role("button", name="Dismiss").all():
                    note.click()
                page.evaluate("window.scrollTo(0, 0)")
                keep(name, page.screenshot())

        return shoot


def carrying(world: dict[str, Any], tick: dict[str, Any]) -> bool:
    """The object is held, whichever it is, and out from among the others."""
    return bool(world["held"]) and tick["instruction"]["kind"] == "dropoff" and world["position_m"][0] < 0.76


def finished(world: dict[str, Any], tick: dict[str, Any]) -> bool:
    return bool(tick["status"] == "finished")


def drive_to_the_end(person: BrowserPerson) -> None:
    """Drive until the trial is over. Where the arm can go no further, go forward and try again."""
    over = False

    def ended(world: dict[str, Any], tick: dict[str, Any]) -> bool:
        nonlocal over
        over = finished(world, tick)
        return over or bool(tick["blocked"])

    for _ in range(10):
        person.drive(Pilot(STEP_M), ended)
        if over:
            return
        person.go_to((0.70, None, None))
    raise RuntimeError("the arm is stuck")


def participant(camera: Camera, folder: Path) -> None:
    """One person on one screen: set-up, driving, a reading, the questionnaire."""
    with labs.start(folder / "one", "--study", str(write_study(folder, SHORT, SHIPPED))) as lab:
        page = camera.page()
        page.goto(lab.base_url)
        keep("front", page.screenshot())
        wanted = {"consent": "consent", "setup_gamepad": "setup", "alert": "reading", "survey": "survey"}
        person = BrowserPerson(page, STEP_M, camera.shooter(page, wanted))
        page.goto(invite(lab)["link"])
        person.come_to_the_robot("gamepad", COMPREHENSION)
        person.start()
        person.drive(Pilot(STEP_M), carrying)
        while person.answer_alert():
            person.next_tick()
        page.wait_for_timeout(400)
        keep("driving", page.screenshot())
        drive_to_the_end(person)
        person.survey()
        page.context.close()


def second_device(camera: Camera, folder: Path) -> None:
    """The readings on a device of their own, and what the experimenter sees meanwhile."""
    with labs.start(folder / "two", "--study", str(write_study(folder, SECOND_DEVICE, SHIPPED))) as lab:
        links = [invite(lab, label=label) for label in PEOPLE]
        page, panel, desk = camera.page(), camera.page(), camera.page()
        person = BrowserPerson(page, STEP_M)
        page.goto(links[0]["link"])
        person.consent()
        person.demographics()
        panel.goto(links[0]["panel_link"])
        panel.get_by_test_id("panel-start").click()
        panel.get_by_test_id("panel-heard").click()
        person.setup("keyboard")
        person.instructions(COMPREHENSION)
        person.at("drive")
        person.start()
        panel.get_by_test_id("alert-reading").wait_for(timeout=30_000)
        panel.wait_for_timeout(600)
        keep("second_device", panel.screenshot())
        desk.goto(lab.experimenter_link)
        desk.get_by_text(PEOPLE[-1]).first.wait_for(timeout=30_000)
        desk.wait_for_timeout(1500)
        keep("dashboard", desk.screenshot())
        person.hold((1, 1, 0))  # so that the belief has something to go by
        page.wait_for_timeout(3500)
        person.hold((0, 0, 0))
        desk.locator(f"[data-participant={links[0]['participant']}]").get_by_test_id("open").click()
        desk.get_by_test_id("heatmap").wait_for(timeout=30_000)
        desk.get_by_test_id("spectator-toggle").click()
        desk.get_by_test_id("spectator-frame").wait_for(timeout=30_000)
        desk.get_by_test_id("spectator-sign").wait_for(state="hidden", timeout=60_000)
        desk.wait_for_timeout(3000)  # until the objects' labels are drawn
        desk.evaluate("window.scrollTo(0, document.querySelector('.live-columns').offsetTop - 12)")
        desk.wait_for_timeout(500)
        keep("session", desk.screenshot())


def open_link(camera: Camera, folder: Path) -> None:
    """The open link of a study that recruits online."""
    with labs.start(folder / "open", "--robot", "kinematic", "--study", str(write_study(folder, OPEN, SHIPPED))) as lab:
        page = camera.page()
        page.goto(f"{lab.base_url}/join?PROLIFIC_PID=5f1e2d3c4b5a69788796a5b4&STUDY_ID=1&SESSION_ID=1")
        page.get_by_role("button", name="Begin").wait_for(timeout=30_000)
        keep("join", page.screenshot())


def report(camera: Camera, folder: Path) -> None:
    """The report of twelve simulated participants."""
    data, out = folder / "data", folder / "report"
    salab = (sys.executable, "-m", "app")
    subprocess.run([*salab, "simulate", "--participants", "12", "--workers", "2", "--out", str(data)], check=True)
    subprocess.run([*salab, "analyze", str(data), "--out", str(out)], check=True)
    page = camera.page()
    (file,) = out.glob("*.html")
    page.goto(file.as_uri())
    page.locator("svg, img").first.scroll_into_view_if_needed()
    keep("report", page.screenshot())


def layout(camera: Camera, folder: Path) -> None:
    """What `salab check` draws of a layout of one's own."""
    write_layout_picture(layout_of(open_study(EXAMPLE)), folder / "layout.png")
    keep("layout", (folder / "layout.png").read_bytes())


def looks(camera: Camera, folder: Path) -> None:
    """The robot's two looks side by side. Wants the extra `meshes`."""
    if missing := why_missing():
        raise SystemExit(f"looks: {missing}")
    page = camera.page()
    keep("looks", side_by_side(page, WHOLE))
    keep("looks_near", side_by_side(page, NEAR))
    page.context.close()


PARTS: Mapping[str, Callable[[Camera, Path], None]] = {
    "participant": participant,
    "second_device": second_device,
    "open_link": open_link,
    "report": report,
    "layout": layout,
    "looks": looks,
}


def main() -> None:
    """Take the pictures of the parts named, or of all."""
    parser = argparse.ArgumentParser(prog="python -m tests.support.take_pictures", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)}; all if none is named")
    chosen = parser.parse_args().parts or list(PARTS)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=chromium.ensure(), args=CHROMIUM_ARGUMENTS)
        for name in chosen:
            place = Path(folder) / name
            place.mkdir()
            PARTS[name](Camera(browser), place)
        browser.close()


if __name__ == "__main__":
    main()
