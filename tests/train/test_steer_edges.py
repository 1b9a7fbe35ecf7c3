"""The measures of feet that drag, slide and step, of a rest pose that is moved."""

import numpy as np
import pytest

from motet.figures.humanoid import BONES
from motet.motion.rotations import Array
from motet_train.evaluate.steer.edges import _slides, _steps, dragging
from motet_train.evaluate.steer.following import Track

TICKS = 31


def moved(speed: float, heights: float | Array = 0.0) -> Track:
    """A second of a rest pose whose soles are at heights, which goes ahead at a speed."""
    rest = np.tile(np.array([0, 0, 0, 1], np.float32), (TICKS, 1, len(BONES), 1))
    ground = np.zeros((TICKS, 1, 3))
    ground[:, 0, 1] = speed * np.arange(TICKS) / 30
    standing = Track(ground, rest, np.full((TICKS, 1), 1.0, np.float32), 30.0)
    hips_height = 1.0 - standing.soles[0, 0, :, 1].min() + heights
    return Track(ground, rest, np.broadcast_to(hips_height, TICKS)[:, None].astype(np.float32), 30.0)


def test_feet_drag_that_move_on_the_ground() -> None:
    assert dragging(moved(0.2)).all()
    assert not dragging(moved(0.1)).any()
    assert not dragging(moved(0.2, 0.02)).any()
    assert dragging(moved(0.2)).shape == (TICKS - 1, 1)


def test_a_slide_is_the_way_of_a_low_and_slow_ball() -> None:
    assert _slides(moved(0.2)) == pytest.approx([20.0, 20.0])
    assert len(_slides(moved(0.2, 0.05))) == 0
    assert len(_slides(moved(1.3))) == 0


def test_steps_are_counted_by_lifts() -> None:
    lifts = np.where(np.arange(TICKS) % 10 > 6, 0.03, 0.0)
    assert _steps(moved(0.0, lifts)) == 6
    assert _steps(moved(0.0, lifts / 2)) == 0
