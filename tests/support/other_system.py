"""A Python that, to the lab's own code, looks like the one of Windows: what only Unix has is not there.

    python -m tests.support.other_system modules          import every module of the lab, and say which cannot be
    python -m tests.support.other_system app serve ...    run the command line

Other people's code and the standard library keep all that they need. Processes that the lab starts are such Pythons
too: `spawn` imports the main module, which is this one.
"""

from __future__ import annotations

import asyncio
import builtins
import importlib
import pkgutil
import runpy
import sys
import traceback
from types import ModuleType
from typing import Any

OURS = ("app", "sim", "study", "docs")
GONE_MODULES = frozenset(
    {"crypt", "fcntl", "grp", "nis", "posix", "pty", "pwd", "readline", "resource", "spwd", "syslog", "termios", "tty"}
    | {"multiprocessing.forkserver", "multiprocessing.popen_fork", "multiprocessing.popen_forkserver"}
)
OTHER_NAMES: dict[str, dict[str, Any]] = {
    "os": {"name": "nt"},
    "multiprocessing": {"get_all_start_methods": lambda: ["spawn"]},
}
GONE_NAMES: dict[str, frozenset[str]] = {
    "os": frozenset(
        {"fork", "forkpty", "getuid", "geteuid", "getgid", "getegid", "getgroups", "getpgid", "getpgrp", "killpg"}
        | {"setsid", "setpgid", "setuid", "setgid", "nice", "getpriority", "setpriority", "sysconf", "confstr", "uname"}
        | {"O_DIRECTORY", "O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_TMPFILE", "O_SYNC", "O_DSYNC", "mkfifo", "mknod"}
        | {"chown", "fchown", "lchown", "chroot", "getloadavg", "sched_getaffinity", "sched_setaffinity", "statvfs"}
        | {"wait", "wait3", "wait4", "waitid", "WNOHANG", "pidfd_open", "register_at_fork", "posix_spawn", "openpty"}
        | {"memfd_create", "eventfd", "sendfile", "posix_fadvise", "posix_fallocate", "pread", "pwrite", "ctermid"}
    ),
    "signal": frozenset(
        {"SIGKILL", "SIGALRM", "SIGSTOP", "SIGCONT", "SIGTSTP", "SIGHUP", "SIGCHLD", "SIGPIPE", "SIGQUIT", "SIGUSR1"}
        | {"SIGUSR2", "alarm", "pause", "setitimer", "getitimer", "ITIMER_REAL", "pthread_kill", "pthread_sigmask"}
        | {"sigwait", "sigwaitinfo", "sigpending", "siginterrupt"}
    ),
    "socket": frozenset({"AF_UNIX", "AF_NETLINK", "AF_PACKET", "SO_REUSEPORT"}),
    "select": frozenset({"poll", "epoll", "kqueue"}),
    "time": frozenset({"tzset", "clock_gettime", "pthread_getcpuclockid"}),
    "ctypes": frozenset({"CDLL"}),
    "multiprocessing": frozenset(),
    "multiprocessing.context": frozenset({"ForkContext", "ForkProcess", "ForkServerContext", "ForkServerProcess"}),
}

_import = builtins.__import__


class _Other(ModuleType):
    """A module as our code sees it there."""

    def __init__(self, real: ModuleType) -> None:
        super().__init__(real.__name__, real.__doc__)
        _inside(self)["_real"] = real

    def __getattribute__(self, name: str) -> Any:
        real: ModuleType = _inside(self)["_real"]
        called = real.__name__
        if name in GONE_NAMES[called] or f"{called}.{name}" in GONE_MODULES:
            raise AttributeError(f"module {called!r} has no attribute {name!r} (on this other system)")
        if name in OTHER_NAMES.get(called, ()):
            return OTHER_NAMES[called][name]
        found = getattr(real, name)
        return _Other(found) if isinstance(found, ModuleType) and found.__name__ in GONE_NAMES else found

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(_inside(self)["_real"], name, value)


def _inside(module: ModuleType) -> dict[str, Any]:
    found: dict[str, Any] = object.__getattribute__(module, "__dict__")
    return found


def is_ours(name: str) -> bool:
    return name.partition(".")[0] in OURS


def other_import(name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0) -> ModuleType:
    importer = str((globals or {}).get("__name__", ""))
    if level or not is_ours(importer):
        return _import(name, globals, locals, fromlist, level)
    if name in GONE_MODULES:
        raise ModuleNotFoundError(f"No module named {name!r} (on this other system)", name=name)
    module = _import(name, globals, locals, fromlist, level)
    return _Other(module) if module.__name__ in GONE_NAMES else module


def refuse_proc(event: str, arguments: tuple[Any, ...]) -> None:
    """No file of the kernel's is opened by us; psutil and the standard library do as they like."""
    if event != "open" or not str(arguments[0]).startswith("/proc/"):
        return
    frame = sys._getframe(1)
    while frame is not None:
        opener = str(frame.f_globals.get("__name__", ""))
        if is_ours(opener):
            raise FileNotFoundError(2, "No such file or directory (on this other system)", arguments[0])
        if opener.partition(".")[0] not in ("pathlib", "io", "codecs", __name__.partition(".")[0]):
            return
        frame = frame.f_back  # type: ignore[assignment]


def no_reader(self: Any, *_: object) -> None:
    raise NotImplementedError  # as the event loop of Windows has it


def become_other() -> None:
    """From here on, for this process and those it spawns."""
    builtins.__import__ = other_import
    asyncio.SelectorEventLoop.add_reader = no_reader  # type: ignore[method-assign, assignment]
    sys.addaudithook(refuse_proc)


def still_there() -> list[str]:
    """What our code would find all the same."""
    found = []
    gone = [f"import {module}" for module in sorted(GONE_MODULES)]
    gone += [f"from {module} import {name}" for module, names in GONE_NAMES.items() for name in sorted(names)]
    gone += [f"import {module}; {module}.{name}" for module, names in GONE_NAMES.items() for name in sorted(names)]
    for line in [*gone, "open('/proc/self/stat')", "import pathlib; pathlib.Path('/proc/self/stat').read_text()"]:
        try:
            exec(line, {"__name__": "app.probe"})
        except (ImportError, AttributeError, FileNotFoundError):
            continue
        found.append(f"{line}: works")
    return found


def failures() -> list[str]:
    """What cannot be imported, and why."""
    found = []
    for package in ("app", "sim", "study"):
        for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
            if module.name == "app.__main__" or ".revisions." in module.name:
                continue  # the first runs, and what is in the folder of revisions is Alembic's to import
            try:
                importlib.import_module(module.name)
            except Exception:
                found.append(f"{module.name}: {traceback.format_exc().splitlines()[-1]}")
    return found


if __name__ in ("__main__", "__mp_main__"):
    become_other()

if __name__ == "__main__":
    if sys.argv[1:] == ["modules"]:
        found = [*still_there(), *failures()]
        print(*found, sep="\n", end="")
        sys.exit(bool(found))
    else:
        del sys.argv[0]
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
