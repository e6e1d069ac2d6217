"""The store: the only room that opens a database, SQLite in the lab's data folder, through SQLAlchemy.

The rest of the project uses the names below and nothing further in. Where to look:

    store         `Store`: everything the lab asks of its data; each method that writes is one transaction
    async_store   a store for asyncio code, which tries again while the disk does not do
    writing       the one thread that writes: what waits together is committed together
    condition     what the disk can do to a store, and what helps
    rescue        a copy of a database whose file is gone
    fingerprint   the machine and the versions that data were recorded on
    place         where data are: a folder, or the address of a database and a folder for the rest
    database      one opened database: versions, transactions, what it says
    backend       what a kind of database must be able to do
    sqlite_file   the file: lock, damage, durability
    postgres      the server: lock, durability, what it says
    unknown       batches of which nobody knows whether the server committed them
    numbering     numbers of participants, none of which is given out twice
    migration     versions of the file, and how an older one becomes this one
    tables        what stands in the file
    rows          a recorded row as SQLite takes it
    statements    statements of every tick, put into words once
    ledger        what a transaction wrote, and the links of the chain made of it
    certificates  what there was of somebody who has ended, signed
    page_sums     checksums of the pages while no lab runs
    backup        a copy of the data folder while a lab runs, and the way back
    whole         a folder that is there whole or not at all
    copying       from a data folder into a database on a server, and back
    reading       a database as it stands, for its verification
    verification  whether a data folder holds what was recorded
    participants  who takes part: order, session, tokens, identities, the cell given out again
    progress      what a session has reached: its state, answered messages, starts of cycles
    snapshot      what was recorded, as of one moment
    erasure       deleting somebody, and the mark that stays
    values        what the store hands out, and its error
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from study.store.async_store import AsyncStore
    from study.store.backup import back_up, restore
    from study.store.condition import WHAT_TO_DO, StoreTroubled, Trouble, TroubleKind
    from study.store.copying import Copied, copy
    from study.store.fingerprint import fingerprint_id, machine_fingerprint
    from study.store.place import DataPlace, checked_url, handed_over, is_url, place_of
    from study.store.snapshot import Snapshot
    from study.store.sqlite_file import is_in_use
    from study.store.store import Store, open_store
    from study.store.values import (
        Batch,
        ConsentGiven,
        Cycle,
        Identity,
        SessionUnreadable,
        StoredSession,
        StoreError,
        Submission,
        UnreadableSession,
    )
    from study.store.verification import verify_data

__all__ = [
    "WHAT_TO_DO",
    "AsyncStore",
    "Batch",
    "ConsentGiven",
    "Copied",
    "Cycle",
    "DataPlace",
    "Identity",
    "SessionUnreadable",
    "Snapshot",
    "Store",
    "StoreError",
    "StoreTroubled",
    "StoredSession",
    "Submission",
    "Trouble",
    "TroubleKind",
    "UnreadableSession",
    "back_up",
    "checked_url",
    "copy",
    "fingerprint_id",
    "handed_over",
    "is_in_use",
    "is_url",
    "machine_fingerprint",
    "open_store",
    "place_of",
    "restore",
    "verify_data",
]

_MODULES = {
    "AsyncStore": "study.store.async_store",
    "Batch": "study.store.values",
    "ConsentGiven": "study.store.values",
    "Copied": "study.store.copying",
    "Cycle": "study.store.values",
    "DataPlace": "study.store.place",
    "Identity": "study.store.values",
    "SessionUnreadable": "study.store.values",
    "Snapshot": "study.store.snapshot",
    "Store": "study.store.store",
    "StoreError": "study.store.values",
    "StoreTroubled": "study.store.condition",
    "StoredSession": "study.store.values",
    "Submission": "study.store.values",
    "Trouble": "study.store.condition",
    "TroubleKind": "study.store.condition",
    "UnreadableSession": "study.store.values",
    "WHAT_TO_DO": "study.store.condition",
    "back_up": "study.store.backup",
    "fingerprint_id": "study.store.fingerprint",
    "checked_url": "study.store.place",
    "copy": "study.store.copying",
    "handed_over": "study.store.place",
    "is_in_use": "study.store.sqlite_file",
    "is_url": "study.store.place",
    "place_of": "study.store.place",
    "machine_fingerprint": "study.store.fingerprint",
    "open_store": "study.store.store",
    "restore": "study.store.backup",
    "verify_data": "study.store.verification",
}
"""Where each name is: who asks for one alone, such as what a machine is, does not load the database library for it."""


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(importlib.import_module(_MODULES[name]), name)
    globals()[name] = found
    return found
