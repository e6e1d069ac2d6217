"""The line between lab and worker, without what `multiprocessing` does around each message.

A message is pickled as any other object is: nothing in one needs the ways that `multiprocessing` has for locks and
sockets, and looking for them takes longer than the pickling. Waiting is by `select`, which is exact: ticks begin by it,
and `Connection.poll` wakes up to a millisecond late.
"""

from __future__ import annotations

import pickle
import select
import sys
from multiprocessing.connection import Connection
from typing import Any

MOST_SELECTED = 1024
"""The numbers of files that `select` takes are below it."""


def packed(message: object) -> bytes:
    """A message as it goes over the line."""
    return pickle.dumps(message, pickle.HIGHEST_PROTOCOL)


def takes(connection: Connection) -> bool:
    """Whether a short message can be sent without waiting. Linux says so of a socket whose buffer is a quarter full at
    most; elsewhere it is not known."""
    if sys.platform != "linux" or connection.fileno() >= MOST_SELECTED:
        return False
    return bool(select.select((), (connection,), (), 0.0)[1])


class Line:
    """A worker's end. Used as a `Connection` is, by one thread; the other end is one."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def send(self, message: object) -> None:
        """Send a message. Raises `OSError`."""
        self._connection.send_bytes(packed(message))

    def recv(self) -> Any:
        """The next message. Raises `EOFError` at the end of the line, and `OSError`."""
        return self._connection.recv()

    def poll(self, wait_s: float = 0.0) -> bool:
        """Whether a message comes within that time, or the end of the line."""
        if sys.platform == "win32" or self._connection.fileno() >= MOST_SELECTED:
            return self._connection.poll(wait_s)
        return bool(select.select((self._connection,), (), (), wait_s)[0])

    def close(self) -> None:
        """Nobody speaks on it any more."""
        self._connection.close()
