"""Installs packages of the system that tests need: with apt-get, as root or through sudo."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping


class NotInstalled(RuntimeError):
    """They could not be installed; the text says why."""


def install(what: str, *packages: str, environment: Mapping[str, str]) -> None:
    """Install `packages`, which are `what` a person would call it.

    Raises:
        NotInstalled: there is no apt-get here, or it failed.
    """
    apt = shutil.which("apt-get", path=environment.get("PATH"))
    if apt is None:
        raise NotInstalled("there is no apt-get here")
    become_root = [] if os.geteuid() == 0 else ["sudo", "-n", "env", "DEBIAN_FRONTEND=noninteractive"]
    ours = {**environment, "DEBIAN_FRONTEND": "noninteractive"}
    quiet = [*become_root, apt, "-qq"]
    for command in ([*quiet, "update"], [*quiet, "install", "-y", "--no-install-recommends", *packages]):
        print(f"installing {what}:", " ".join(command), flush=True)
        try:
            failed = subprocess.run(command, env=ours).returncode != 0
        except OSError:  # there is no sudo
            failed = True
        if failed:
            raise NotInstalled(f"this failed: {' '.join(command)}")
