import numpy as np
import pytest

from motet.motion.rotations import frames_last, inverse, product, rotated, rotvec_to_rotmat, swing

pytestmark = pytest.mark.numeric

RNG = np.random.default_rng(3)
TURNS = rotvec_to_rotmat(RNG.normal(size=(7, 5, 3)))
PLACES = RNG.normal(size=(7, 5, 3))


@pytest.mark.parametrize("filled", [frames_last, np.empty])
def test_products_are_those_of_numpy_in_any_layout(filled):
    turns, places = filled(TURNS.shape), filled(PLACES.shape)
    turns[:], places[:] = TURNS, PLACES
    close = {"atol": 1e-14}
    np.testing.assert_allclose(product(turns, inverse(turns)), np.broadcast_to(np.eye(3), turns.shape), **close)
    np.testing.assert_allclose(product(turns[:, :1], turns), TURNS[:, :1] @ TURNS, **close)
    for constant in (TURNS[0, 0], TURNS[0]):
        np.testing.assert_allclose(product(turns, constant), TURNS @ constant, **close)
        np.testing.assert_allclose(product(constant, turns), constant @ TURNS, **close)
        np.testing.assert_allclose(rotated(constant, places), (constant @ PLACES[..., None])[..., 0], **close)
    assert product(TURNS[0, 0], turns[:0]).shape == product(turns[:0, :1], turns[:0]).shape == (0, 5, 3, 3)
    np.testing.assert_allclose(rotated(turns, places), (TURNS @ PLACES[..., None])[..., 0], **close)
    np.testing.assert_allclose(rotated(turns, places[0]), (TURNS @ PLACES[0][..., None])[..., 0], **close)


def test_what_is_computed_frame_by_frame_keeps_the_frames_together():
    turns = frames_last((100, 4, 3, 3))
    turns[:] = np.eye(3)
    for result in (product(turns, turns), product(np.eye(3), turns), turns[:, [2, 0]], rotated(turns, np.ones(3))):
        assert result.strides[0] == result.itemsize


def test_a_swing_is_the_shortest_turn_and_none_without_a_direction():
    start, end = RNG.normal(size=(2, 200, 3))
    start[:3], end[:3] = np.eye(3), -2 * np.eye(3)
    end[3] = start[3]
    turns = swing(start, end)
    directions = [vectors / np.linalg.norm(vectors, axis=-1, keepdims=True) for vectors in (start, end)]
    np.testing.assert_allclose(rotated(turns, directions[0]), directions[1], atol=1e-12)
    np.testing.assert_allclose(product(turns, inverse(turns)), np.broadcast_to(np.eye(3), turns.shape), atol=1e-12)
    cosine = (np.trace(turns, axis1=1, axis2=2) - 1) / 2
    np.testing.assert_allclose(cosine, np.sum(directions[0] * directions[1], axis=-1), atol=1e-12)
    np.testing.assert_array_equal(swing(start, np.zeros(3)), np.broadcast_to(np.eye(3), turns.shape))
