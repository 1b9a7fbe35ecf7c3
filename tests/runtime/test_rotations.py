from itertools import permutations

import numpy as np
import pytest

from motet.motion.rotations import (
    axis_to_rotmat,
    continuous_euler,
    euler_to_rotmat,
    quat_to_rotmat,
    rotmat_to_euler,
    rotmat_to_quat,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
)

ORDERS = ["".join(order) for order in permutations("xyz")]
RNG = np.random.default_rng(1)
ANGLES = RNG.uniform(-np.pi, np.pi, (500, 3))


def hard_rotations():
    """Random turns, no turn, tiny turns, half turns about each axis and quarter turns that lock Euler angles."""
    vectors = [RNG.normal(size=(300, 3)), np.zeros((1, 3)), 1e-9 * RNG.normal(size=(5, 3)), np.pi * np.eye(3)]
    locks = [euler_to_rotmat(np.array([[0.3, side * np.pi / 2, 0.7]]), order) for order in ORDERS for side in (1, -1)]
    return np.concatenate([rotvec_to_rotmat(np.concatenate(vectors)), *locks])


def test_axis_turns_the_next_axis_towards_the_one_after():
    for i, axis in enumerate("xyz"):
        turned = axis_to_rotmat(axis, np.array(np.pi / 2)) @ np.eye(3)[(i + 1) % 3]
        np.testing.assert_allclose(turned, np.eye(3)[(i + 2) % 3], atol=1e-15)


@pytest.mark.parametrize("order", ORDERS)
def test_euler_is_the_product_of_its_turns_from_left_to_right(order):
    product = np.eye(3)
    for n, axis in enumerate(order):
        product = product @ axis_to_rotmat(axis, ANGLES[:, n])
    np.testing.assert_allclose(euler_to_rotmat(ANGLES, order), product, atol=1e-14)


@pytest.mark.parametrize("order", ORDERS)
def test_euler_angles_give_back_their_rotation(order):
    rotations = hard_rotations()
    angles = rotmat_to_euler(rotations, order)
    assert np.abs(angles[:, 1]).max() <= np.pi / 2 + 1e-12
    np.testing.assert_allclose(euler_to_rotmat(angles, order), rotations, atol=1e-9)


def test_quaternions_and_vectors_give_back_their_rotation():
    rotations = hard_rotations()
    quat = rotmat_to_quat(rotations)
    np.testing.assert_allclose(np.linalg.norm(quat, axis=-1), 1, atol=1e-12)
    assert (quat[:, 3] >= 0).all()
    np.testing.assert_allclose(quat_to_rotmat(quat), rotations, atol=1e-12)
    vectors = rotmat_to_rotvec(rotations)
    assert np.linalg.norm(vectors, axis=-1).max() <= np.pi + 1e-12
    np.testing.assert_allclose(rotvec_to_rotmat(vectors), rotations, atol=1e-12)


@pytest.mark.parametrize("order", ORDERS)
def test_continuous_euler_undoes_leaps(order):
    smooth = np.cumsum(RNG.normal(0, 0.05, (400, 2, 3)), axis=0)
    leaping = rotmat_to_euler(euler_to_rotmat(smooth, order), order)
    leaping[0] = smooth[0]
    result = continuous_euler(leaping)
    np.testing.assert_allclose(result, smooth, atol=1e-9)


def test_scipy_agrees():
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    rotations = rotation.from_rotvec(ANGLES)
    np.testing.assert_allclose(rotvec_to_rotmat(ANGLES), rotations.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rotmat_to_quat(rotations.as_matrix()), rotations.as_quat(canonical=True), atol=1e-12)
    np.testing.assert_allclose(rotmat_to_rotvec(rotations.as_matrix()), rotations.as_rotvec(), atol=1e-12)
    for order in ORDERS:
        expected = rotation.from_euler(order.upper(), ANGLES)
        np.testing.assert_allclose(euler_to_rotmat(ANGLES, order), expected.as_matrix(), atol=1e-12)
        ours = rotmat_to_euler(expected.as_matrix(), order)
        np.testing.assert_allclose(ours, expected.as_euler(order.upper()), atol=1e-9)
