"""The chain: a hash for each row that is written, over the one before.

What was there before is linked when the file is brought up (`study.store.migration.bring_up`). Erasures have the
tombstone of a chain, whoever was erased.
"""

from typing import Any

import sqlalchemy as sql
from alembic import op

from study.integrity.chain import tombstone_hash

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """One table and one column more."""
    op.create_table(
        "chain",
        sql.Column("participant", sql.Text, sql.ForeignKey("sessions.participant"), primary_key=True, nullable=False),
        sql.Column("seq", sql.Integer, primary_key=True, nullable=False),
        sql.Column("row_table", sql.Text, nullable=False),
        *(sql.Column(name, sql.Text) for name in ("row_key", "content", "marks")),
        *(sql.Column(name, sql.Text, nullable=False) for name in ("hash", "salt")),
    )
    connection: Any = op.get_bind().connection.driver_connection
    connection.create_function("tombstone_hash", 2, tombstone_hash, deterministic=True)
    op.add_column("erasures", sql.Column("hash", sql.Text, nullable=False, server_default=""))
    op.execute("UPDATE erasures SET hash = tombstone_hash(participant, utc)")
    with op.batch_alter_table("erasures") as table:
        table.alter_column("hash", server_default=None)
