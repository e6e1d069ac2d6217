"""Keys as a person presses them: through an X server of its own, with repeats, menus and focus, to a headed Chromium.

What a test framework sends goes to the page alone: no menu opens, nothing repeats, and no release gets lost.

`python -m tests.support.real_keys` says aloud when they cannot be had. With SALAB_REQUIRE_KEYS=1, as `.ci/run` sets it,
it installs what is missing from the system's packages, and fails when it cannot; so does a test that needs them.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from types import TracebackType

from tests.support import system_packages

PACKAGES = ("xvfb", "libxtst6")
HOW_TO = f"Debian, Ubuntu: apt-get install {' '.join(PACKAGES)}"
SYMS = {"Return": 0xFF0D, "Menu": 0xFF67, "Escape": 0xFF1B, "space": 0x20, "Tab": 0xFF09, "Down": 0xFF54}


class NoDisplay(RuntimeError):
    """There is no Xvfb, or no X test extension: the text says which."""


def are_required(environment: Mapping[str, str]) -> bool:
    return environment.get("SALAB_REQUIRE_KEYS", "") not in ("", "0")


def find(environment: Mapping[str, str]) -> tuple[str, ctypes.CDLL, ctypes.CDLL]:
    """The X server, and the libraries that speak with it and press its keys.

    Raises:
        NoDisplay: one of them is missing.
    """
    xvfb = shutil.which("Xvfb", path=environment.get("PATH"))
    if xvfb is None:
        raise NoDisplay(f"no Xvfb on PATH ({HOW_TO})")
    try:
        return xvfb, ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
    except OSError as error:
        raise NoDisplay(f"{error} ({HOW_TO})") from error


class RealKeys:
    """An X server without a screen, and a hand on its keyboard and mouse."""

    def __enter__(self) -> RealKeys:
        xvfb, self._x, self._test = find(os.environ)
        readable, writable = os.pipe()
        command = [xvfb, "-displayfd", str(writable), "-screen", "0", "1400x900x24", "-nolisten", "tcp"]
        self._server = subprocess.Popen(command, pass_fds=[writable], stderr=subprocess.DEVNULL)
        os.close(writable)
        with os.fdopen(readable) as pipe:
            number = pipe.readline().strip()
        if number == "":
            raise NoDisplay(f"{xvfb} ended with {self._server.wait(10)} before it had a display")
        self.display = f":{number}"
        self._x.XOpenDisplay.restype = ctypes.c_void_p
        self._x.XKeysymToKeycode.argtypes = [ctypes.c_void_p, ctypes.c_ulong]
        self._connection = ctypes.c_void_p(self._x.XOpenDisplay(self.display.encode()))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._x.XCloseDisplay(self._connection)
        self._server.terminate()
        self._server.wait(10)

    def down(self, key: str) -> None:
        """Presses a key, which then repeats as the server's keyboard does."""
        self._key(key, True)

    def up(self, key: str) -> None:
        self._key(key, False)

    def press(self, key: str) -> None:
        self.down(key)
        self.up(key)

    def click(self, x_px: int, y_px: int, button: int = 1) -> None:
        """A click of the mouse: 1 left, 3 right."""
        self._test.XTestFakeMotionEvent(self._connection, -1, x_px, y_px, 0)
        for pressed in (1, 0):
            self._test.XTestFakeButtonEvent(self._connection, button, pressed, 0)
        self._x.XSync(self._connection, 0)

    def _key(self, key: str, pressed: bool) -> None:
        symbol = SYMS.get(key) or ord(key)
        code = self._x.XKeysymToKeycode(self._connection, symbol)
        self._test.XTestFakeKeyEvent(self._connection, code, int(pressed), 0)
        self._x.XSync(self._connection, 0)


def main(environment: Mapping[str, str]) -> int:
    """Whether real keys can be had, after installing what is missing where they are required. The exit code."""
    required = are_required(environment)
    try:
        try:
            find(environment)
        except NoDisplay as missing:
            if not required:
                raise
            try:
                system_packages.install("an X server for real keys", *PACKAGES, environment=environment)
            except system_packages.NotInstalled as error:
                raise NoDisplay(f"{missing}; {error}") from error
            find(environment)
    except NoDisplay as error:
        print(f"== real keys NOT tested: {error}", flush=True)
        return 1 if required else 0
    return 0


if __name__ == "__main__":
    sys.exit(main(os.environ))
