"""Vectors and quaternions by their parts: those of the library's matrices, and of one as of many."""

import numpy as np
import pytest

from motet.motion import scalar_or_batch as by
from motet.motion.rotations import quat_to_rotmat, swing


def drawn(width: int) -> np.ndarray:
    found = np.random.default_rng(width).normal(size=(200, width))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@pytest.mark.parametrize("count", [1, 200])
def test_they_are_those_of_matrices(count: int) -> None:
    one, other, vector = drawn(4)[:count], drawn(4)[::-1][:count], 3 * drawn(3)[:count]
    turned = by.rotated(by.product(by.parts(one), by.parts(other)), by.parts(vector))
    wanted = (quat_to_rotmat(one) @ quat_to_rotmat(other) @ vector[..., None])[..., 0]
    np.testing.assert_allclose(np.reshape(turned, (3, count)).T, wanted, atol=1e-12)
    back = by.rotated(by.inverse(by.parts(one)), by.rotated(by.parts(one), by.parts(vector)))
    np.testing.assert_allclose(np.reshape(back, (3, count)).T, vector, atol=1e-12)


def test_the_shortest_turn_is_that_of_matrices() -> None:
    start = np.concatenate([drawn(3)[:20], np.eye(3), np.eye(3), np.zeros((1, 3))])
    end = np.concatenate([drawn(3)[-20:], -np.eye(3), np.eye(3), np.ones((1, 3))])
    for one, other in zip(start, end, strict=True):
        quat = np.array(by.swing(by.parts(2 * one[None]), by.parts(other[None])))
        assert np.linalg.norm(quat) == pytest.approx(1)
        if np.allclose(one, -other):  # half a turn about any axis
            np.testing.assert_allclose(quat_to_rotmat(quat) @ one, other, atol=1e-9)
        else:
            np.testing.assert_allclose(quat_to_rotmat(quat), swing(one, other), atol=1e-9)


def test_one_is_rounded_as_many_are() -> None:
    values = np.concatenate([drawn(4), [[0, 0, 0, 1], [0, -0.0, 1, 0]]])
    for function in (
        by.normalised,
        lambda q: by.swing(q[:3], q[1:]),
        lambda q: [by.computed(np.exp, -abs(q[0])), by.computed(np.expm1, -(q[1] ** 2))],
    ):
        many = np.array(function(by.parts(values)))
        one = np.array([function(by.parts(row[None])) for row in values])
        np.testing.assert_array_equal(one.T, many)
