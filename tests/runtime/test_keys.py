"""A motion that passes through keys, against the motion itself, rigid moves and slerp by hand."""

import numpy as np
import pytest

from motet.composition.keys import Key, Moves
from motet.errors import MotionError
from motet.motion.rotations import Array, axis_to_rotmat, rotvec_to_rotmat

FRAMES, REACH = 60, 10


@pytest.fixture
def moves() -> Moves:
    """Two joints that sway while the root walks ahead."""
    time = np.arange(FRAMES)
    sway = rotvec_to_rotmat(0.3 * np.sin(time[:, None, None] * [[0.1], [0.2]]) * [[[0, 1, 0], [1, 0, 0.5]]])
    return Moves(sway, np.column_stack([0 * time, 0.9 + 0 * time, 0.04 * time]), 0.1 * np.sin(time * 0.1))


def about(axis: str, angle: float) -> Array:
    return axis_to_rotmat(axis, np.array(angle))


def test_without_keys_it_is_the_motion(moves: Moves) -> None:
    found = moves.through({}, REACH)
    np.testing.assert_allclose(found.turns, moves.turns, atol=1e-12)
    np.testing.assert_allclose(found.root, moves.root, atol=1e-12)


def test_keys_are_met_and_the_motion_beyond_their_reach_is_its_own(moves: Moves) -> None:
    pose = about("x", 1.2)
    found = moves.through({30: Key({1: pose}, np.array([np.nan, 0.5, np.nan]))}, REACH)
    np.testing.assert_allclose(found.turns[30, 1], pose, atol=1e-12)
    assert found.root[30, 1] == pytest.approx(0.5)
    far = np.abs(np.arange(FRAMES) - 30) >= REACH
    np.testing.assert_allclose(found.turns[far], moves.turns[far], atol=1e-12)
    np.testing.assert_allclose(found.root[far], moves.root[far], atol=1e-12)
    np.testing.assert_allclose(found.turns[:, 0], moves.turns[:, 0], atol=1e-12)
    assert (np.abs(np.diff(found.root[:, 1])) < 0.4 * 1.6 / REACH).all()  # smoothly: a smoothstep's slope is 1.5


def test_one_place_and_facing_move_the_motion_as_a_whole(moves: Moves) -> None:
    found = moves.through({20: Key(place=np.array([3.0, np.nan, -2.0]), facing=2.0)}, REACH)
    turn = about("y", 2.0 - moves.facing[20])
    np.testing.assert_allclose(found.turns[:, 0], turn @ moves.turns[:, 0], atol=1e-12)
    expected = (moves.root - moves.root[20]) @ turn.T + [3.0, 0.9, -2.0]
    np.testing.assert_allclose(found.root, expected, atol=1e-12)
    assert found.facing[20] == pytest.approx(2.0)


def test_a_key_pose_of_the_root_turns_the_motion(moves: Moves) -> None:
    """A pose that is the motion's own, turned about the vertical, is met by turning the motion as a whole."""
    turn = about("y", 1.0)
    found = moves.through({10: Key({0: turn @ moves.turns[10, 0], 1: moves.turns[10, 1]})}, REACH)
    np.testing.assert_allclose(found.turns[:, 0], turn @ moves.turns[:, 0], atol=1e-9)
    np.testing.assert_allclose(found.turns[:, 1], moves.turns[:, 1], atol=1e-9)


def test_near_keys_are_led_from_one_to_the_next(moves: Moves) -> None:
    """What is added between two keys with the same difference stays the same."""
    turn = about("z", 0.8)
    found = moves.through({frame: Key({1: turn @ moves.turns[frame, 1]}) for frame in (20, 35)}, REACH)
    np.testing.assert_allclose(found.turns[20:36, 1], turn @ moves.turns[20:36, 1], atol=1e-9)


def test_a_path_goes_through_its_places(moves: Moves) -> None:
    pins = {0: (1.0, 0.0), 30: (1.5, 2.0), 59: (0.0, 3.0)}
    found = moves.through({f: Key(place=np.array([x, np.nan, z])) for f, (x, z) in pins.items()}, REACH)
    np.testing.assert_allclose(found.root[list(pins)][:, [0, 2]], list(pins.values()), atol=1e-12)
    np.testing.assert_allclose(found.root[:, 1], 0.9)


def test_keys_of_one_frame_are_joined_or_contradict_each_other() -> None:
    both = Key({1: np.eye(3)}).joined(Key(place=np.array([1.0, np.nan, 2.0]), facing=0.5))
    assert both.turns.keys() == {1}
    assert both.facing == 0.5
    np.testing.assert_array_equal(both.place, [1.0, np.nan, 2.0])
    for one, other in (
        (Key({1: np.eye(3)}), Key({1: about("x", 0.1)})),
        (Key(place=np.zeros(3)), Key(place=np.full(3, 0.1))),
        (Key(facing=0.0), Key(facing=1.0)),
    ):
        one.joined(one)
        with pytest.raises(MotionError, match="two constraints"):
            one.joined(other)
