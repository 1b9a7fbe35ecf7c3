"""Poses on the ground and moves between them: there and back, and a way by a book whose errors do not add up."""

import math

import numpy as np
import pytest

from motet.generate.codec import RADIAN_METRES, moved, nearest_moves, seen_from, way_of
from motet.motion.rotations import Array
from motet.representation.root_block import way


def poses(*shape: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(size=(*shape, 3)) * [3, 3, 4]


def naive_moved(pose: Array, move: Array) -> list[float]:
    """By two steps on the ground, forward and then to the left, and a turn on the spot."""
    x, z, facing = pose
    ahead, left = (math.sin(facing), math.cos(facing)), (math.sin(facing + math.pi / 2), math.cos(facing + math.pi / 2))
    x, z = x + move[0] * ahead[0], z + move[0] * ahead[1]
    return [x + move[1] * left[0], z + move[1] * left[1], facing + move[2]]


def test_a_move_leads_forward_to_the_left_and_round() -> None:
    starts, moves = poses(20), poses(20, seed=1)
    expected = [naive_moved(pose, move) for pose, move in zip(starts, moves, strict=True)]
    np.testing.assert_allclose(moved(starts, moves), expected, atol=1e-12)


def test_what_is_seen_leads_there() -> None:
    starts, others = poses(4, 5), poses(4, 5, seed=1)
    np.testing.assert_allclose(moved(starts, seen_from(starts, others)), others, atol=1e-12)
    moves = poses(4, 5, seed=2)
    np.testing.assert_allclose(seen_from(starts, moved(starts, moves)), moves, atol=1e-12)


def test_a_way_is_one_move_after_the_other() -> None:
    moves, start = poses(2, 7, seed=3), poses(2)
    found = way_of(start, moves)
    assert found.shape == (2, 8, 3)
    np.testing.assert_array_equal(found[:, 0], start)
    np.testing.assert_allclose(seen_from(found[:, :-1], found[:, 1:]), moves, atol=1e-12)
    # as the root block counts
    facing, x, z = way(moves[0], (start[0, 0], 0.0, start[0, 1]), start[0, 2])
    np.testing.assert_allclose(found[0, 1:], np.stack([x, z, facing], axis=1), atol=1e-12)


def naive_nearest(path: Array, book: Array) -> tuple[list[int], list[list[float]]]:
    """Try every entry from where the way has really led."""
    entries, led = [], [list(path[0])]
    for wanted in path[1:]:
        ends = [naive_moved(np.array(led[-1]), move) for move in book]
        off = [math.dist(end[:2], wanted[:2]) ** 2 + (RADIAN_METRES * (end[2] - wanted[2])) ** 2 for end in ends]
        entries.append(off.index(min(off)))
        led.append(ends[entries[-1]])
    return entries, led


@pytest.fixture(scope="module")
def book() -> Array:
    """Moves of up to 20 cm and a tenth of a turn, none of them exactly what is needed."""
    return np.random.default_rng(5).uniform([-0.05, -0.05, -0.3], [0.2, 0.05, 0.3], (40, 3))


def walks(rows: int, steps: int) -> Array:
    """Ways (rows, steps + 1, 3) of people who go on and turn a little."""
    rng = np.random.default_rng(6)
    moves = rng.normal([0.08, 0.0, 0.0], [0.03, 0.01, 0.1], (rows, steps, 3))
    return way_of(poses(rows), moves)


def test_the_nearest_moves_are_those_of_a_naive_twin(book: Array) -> None:
    paths = walks(3, 25)
    entries, led = nearest_moves(paths, book)
    assert entries.dtype == np.int64
    assert (entries.shape, led.shape) == ((3, 25), (3, 26, 3))
    for row, path in enumerate(paths):
        expected, reached = naive_nearest(path, book)
        assert entries[row].tolist() == expected
        np.testing.assert_allclose(led[row], reached, atol=1e-9)
    np.testing.assert_allclose(led, way_of(paths[:, 0], book[entries]), atol=1e-12)


def test_errors_do_not_add_up(book: Array) -> None:
    paths = walks(4, 300)
    _, led = nearest_moves(paths, book)
    off = np.linalg.norm((led - paths)[..., :2], axis=-1)
    assert off.max() < 0.1
    assert off[:, -50:].max() < 1.5 * off[:, :50].max()
    # each move chosen for itself leads far astray
    wanted = seen_from(paths[:, :-1], paths[:, 1:])
    apart = ((wanted[..., None, :] - book) * [1, 1, RADIAN_METRES]) ** 2
    alone = way_of(paths[:, 0], book[apart.sum(axis=-1).argmin(axis=-1)])
    assert np.linalg.norm((alone - paths)[:, -1, :2], axis=-1).min() > 3 * off.max()


def test_a_book_that_has_every_move_leads_exactly() -> None:
    moves = np.random.default_rng(7).normal(size=(6, 3))
    path = way_of(np.array([1.0, -2.0, 0.5]), moves[[3, 3, 0, 5, 2, 1, 4]])
    entries, led = nearest_moves(path, moves)
    assert entries.tolist() == [3, 3, 0, 5, 2, 1, 4]
    np.testing.assert_allclose(led, path, atol=1e-12)
