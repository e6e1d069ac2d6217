"""Run by Alembic for each migration: on the connection, and in the transaction, that the store opened."""

from __future__ import annotations

from alembic import context

from study.store.tables import METADATA

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=METADATA,
    render_as_batch=True,  # SQLite changes a column by copying its table
)
context.run_migrations()
