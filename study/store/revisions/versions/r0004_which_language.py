"""The language that participants read: English, for everybody enrolled before studies could say another."""

import sqlalchemy as sql
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """One column more."""
    with op.batch_alter_table("participants") as table:
        table.add_column(sql.Column("language", sql.Text, nullable=False, server_default="en"))
    with op.batch_alter_table("participants") as table:
        table.alter_column("language", server_default=None)
