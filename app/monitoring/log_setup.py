"""What goes to the log of a process: what `logging`, asyncio, threads and warnings say, one line an event."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any, TextIO

from app.monitoring.folding import Folding
from app.monitoring.log_lines import FORMATS, LogFormat, LogLine, key_of, line_of

OURS = ("app", "sim", "study")
"""Of these the log has what happens; of libraries, what is wrong."""

log = logging.getLogger(__name__)


class FoldedLog(logging.Handler):
    """Writes lines to a stream, like ones folded. Never raises and never waits for anything but the stream."""

    def __init__(
        self,
        stream: TextIO,
        log_format: LogFormat = "text",
        folding: Folding[logging.LogRecord] | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__()
        self._stream = stream
        self._as_line = FORMATS[log_format]
        self._folding = folding or Folding()
        self._now_s = now_s
        self._flusher: threading.Thread | None = None

    def emit(self, record: logging.LogRecord) -> None:
        """Write it or count it."""
        try:
            now_s = self._now_s()
            self._write_due(now_s)
            if self._folding.take(key_of(record), record, now_s):
                self._write(line_of(record))
            elif self._flusher is None:
                self._flusher = threading.Thread(target=self._flush_later, name="log", daemon=True)
                self._flusher.start()
        except Exception:
            self.handleError(record)

    def handleError(self, record: logging.LogRecord) -> None:
        """A log that cannot be written (its disk is full, its reader gone) must not stop what it tells of."""

    def close(self) -> None:
        """Write what was counted."""
        with contextlib.suppress(Exception), self.lock or contextlib.nullcontext():
            self._write_due(self._now_s(), all_of_them=True)
        super().close()

    def _write_due(self, now_s: float, all_of_them: bool = False) -> None:
        for folded in self._folding.due(now_s, all_of_them):
            line = line_of(folded.last)
            if folded.is_rest:
                level, name = line.level, log.name
                line = LogLine(line.time_unix_s, level, name, "lines of other kinds were left out, there were too many")
            self._write(line.repeated(folded.count, folded.within_s))

    def _write(self, line: LogLine) -> None:
        self._stream.write(self._as_line(line) + "\n")
        self._stream.flush()

    def _flush_later(self) -> None:
        """The thread that tells what was counted once its window is over; it ends when nothing is."""
        while True:
            with self.lock or contextlib.nullcontext():
                with contextlib.suppress(Exception):
                    self._write_due(self._now_s())
                next_s = self._folding.next_s()
                if next_s is None:
                    self._flusher = None
                    return
            time.sleep(max(0.05, next_s - self._now_s()))


def set_up_logging(log_format: LogFormat, stream: TextIO | None = None) -> FoldedLog:
    """Have this process log to the stream (standard error), and nowhere else."""
    handler = FoldedLog(sys.stderr if stream is None else stream, log_format)
    root = logging.getLogger()
    for other in tuple(root.handlers):
        root.removeHandler(other)
    root.addHandler(handler)
    root.setLevel(logging.WARNING)
    for name in OURS:
        logging.getLogger(name).setLevel(logging.INFO)
    logging.captureWarnings(True)
    sys.excepthook = _uncaught
    threading.excepthook = lambda raised: _uncaught(raised.exc_type, raised.exc_value, raised.exc_traceback)
    sys.unraisablehook = lambda raised: _uncaught(raised.exc_type, raised.exc_value, raised.exc_traceback)
    return handler


def end_with_whole_log(handler: FoldedLog) -> None:
    """Have what was counted written when the process is told to end, of which it then ends as always."""

    def end(number: int, _: FrameType | None) -> None:
        handler.close()
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)

    signal.signal(signal.SIGTERM, end)


def log_errors_of(loop: asyncio.AbstractEventLoop) -> None:
    """Have what nobody awaited logged without the values that asyncio would print with it."""
    loop.set_exception_handler(_of_the_loop)


def _of_the_loop(_: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    error = context.get("exception")
    message = str(context["message"])
    if message.startswith("Exception in callback"):
        message = message.partition("(")[0]  # what it was called with
    logging.getLogger("asyncio").error(message, exc_info=error if isinstance(error, BaseException) else None)


def _uncaught(kind: type[BaseException], error: BaseException | None, trace: TracebackType | None) -> None:
    if issubclass(kind, (KeyboardInterrupt, SystemExit)):
        return
    raised = error if error is not None else kind()
    log.critical("an error was caught by nobody", exc_info=(kind, raised, trace))
