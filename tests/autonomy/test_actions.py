from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from app.autonomy.actions import DIRECTIONS, NULL_ACTION, UNIT_DIRECTIONS, index_of, nearest_action
from app.autonomy.errors import AutonomyError


def test_actions_stand_in_the_documented_order() -> None:
    assert list(DIRECTIONS) == list(itertools.product((-1, 0, 1), repeat=3))
    assert DIRECTIONS[NULL_ACTION] == (0, 0, 0)


def test_diagonals_are_no_longer_than_axes() -> None:
    lengths = np.linalg.norm(UNIT_DIRECTIONS, axis=1)
    assert lengths[NULL_ACTION] == 0.0
    np.testing.assert_allclose(np.delete(lengths, NULL_ACTION), 1.0, atol=1e-15)
    np.testing.assert_allclose(UNIT_DIRECTIONS[index_of((1, 1, 0))], [math.sqrt(0.5), math.sqrt(0.5), 0.0])


def test_unit_directions_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        UNIT_DIRECTIONS[0, 0] = 1.0


def test_index_of_inverts_directions() -> None:
    assert [index_of(direction) for direction in DIRECTIONS] == list(range(27))


@pytest.mark.parametrize("direction", [(2, 0, 0), (0, 0), (0, 0, 0, 0), (0.5, 0, 0), "abc", 7, (math.nan, 0, 0)])
def test_index_of_names_what_it_refuses(direction: object) -> None:
    with pytest.raises(AutonomyError, match="each -1, 0 or 1"):
        index_of(direction)  # type: ignore[arg-type]


def test_nearest_action_continues_the_momentum_whatever_its_length() -> None:
    for index, momentum in enumerate(UNIT_DIRECTIONS):
        expected = None if index == NULL_ACTION else index
        assert nearest_action(momentum) == expected
        assert nearest_action(momentum * 0.1) == expected
    # 20 degrees off the x axis: nearer to x (20) than to the xy diagonal (25).
    angle = math.radians(20.0)
    assert nearest_action((math.cos(angle), math.sin(angle), 0.0)) == index_of((1, 0, 0))


@pytest.mark.parametrize("momentum", [(1.1, 0, 0), (1, 1, 0), (math.nan, 0, 0), (0, 0), "up"])
def test_nearest_action_refuses_what_is_no_momentum(momentum: object) -> None:
    with pytest.raises(AutonomyError, match="momentum"):
        nearest_action(momentum)  # type: ignore[arg-type]
