"""Where migrations began: the tables of the lab's version 0.1.0, which `tests/support/recorded/0001` holds files of.

Such a file is marked with this revision when it is opened; nothing in it changes. A new file is not made by revisions
but from `study.store.tables`, and a test holds the two ways to the same schema.
"""

revision = "0001"
down_revision = None


def upgrade() -> None:
    """The schema is there already."""
