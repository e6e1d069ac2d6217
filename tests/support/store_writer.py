"""Run as a process of its own by `test_store`: writes ticks for ever and prints each one that is on disk."""

from __future__ import annotations

import sys

from study.store import open_store
from tests.support.study_samples import append_tick, tick_row

if __name__ == "__main__":
    with open_store(sys.argv[1], exclusive=True) as store:
        number = 0
        while True:
            append_tick(store, tick_row(sys.argv[2], tick=number))
            print(number, flush=True)
            number += 1
