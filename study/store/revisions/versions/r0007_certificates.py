"""Certificates of participants who have ended; those of before have none: nobody counted then."""

import sqlalchemy as sql
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    """One table more."""
    participant = sql.Column(
        "participant", sql.Text, sql.ForeignKey("sessions.participant"), primary_key=True, nullable=False
    )
    op.create_table(
        "certificates",
        participant,
        sql.Column("utc", sql.Text, nullable=False),
        sql.Column("links", sql.Integer, nullable=False),
        sql.Column("head", sql.Text, nullable=False),
        *(sql.Column(name, sql.Integer, nullable=False) for name in ("ticks", "practice_ticks", "answers", "messages")),
        *(sql.Column(name, sql.Integer) for name in ("told_ticks", "told_messages")),
        sql.Column("key", sql.Text, nullable=False),
        sql.Column("signature", sql.Text, nullable=False),
    )
