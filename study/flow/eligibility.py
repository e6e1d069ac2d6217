"""Whether a device fits the study: what its page reports and what the lab measured, against the study file's rules.

All but the round trip is the page's own word. Whoever forges it gets into a study that will not work for them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from study.definition.sections import Browser, Eligibility
from study.language.words import ENGLISH, Words

Check = Literal["browser", "touch", "window", "webgl", "round_trip", "gamepad", "sound"]
CHECKS: tuple[Check, ...] = get_args(Check)

PINGS = 11
"""Round trips a median is taken of."""
LEAST_TONES, MOST_TONES = 2, 5
TONE_TRIES = 16
_BROWSERS: Mapping[Browser, tuple[str, ...]] = {
    "edge": ("Edg/", "EdgA/", "EdgiOS/"),
    "opera": ("OPR/", "OPX/"),
    "firefox": ("Firefox/", "FxiOS/"),
    "chrome": ("Chrome/", "Chromium/", "CriOS/"),
    "safari": ("Safari/",),
}
"""What each says of itself. The order matters: Edge and Opera also claim to be Chrome, and Chrome to be Safari."""


@dataclass(frozen=True)
class Device:
    """What a page reports of its device; None where it was not asked. Lengths are CSS pixels."""

    user_agent: str = ""
    has_touch_only: bool | None = None
    width_px: int | None = None
    height_px: int | None = None
    has_webgl: bool | None = None
    is_secure: bool | None = None
    """Loaded over HTTPS or from this machine: browsers give gamepads to no other page."""
    pad_id: str | None = None
    """The gamepad on which a button was pressed."""
    tones: int | None = None
    """How many were counted, of those that `tones_of` names for this try."""
    tone_try: int = 0


@dataclass(frozen=True)
class Shortcoming:
    """Something the device lacks: what was found and what would mend it, in one text for the participant."""

    check: Check
    text: str


USER_AGENTS: Mapping[Browser, str] = {name: f"{marks[0]}1.0" for name, marks in _BROWSERS.items()}
"""The least that each says of itself, for scripted clients."""


def checks_of(rules: Eligibility) -> tuple[Check, ...]:
    """What is asked for, in the order it is shown. A gamepad that is only preferred is asked for and never missed."""
    asked: Mapping[Check, bool] = {
        "browser": bool(rules.browsers),
        "touch": rules.keyboard_or_mouse,
        "window": rules.min_window_width_px > 0 or rules.min_window_height_px > 0,
        "webgl": rules.webgl,
        "round_trip": rules.max_round_trip_ms > 0,
        "gamepad": rules.gamepad != "any",
        "sound": rules.sound,
    }
    return tuple(check for check in CHECKS if asked[check])


def tones_of(public_id: str) -> tuple[int, ...]:
    """How many tones each try plays, the same whenever it is asked."""
    digest = hashlib.sha256(f"tones {public_id}".encode()).digest()
    return tuple(LEAST_TONES + byte % (MOST_TONES - LEAST_TONES + 1) for byte in digest[:TONE_TRIES])


def browser_of(user_agent: str) -> Browser | None:
    """Which browser says this of itself; None for one that is not known here."""
    return next((name for name, marks in _BROWSERS.items() if any(mark in user_agent for mark in marks)), None)


def shortcomings(
    rules: Eligibility,
    device: Device,
    round_trip_ms: float | None,
    tones: tuple[int, ...],
    words: Words = ENGLISH,
) -> tuple[Shortcoming, ...]:
    """Everything the device lacks. `round_trip_ms` is the median the lab measured, None = not measured yet."""
    judges: Mapping[Check, Callable[[], str | None]] = {
        "browser": lambda: _browser(rules, device, words),
        "touch": lambda: _touch(device, words),
        "window": lambda: _window(rules, device, words),
        "webgl": lambda: _webgl(device, words),
        "round_trip": lambda: _round_trip(rules, round_trip_ms, words),
        "gamepad": lambda: _gamepad(device, words) if rules.gamepad == "required" else None,
        "sound": lambda: _sound(device, tones, words),
    }
    found = [(check, judges[check]()) for check in checks_of(rules)]
    return tuple(Shortcoming(check, text) for check, text in found if text)


def _browser(rules: Eligibility, device: Device, words: Words) -> str | None:
    name = browser_of(device.user_agent)
    if name in rules.browsers:
        return None
    wanted = words.either([browser.capitalize() for browser in rules.browsers])
    if name:
        return words.t(
            "This is {browser}. Please open the same link in {wanted}.", browser=name.capitalize(), wanted=wanted
        )
    return words.t("The study was not tried in this browser. Please open the same link in {wanted}.", wanted=wanted)


def _touch(device: Device, words: Words) -> str | None:
    if device.has_touch_only is False:
        return None
    return words.t("This device has only a touch screen. Please open the same link on a computer with a keyboard.")


def _window(rules: Eligibility, device: Device, words: Words) -> str | None:
    width, height = device.width_px or 0, device.height_px or 0
    if width >= rules.min_window_width_px and height >= rules.min_window_height_px:
        return None
    least_width, least_height = rules.min_window_width_px, rules.min_window_height_px
    if not least_height:
        return words.t(
            "The page is {width} pixels wide, and the study needs {least_width}. Enlarge the window, or zoom out (Ctrl "
            "and −), and check again.",
            width=width,
            least_width=least_width,
        )
    if not least_width:
        return words.t(
            "The page is {height} pixels high, and the study needs {least_height}. Enlarge the window, or zoom out "
            "(Ctrl and −), and check again.",
            height=height,
            least_height=least_height,
        )
    return words.t(
        "The page is {width} × {height} pixels large, and the study needs {least_width} × {least_height}. Enlarge the "
        "window, or zoom out (Ctrl and −), and check again.",
        width=width,
        height=height,
        least_width=least_width,
        least_height=least_height,
    )


def _webgl(device: Device, words: Words) -> str | None:
    if device.has_webgl:
        return None
    return words.t(
        "This browser draws no 3-D graphics (WebGL). Turn on hardware acceleration in its settings, or open the same "
        "link in another browser."
    )


def _round_trip(rules: Eligibility, round_trip_ms: float | None, words: Words) -> str | None:
    if round_trip_ms is None:
        return words.t("The connection could not be measured. Keep this page in front, and check again.")
    if round_trip_ms <= rules.max_round_trip_ms:
        return None
    return words.t(
        "The way to the robot and back takes {took} ms, and at most {most} ms are possible. A cable, a place nearer to "
        "the router, no VPN, or ending downloads and video calls may help; then check again.",
        took=round(round_trip_ms),
        most=rules.max_round_trip_ms,
    )


def _gamepad(device: Device, words: Words) -> str | None:
    if device.is_secure is False:
        return words.t(
            "This page was not loaded over HTTPS, and browsers then give it no gamepad. You cannot mend that; please "
            "tell the person who gave you the link."
        )
    if device.pad_id:
        return None
    return words.t("No gamepad was found. Connect one, press any of its buttons, and check again.")


def _sound(device: Device, tones: tuple[int, ...], words: Words) -> str | None:
    if device.tones is None:
        return words.t("Play the tones, and choose how many you heard.")
    if device.tones == tones[device.tone_try % len(tones)]:
        return None
    return words.t(
        "That was not the number of tones. Turn up the volume or plug in headphones, play them again, and count."
    )
