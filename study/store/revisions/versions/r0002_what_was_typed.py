"""What was typed, beside the number that it was read as. Answers of before have none: they were sent as numbers."""

import sqlalchemy as sql
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """One column more."""
    with op.batch_alter_table("survey_answers") as table:
        table.add_column(sql.Column("typed", sql.Text))
