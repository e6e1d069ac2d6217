"""Importing this last makes all that was imported before it stay in memory that forked processes share.

A collection of garbage in one of them would else write into every object there is, and so copy them all.
"""

import gc

gc.collect()
gc.freeze()
gc.enable()  # see `app.worker.uncollected`
