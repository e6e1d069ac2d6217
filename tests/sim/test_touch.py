"""What an arm remembers of having been pressed against something."""

from __future__ import annotations

from app.autonomy.actions import DIRECTIONS, UNIT_DIRECTIONS
from sim.touch import NEAR_M, REMEMBERED_SLICES, Touch

HERE = (0.8, 0.1, 0.85)
WAYS_M = 0.02 * UNIT_DIRECTIONS


def test_what_leads_where_it_was_pressed_is_known_and_nothing_else() -> None:
    touch = Touch()
    assert not touch.leads_into(HERE, WAYS_M, 0).any()
    touch.feel(HERE, (0.8, 0.1, 0.838), 7)
    assert touch.leads_into(HERE, WAYS_M, 8).tolist() == [z < 0 for _, _, z in DIRECTIONS]


def test_two_contacts_count_both() -> None:
    touch = Touch()
    touch.feel(HERE, (0.8, 0.1, 0.838), 7)
    touch.feel(HERE, (0.812, 0.1, 0.85), 9)
    assert touch.leads_into(HERE, WAYS_M, 10).tolist() == [z < 0 or x > 0 for x, _, z in DIRECTIONS]


def test_a_contact_is_forgotten_elsewhere_and_after_a_while() -> None:
    touch = Touch()
    touch.feel(HERE, (0.8, 0.1, 0.838), 7)
    away = (HERE[0], HERE[1] + NEAR_M + 0.001, HERE[2])
    assert not touch.leads_into(away, WAYS_M, 8).any()
    assert touch.leads_into(HERE, WAYS_M, 6 + REMEMBERED_SLICES).any()
    assert not touch.leads_into(HERE, WAYS_M, 7 + REMEMBERED_SLICES).any()
