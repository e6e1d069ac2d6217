"""One answer of an arbiter that does not ship, for the API: in a process of its own, because whoever wrote it may do
anything, and the lab's own process serves everybody."""

from __future__ import annotations

from multiprocessing.connection import Connection

import numpy as np

from app.autonomy.actions import Direction, index_of
from app.autonomy.belief import Belief
from app.autonomy.interface import Models, State
from app.trial.parts import make_arbiter
from app.worker.process_source import ProcessSource
from study.parts.errors import PartError, one_line
from study.parts.shelf import Named

REPLY_WITHIN_S = 10.0
"""With the start of a process that need not make its imports; the answer itself is limited as in a trial."""

Question = tuple[Named, Models, State, tuple[float, ...], Direction | None]
"""Arbiter, models, state, belief after the person's action, and that action."""


def one_answer(source: ProcessSource, question: Question) -> int:
    """The index of the action it chooses when everything can be done. Blocks; raises `PartError` with one line."""
    named = question[0]
    ours, theirs = source.pipe(duplex=False)
    process = source.process(_answer, theirs, question)
    process.start()
    theirs.close()
    said: object = "gave no answer"
    with ours:
        try:
            if ours.poll(REPLY_WITHIN_S + source.allowance_s):
                said = ours.recv()
        except EOFError:
            said = "ended the process that it runs in"
    process.kill()
    process.join()
    if isinstance(said, int):
        return said
    raise PartError(f"{named.kind} {named.name!r} {said}")


def _answer(connection: Connection, question: Question) -> None:
    from app.worker.time_limit import TimeLimit

    named, models, state, probabilities, user = question
    try:
        arbiter = make_arbiter(named, models)
        with TimeLimit():
            belief = Belief(state.goal_ids, np.array(probabilities))
            chosen = index_of(arbiter.decide(state, belief, user, lambda action: True))
        connection.send(chosen)
    except BaseException as error:
        connection.send(f"raised {type(error).__name__}: {one_line(error)}")
