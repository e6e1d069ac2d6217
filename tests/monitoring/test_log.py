"""The log: one line an event, like ones folded, and nobody in it."""

from __future__ import annotations

import asyncio
import io
import json
import logging
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from app.errors import LabError
from app.monitoring.folding import Folding
from app.monitoring.log_lines import about, cleaned
from app.monitoring.log_setup import FoldedLog, log_errors_of

WORDS = "my name is Ada and I live in Rose Street"
TOKEN = "mZ3vQpX0cT9e_u-K4y1sWq2hB7nL5dFa"


@pytest.fixture
def log() -> Iterator[Callable[..., tuple[logging.Logger, io.StringIO, FoldedLog]]]:
    """Makes a logger with a folded log of its own."""
    made: list[tuple[logging.Logger, FoldedLog]] = []

    def make(log_format: Any = "json", **options: Any) -> tuple[logging.Logger, io.StringIO, FoldedLog]:
        stream = io.StringIO()
        handler = FoldedLog(stream, log_format, **options)
        logger = logging.Logger(f"app.test{len(made)}", logging.INFO)  # outside the tree of the test's own logging
        logger.addHandler(handler)
        made.append((logger, handler))
        return logger, stream, handler

    yield make
    for _, handler in made:
        handler.close()


def lines_of(stream: io.StringIO) -> list[dict[str, Any]]:
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def fail(error: Exception) -> None:
    raise error


# ---- one line


def test_an_event_is_one_object_on_one_line(log: Callable[..., Any]) -> None:
    logger, stream, _ = log()
    logger.info("the worker hangs\nand is ended\u2028now", extra=about(participant="P001", restarts=2))
    (line,) = stream.getvalue().splitlines()
    told = json.loads(line)
    assert told.pop("time").endswith("Z")
    assert told == {
        "level": "INFO",
        "logger": "app.test0",
        "message": "the worker hangs | and is ended | now",
        "participant": "P001",
        "restarts": 2,
    }


def test_as_text_it_is_one_line_too(log: Callable[..., Any]) -> None:
    logger, stream, _ = log("text")
    logger.error("it failed", extra=about(participant="P001", reason='the disk\nis "full"'))
    (line,) = stream.getvalue().splitlines()
    assert line.partition(" ")[2] == 'ERROR app.test0: it failed participant=P001 reason="the disk | is \\"full\\""'


@pytest.mark.parametrize("log_format", ["text", "json"])
def test_a_traceback_is_one_field_with_the_way_and_no_values(log: Callable[..., Any], log_format: str) -> None:
    logger, stream, _ = log(log_format)
    try:
        try:
            fail(KeyError(WORDS))
        except KeyError as error:
            raise LabError("the database is locked") from error
    except LabError:
        logger.exception("it failed")
    (line,) = stream.getvalue().splitlines()
    assert "LabError < KeyError" in line and "the database is locked" in line
    assert "tests/monitoring/test_log.py:" in line
    assert WORDS not in line


def test_a_trace_that_never_ends_is_cut(log: Callable[..., Any]) -> None:
    def deeper() -> None:
        deeper()

    logger, stream, _ = log()
    try:
        deeper()
    except RecursionError:
        logger.exception("too deep")
    assert len(stream.getvalue()) < 3000


# ---- nobody in it


@pytest.mark.parametrize(
    "text",
    [
        f"GET /p/{TOKEN} 303",
        f"GET https://lab.example/study/d/{TOKEN}?x=1",
        f"/dashboard#token={TOKEN}",
        f"authorization: Bearer {TOKEN}",
        f"cookie: salab={TOKEN}; salab_panel={TOKEN}",
    ],
)
def test_no_token_is_written(text: str) -> None:
    assert TOKEN not in cleaned(text)


@pytest.mark.parametrize(
    "text",
    [
        "from 203.0.113.7:5044 closed",
        "peername=('2001:db8::17', 5044, 0, 0)",
        "<TransportSocket fd=9, raddr=('203.0.113.7', 5044)>",
        "2001:db8::17 asked",
        "2001:db8:0:0:1:2:3:17 asked",
    ],
)
def test_no_address_is_written(text: str) -> None:
    assert "203.0.113" not in cleaned(text) and "2001:db8" not in cleaned(text)


def test_times_and_places_are_left_as_they_are() -> None:
    for text in ("at 12:30:15 for 0.5 s", "app/session/session.py:270 _run", "version 1.1.1"):
        assert cleaned(text) == text


async def test_what_nobody_awaited_is_logged_without_its_values() -> None:
    stream = io.StringIO()
    handler = FoldedLog(stream, "json")
    loop, logger = asyncio.get_running_loop(), logging.getLogger("asyncio")
    log_errors_of(loop)

    async def fails() -> None:
        raise ValueError(WORDS)

    logger.addHandler(handler)
    try:
        task = asyncio.create_task(fails())
        await asyncio.wait([task])
        del task
        loop.call_soon(fail, ValueError(WORDS))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
    finally:
        logger.removeHandler(handler)
    told = lines_of(stream)
    assert [line["message"] for line in told] == ["Task exception was never retrieved", "Exception in callback fail"]
    assert {line["error"] for line in told} == {"ValueError"}
    assert "Rose Street" not in stream.getvalue()


# ---- folding


def test_of_many_like_lines_the_first_is_written_and_the_rest_are_counted(log: Callable[..., Any]) -> None:
    now = [0.0]
    logger, stream, handler = log(now_s=lambda: now[0])
    for number in range(50_000):
        try:
            fail(OSError(24, "Too many open files"))
        except OSError:
            logger.error("accept %d failed", number, exc_info=True)
        now[0] += 1 / 2048  # 24.4 s, in steps without a rest
    handler.close()
    told = lines_of(stream)
    assert [line.get("repeated") for line in told] == [None, 20_479, 20_480, 9_040]
    assert [line.get("within_s") for line in told[1:]] == [10.0, 10.0, 4.4]
    assert all("Too many open files" in line["reason"] for line in told)
    assert len(stream.getvalue()) < 3000


def test_what_was_counted_is_told_when_the_window_is_over_though_nothing_more_comes(log: Callable[..., Any]) -> None:
    written = threading.Event()

    class Telling(io.StringIO):
        def write(self, text: str) -> int:
            if '"repeated": 2' in text:
                written.set()
            return super().write(text)

    logger, _, handler = log(folding=Folding(window_s=0.1))
    handler._stream = Telling()
    for _ in range(3):
        logger.warning("again")
    assert written.wait(20)


def test_lines_about_different_sessions_are_not_folded_into_one(log: Callable[..., Any]) -> None:
    logger, stream, _ = log()
    for participant in ("P001", "P002", "P001"):
        logger.error("it failed", extra=about(participant=participant))
    assert [line["participant"] for line in lines_of(stream)] == ["P001", "P002"]


def test_a_flood_of_lines_that_all_differ_is_bounded(log: Callable[..., Any]) -> None:
    now = [0.0]
    logger, stream, handler = log(now_s=lambda: now[0])
    for number in range(10_000):
        logger.error(f"a library's own words {number}")
    handler.close()
    told = lines_of(stream)
    assert len(told) == 101
    assert told[-1]["repeated"] == 9_900 and "left out" in told[-1]["message"]


def test_a_kind_that_has_stopped_is_written_at_once_when_it_comes_back(log: Callable[..., Any]) -> None:
    now = [0.0]
    logger, stream, _ = log(now_s=lambda: now[0])
    logger.error("locked")
    now[0] = 10.5
    logger.error("locked")
    assert len(lines_of(stream)) == 2


def test_a_log_that_cannot_be_written_stops_nothing(log: Callable[..., Any]) -> None:
    class Full(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(28, "No space left on device")

    logger, _, handler = log()
    handler._stream = Full()
    for _ in range(3):
        logger.error("it failed")
