from itertools import permutations

import numpy as np
import pytest

from motet.motion.rotations import (
    axis_to_rotmat,
    continuous_euler,
    continuous_rotvec,
    euler_to_rotmat,
    quat_to_rotmat,
    rotmat_to_euler,
    rotmat_to_quat,
    rotmat_to_rotvec,
    rotmats_to_euler,
    rotvec_to_rotmat,
)

pytestmark = pytest.mark.numeric

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


def naive_continuous_euler(angles):
    """Frame by frame: of the two solutions, each up to whole turns, the one nearest to the frame before."""
    result, turn = np.array(angles), 2 * np.pi
    for t in range(1, len(result)):
        before, now = result[t - 1], result[t]
        flipped = now * [1, -1, 1] + np.pi
        now, flipped = (x - turn * np.round((x - before) / turn) for x in (now, flipped))
        nearer = np.abs(flipped - before).sum(-1) < np.abs(now - before).sum(-1) - 1e-9
        result[t] = np.where(nearer[..., None], flipped, now)
    return result


def naive_continuous_rotvec(vectors):
    """Frame by frame, from the last to the first."""
    result = np.array(vectors)
    for t in range(len(result) - 2, -1, -1):
        for j in range(result.shape[1]):
            now, after = result[t, j], result[t + 1, j]
            angle, other = np.linalg.norm(now), np.linalg.norm(after)
            axis = now / angle if angle > 1e-3 else after / max(other, 1e-9)
            result[t, j] = now + axis * 2 * np.pi * np.round((after @ axis - angle) / (2 * np.pi))
    return result


@pytest.mark.parametrize("step", [0.1, 1.0, 3.0])
def test_continuous_angles_are_those_of_the_naive_loop(step):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        walk = np.cumsum(rng.normal(0, step, (200, 3, 3)), axis=0)
        leaping = rotmat_to_euler(euler_to_rotmat(walk, "zyx"), "zyx")
        np.testing.assert_allclose(continuous_euler(leaping), naive_continuous_euler(leaping), atol=1e-9)
        degrees = continuous_euler(np.degrees(leaping), 360.0)
        np.testing.assert_allclose(degrees, np.degrees(naive_continuous_euler(leaping)), atol=1e-9)


def test_what_does_not_leap_keeps_its_bits():
    smooth = np.cumsum(RNG.normal(0, 0.01, (100, 4, 3)), axis=0)
    np.testing.assert_array_equal(continuous_euler(smooth), smooth)
    np.testing.assert_array_equal(continuous_rotvec(smooth), smooth)


@pytest.mark.parametrize("step", [0.1, 1.0])
def test_continuous_vectors_are_those_of_the_naive_loop(step):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        walk = np.cumsum(rng.normal(0, step, (150, 5, 3)), axis=0)
        leaping = rotmat_to_rotvec(rotvec_to_rotmat(walk))
        found = continuous_rotvec(leaping)
        np.testing.assert_allclose(found, naive_continuous_rotvec(leaping), atol=1e-9)
        # a rotation by less than 1e-3 is given the axis of the frame after it
        np.testing.assert_allclose(rotvec_to_rotmat(found), rotvec_to_rotmat(leaping), atol=2e-3)
        np.testing.assert_array_equal(found[-1], leaping[-1])


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_gimbal_lock_on_the_way_is_no_leap(order, sign):
    middle = sign * np.pi / 2 * np.sin(np.linspace(0, np.pi, 101))
    smooth = np.column_stack([np.full(101, 0.3), middle, np.full(101, 1.0)])
    matrices = euler_to_rotmat(smooth, order)
    assert np.abs(np.diff(rotmat_to_euler(matrices, order), axis=0)).max() > 0.9
    found = rotmats_to_euler(matrices, order)
    np.testing.assert_allclose(found, smooth, atol=1e-6)
