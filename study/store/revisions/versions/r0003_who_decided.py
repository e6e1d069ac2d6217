"""Who decided a tick, and how far from what the person asked: worked out for ticks of before from what they hold.

A tick in which the arbiter took another action than the person's was said to be the person's.
"""

import math
from typing import Any

import sqlalchemy as sql
from alembic import op

revision = "0003"
down_revision = "0002"


def _departure(*values: int) -> float:
    user, action = values[:3], values[3:]
    return 0.0 if user == action else math.dist(_unit(user), _unit(action))


def _unit(direction: tuple[int, ...]) -> list[float]:
    length = math.hypot(*direction) or 1.0
    return [value / length for value in direction]


def upgrade() -> None:
    """One column more, and another word where it says so."""
    connection: Any = op.get_bind().connection.driver_connection
    connection.create_function("departure_of", 6, _departure, deterministic=True)
    for name in ("ticks", "practice_ticks"):
        with op.batch_alter_table(name) as table:
            table.add_column(sql.Column("departure", sql.Float))
        op.execute(
            f"UPDATE {name} SET departure = departure_of(user_x, user_y, user_z, action_x, action_y, action_z) "
            "WHERE user_x IS NOT NULL AND action_x IS NOT NULL"
        )
        op.execute(f"UPDATE {name} SET source = 'blend' WHERE source = 'user' AND departure > 0")
