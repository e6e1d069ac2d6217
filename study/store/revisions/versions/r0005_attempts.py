"""Attempts: the arm can be freed, and the cycle then begins again.

Everything recorded before is a first attempt, and nobody had freed the arm in it.
"""

import sqlalchemy as sql
from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Add the columns."""
    for table in ("ticks", "practice_ticks"):
        op.add_column(table, sql.Column("attempt", sql.Integer, nullable=False, server_default="1"))
    op.add_column("tasks", sql.Column("attempts", sql.Integer, nullable=False, server_default="1"))
    op.add_column("trials", sql.Column("frees", sql.Integer))
