from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from app.autonomy.actions import UNIT_DIRECTIONS, index_of
from app.autonomy.errors import AutonomyError
from app.autonomy.transition import TransitionModel

HERE = (0.5, 0.1, 0.9)


def moved(model: TransitionModel, momentum: tuple[float, float, float], direction: tuple[int, int, int]) -> Any:
    return model.next_positions(HERE, momentum)[index_of(direction)] - HERE


def test_mix_follows_the_old_direction_for_the_planning_delay() -> None:
    model = TransitionModel("mix", step_m=0.05, planning_delay=0.2)
    # 0.05 (0.2 (1,0,0) + 0.8 (0,1,0)) = (0.01, 0.04, 0)
    np.testing.assert_allclose(moved(model, (1.0, 0.0, 0.0), (0, 1, 0)), [0.01, 0.04, 0.0], atol=1e-15)
    np.testing.assert_allclose(moved(model, (1.0, 0.0, 0.0), (1, 0, 0)), [0.05, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(moved(model, (1.0, 0.0, 0.0), (0, 0, 0)), [0.01, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(moved(model, (0.0, 0.0, 0.0), (0, 1, 0)), [0.0, 0.04, 0.0], atol=1e-15)
    # momentum is used as given: half the length, half the carry-over
    np.testing.assert_allclose(moved(model, (0.5, 0.0, 0.0), (0, 0, 0)), [0.005, 0.0, 0.0], atol=1e-15)


def test_replan_moves_fully_only_when_continuing() -> None:
    model = TransitionModel("replan", step_m=0.05, planning_delay=0.2)
    np.testing.assert_allclose(moved(model, (1.0, 0.0, 0.0), (1, 0, 0)), [0.05, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(moved(model, (1.0, 0.0, 0.0), (0, 1, 0)), [0.0, 0.04, 0.0], atol=1e-15)
    np.testing.assert_allclose(moved(model, (1.0, 0.0, 0.0), (0, 0, 0)), [0.0, 0.0, 0.0], atol=1e-15)
    # from rest every direction has to be planned
    np.testing.assert_allclose(moved(model, (0.0, 0.0, 0.0), (1, 0, 0)), [0.04, 0.0, 0.0], atol=1e-15)


@pytest.mark.parametrize("kind", ["mix", "replan"])
def test_no_action_moves_further_than_the_step(kind: Any) -> None:
    model = TransitionModel(kind, step_m=0.05)
    lengths = np.linalg.norm(model.next_positions(HERE, (1.0, 0.0, 0.0)) - HERE, axis=1)
    assert lengths.max() <= 0.05 + 1e-15


@pytest.mark.parametrize("kind", ["mix", "replan"])
def test_a_batch_of_states_is_each_state_by_itself(kind: Any) -> None:
    model = TransitionModel(kind)
    positions = np.random.default_rng(1).uniform(-1, 1, (27, 3))
    batch = model.next_positions(positions, UNIT_DIRECTIONS)
    assert batch.shape == (27, 27, 3)
    for row, position, momentum in zip(batch, positions, UNIT_DIRECTIONS, strict=True):
        np.testing.assert_allclose(row, model.next_positions(position, momentum), atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"kind": "jump"}, "jump.*mix, replan"),
        ({"step_m": 0.0}, r"step_m is 0\.0"),
        ({"step_m": math.nan}, "step_m is nan"),
        ({"step_m": 11.0}, r"\(0, 10\]"),
        ({"planning_delay": 1.2}, r"planning_delay is 1\.2.*\[0, 1\]"),
        ({"planning_delay": math.nan}, "planning_delay is nan"),
    ],
)
def test_a_bad_model_is_refused_with_value_and_bound(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(AutonomyError, match=words):
        TransitionModel(**arguments)


@pytest.mark.parametrize("position", [(math.nan, 0, 0), (math.inf, 0, 0), (1e200, 0, 0), (0, 0), 3.0, "here"])
def test_a_bad_position_is_refused(position: Any) -> None:
    with pytest.raises(AutonomyError, match="position_world_m"):
        TransitionModel().next_positions(position, (0.0, 0.0, 0.0))
