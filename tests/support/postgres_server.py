"""A PostgreSQL server of the tests' own: on a private socket, without TCP, as somebody without rights.

`python -m tests.support.postgres_server` says aloud when there is none. With SALAB_REQUIRE_POSTGRES=1, as `.ci/run`
sets it, it installs one from the system's packages, and fails when it cannot; so does a test that needs it.
`SALAB_POSTGRES_BIN` names the folder of its programs where they are neither on PATH nor where Debian puts them.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.support import system_packages

PACKAGES = ("postgresql",)
DEBIAN = Path("/usr/lib/postgresql")
WITHIN_S = 30
NOBODY = ("postgres", "nobody")
"""Who the server runs as where the tests run as root, who may not: the first that there is."""


class NoPostgres(Exception):
    """Why there is no server."""


def is_required(environment: Mapping[str, str]) -> bool:
    return environment.get("SALAB_REQUIRE_POSTGRES", "") not in ("", "0")


def find(environment: Mapping[str, str] = os.environ) -> Path:
    """The folder of its programs. Raises `NoPostgres`."""
    try:
        import psycopg  # noqa: F401
    except ImportError:
        raise NoPostgres("psycopg is not installed: pip install -e '.[postgres]'") from None
    named = environment.get("SALAB_POSTGRES_BIN")
    on_path = shutil.which("initdb", path=environment.get("PATH"))
    places = [
        *([Path(named)] if named else []),
        *([Path(on_path).resolve().parent] if on_path else []),
        *sorted(DEBIAN.glob("*/bin"), reverse=True),
    ]
    for place in places:
        if all((place / name).is_file() for name in ("initdb", "postgres", "pg_ctl")):
            return place
    raise NoPostgres(f"no PostgreSQL server is installed (Debian, Ubuntu: apt-get install {' '.join(PACKAGES)})")


class PostgresServer:
    """A running server. Made by `start`.

    Attributes:
        folder: where its socket is.
    """

    def __init__(self, programs: Path, folder: Path, settings: Sequence[str] = ()) -> None:
        self.folder = folder
        self._programs = programs
        self._data = folder / "data"
        self._settings = settings
        self._numbers = itertools.count()

    def make(self) -> None:
        """Its files, which nobody but it can read."""
        self.folder.chmod(0o755)
        self._data.mkdir()
        if os.geteuid() == 0:
            os.chown(self._data, *_unprivileged())
            os.chown(self.folder, *_unprivileged())
        self._run("initdb", "-D", self._data, "-A", "trust", "-U", "lab", "-E", "UTF8", "--locale=C", "--no-sync")

    def start(self) -> None:
        """Wait until it takes connections."""
        options = " ".join(["-c listen_addresses=''", f"-k {self.folder}", *self._settings])
        self._run("pg_ctl", "-D", self._data, "-w", "-t", WITHIN_S, "-l", self.folder / "log", "-o", options, "start")

    def stop(self, mode: str = "fast") -> None:
        """`fast` ends what others are at, `immediate` is as if it were killed."""
        self._run("pg_ctl", "-D", self._data, "-w", "-t", WITHIN_S, "-m", mode, "stop")

    def database(self, like: str = "template0") -> str:
        """The name of a new one, with all that another one holds."""
        name = f"test{next(self._numbers)}"
        self.run(f"CREATE DATABASE {name} TEMPLATE {like}")
        return name

    def ask_for_passwords(self, user: str) -> None:
        """From now on of this user."""
        rules = self._data / "pg_hba.conf"
        rules.write_text(f"local all {user} scram-sha-256\n{rules.read_text()}")
        self.run("SELECT pg_reload_conf()")

    def url(self, database: str, user: str = "lab", password: str = "") -> str:
        """Its address, as the lab takes it."""
        who = f"{user}:{password}" if password else user
        return f"postgresql+psycopg://{who}@/{database}?host={self.folder}"

    def run(self, statement: str, database: str = "postgres") -> list[Any]:
        """What a statement finds."""
        import psycopg

        with psycopg.connect(host=str(self.folder), user="lab", dbname=database, autocommit=True) as connection:
            cursor = connection.execute(statement)
            return cursor.fetchall() if cursor.description else []

    def _run(self, program: str, *arguments: object) -> None:
        done = subprocess.run(
            [str(self._programs / program), *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE if program == "initdb" else subprocess.DEVNULL,
            stderr=subprocess.STDOUT if program == "initdb" else subprocess.DEVNULL,
            cwd=self.folder,
            env={"PATH": os.environ["PATH"], "LC_ALL": "C"},
            preexec_fn=_give_up_rights(),
            check=False,
            timeout=2 * WITHIN_S,
        )
        if done.returncode:
            log = self.folder / "log"
            said = (done.stdout or b"").decode(errors="replace") + (log.read_text() if log.is_file() else "")
            raise AssertionError(f"{program} ended with {done.returncode}: {said[-2000:]}")


def start(settings: Sequence[str] = ()) -> PostgresServer:
    """A new one. Its folder's name is short: the path of a socket has about a hundred characters at most."""
    server = PostgresServer(find(), Path(tempfile.mkdtemp(prefix="pg", dir="/tmp")), settings)
    server.make()
    server.start()
    return server


def remove(server: PostgresServer) -> None:
    """End it, and take its files away."""
    try:
        with contextlib.suppress(AssertionError):  # it is stopped
            server.stop("immediate")
    finally:
        shutil.rmtree(server.folder, ignore_errors=True)


def _unprivileged() -> tuple[int, int]:
    import pwd  # which Windows has not

    for name in NOBODY:
        try:
            found = pwd.getpwnam(name)
        except KeyError:
            continue
        return found.pw_uid, found.pw_gid
    raise NoPostgres(f"there is no user {' or '.join(NOBODY)} for the server to run as")


def _give_up_rights() -> Callable[[], None] | None:
    if os.geteuid() != 0:
        return None
    user, group = _unprivileged()

    def give_up() -> None:
        os.setgroups([])
        os.setgid(group)
        os.setuid(user)

    return give_up


def main(environment: Mapping[str, str]) -> int:
    """Look whether there is one, and install it where it is required. The exit code."""
    try:
        find(environment)
        return 0
    except NoPostgres as error:
        why = str(error)
    if is_required(environment):
        try:
            system_packages.install("PostgreSQL", *PACKAGES, environment=environment)
            find(environment)
            return 0
        except (system_packages.NotInstalled, NoPostgres) as error:
            why = f"{why}; {error}"
    print(f"== PostgreSQL NOT tested: {why}", flush=True)
    return 1 if is_required(environment) else 0


if __name__ == "__main__":
    sys.exit(main(os.environ))
