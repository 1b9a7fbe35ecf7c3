"""Motion matching against naive twins: the search, where springs lead, mirror images, quaternions."""

import numpy as np
import pytest

from motet.decode.matching import AHEAD, ASKED, FEATURES, LAG, LASTING, Matcher, Table, mirrored_features
from motet.motion.quaternions import conjugate, quat_product, quat_rotated, wrapped
from motet.motion.rotations import quat_to_rotmat

SPRINGS = (0.22, 0.18)
ROWS, CODES = 300, 4


@pytest.fixture(scope="module")
def table() -> Table:
    rng = np.random.default_rng(0)
    features = rng.normal(size=(ROWS, FEATURES)).astype(np.float32)
    frames = rng.normal(size=(ROWS, CODES + 6)).astype(np.float32)
    gaits = np.stack([np.arange(ROWS) < 200, np.arange(ROWS) >= 100], axis=1).astype(np.float32)
    left = np.tile(np.arange(100)[::-1], 3)
    return Table(frames, features, gaits, left, np.zeros(FEATURES, np.float32), np.ones(FEATURES, np.float32))


@pytest.fixture(scope="module")
def matcher(table: Table) -> Matcher:
    return Matcher(table, np.array([1, 1, -1, -1], np.float32), 30.0, 6, 1.25, SPRINGS)


def test_the_search_finds_what_looking_at_every_row_finds(table: Table, matcher: Matcher) -> None:
    rng = np.random.default_rng(1)
    asked, gait = rng.normal(size=(20, FEATURES)).astype(np.float32), rng.integers(2, size=20)
    rows, sides, costs = matcher.best(asked, gait)
    columns, signs = mirrored_features()
    for wanted, kind, row, side, cost in zip(asked, gait, rows, sides, costs, strict=True):
        usable = [i for i in range(ROWS) if table.gaits[i, kind] and table.left[i] >= LASTING]
        usable = [i for i in usable if table.frames[i, -2:].max() >= 0.1][::2]
        found = {}
        for i in usable:
            for mirrored in (1, -1):
                features = table.features[i] if mirrored == 1 else table.features[i][columns] * signs
                far = float(np.hypot(*wanted[4:6]))  # here neither mean nor scale
                lag = max(0.0, far / 2 - float(features[4:6] @ wanted[4:6]) / far)
                found[i, mirrored] = float(((features - wanted) ** 2).sum() / 2 + LAG * lag)
        assert (row, side) == min(found, key=found.__getitem__)
        assert cost + float((wanted**2).sum()) / 2 == pytest.approx(min(found.values()), rel=1e-3)
    np.testing.assert_allclose(matcher.cost_at(asked, rows, sides), costs, atol=1e-3)
    for one, found in enumerate(zip(rows, sides, costs, strict=True)):
        assert [part[0] for part in matcher.best(asked[one : one + 1], gait[one : one + 1])] == list(found)


def test_a_mirror_image_of_a_mirror_image_is_the_row(matcher: Matcher, table: Table) -> None:
    columns, signs = mirrored_features()
    once = table.features[:, columns] * signs
    np.testing.assert_array_equal(once[:, columns] * signs, table.features)
    at = np.arange(5)
    np.testing.assert_array_equal(matcher.features_at(at, np.full(5, -1, np.float32)), once[:5])


def test_ways_are_where_the_springs_lead(matcher: Matcher) -> None:
    rng = np.random.default_rng(2)
    root = rng.normal(size=(3, 4)).astype(np.float32)
    course, control = rng.normal(size=(3, 6)).astype(np.float32), rng.normal(size=(3, 3)).astype(np.float32)
    ways = matcher.ways(root, course, control)
    dt, damping = 1e-4, [2 * np.log(2) / half for half in SPRINGS]
    for row in range(3):
        velocity, change = course[row, :2].astype(float), course[row, 2:4].astype(float)
        angle, rate = float(course[row, 4]), float(course[row, 5])
        place, time = np.zeros(2), 0.0
        for number, ahead in enumerate(AHEAD):
            while time < ahead - dt / 2:
                pull = -(damping[0] ** 2) * (velocity - control[row, :2]) - 2 * damping[0] * change
                place, velocity, change = place + dt * velocity, velocity + dt * change, change + dt * pull
                turn = -(damping[1] ** 2) * (angle - control[row, 2]) - 2 * damping[1] * rate
                angle, rate, time = angle + dt * rate, rate + dt * turn, time + dt
            cos, sin = np.cos(root[row, 2]), np.sin(root[row, 2])
            seen = [cos * place[0] - sin * place[1], sin * place[0] + cos * place[1]]
            np.testing.assert_allclose(ways[row, 2 * number : 2 * number + 2], seen, atol=2e-3)
            facing = [np.sin(angle - root[row, 2]), np.cos(angle - root[row, 2])]
            place_of = ASKED // 2 + 2 * number
            np.testing.assert_allclose(ways[row, place_of : place_of + 2], facing, atol=2e-3)


def test_quaternions_turn_as_matrices_do() -> None:
    rng = np.random.default_rng(3)
    a, b = (q / np.linalg.norm(q, axis=-1, keepdims=True) for q in rng.normal(size=(2, 6, 4)))
    vectors = rng.normal(size=(6, 3))
    np.testing.assert_allclose(quat_to_rotmat(quat_product(a, b)), quat_to_rotmat(a) @ quat_to_rotmat(b), atol=1e-12)
    turned = (quat_to_rotmat(a) @ vectors[..., None])[..., 0]
    np.testing.assert_allclose(quat_rotated(a, vectors), turned, atol=1e-12)
    np.testing.assert_allclose(quat_to_rotmat(conjugate(a)), np.swapaxes(quat_to_rotmat(a), -1, -2), atol=1e-12)
    np.testing.assert_allclose(wrapped(np.array([3.5, -3.5, 7.0])), [3.5 - 2 * np.pi, 2 * np.pi - 3.5, 7 - 2 * np.pi])
