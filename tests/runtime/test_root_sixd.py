"""Motions in ``root_sixd`` and back: the same places, calm facings, mirror images, six numbers that make a rotation."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from figures import walker

from motet.errors import MotionError
from motet.formats import read_motion
from motet.motion import Motion, positions
from motet.motion.kinematics import euler_of, local_rotations
from motet.motion.rotations import axis_to_rotmat, rotvec_to_rotmat
from motet.representation.contract import MotionContract, named, sequences
from motet.representation.root_sixd import ROOT_SIXD, SIXD_KINDS, facing, in_world, sixd_to_rotmat

SIXD = named("root_sixd")
CLIPS = ("02_06", "09_07", "39_14")


def slow(clips: Path, name: str) -> Motion:
    """A recording at 30 Hz."""
    return read_motion(clips / f"{name}.amc").resample(30.0)


def metres(motion: Motion) -> np.ndarray:
    assert motion.skeleton is not None
    return positions(motion) * motion.skeleton.unit_factor(1.0)


def moved_to_the_start(motion: Motion) -> np.ndarray:
    """Places of all joints in metres, after the first frame's root and facing, in the most literal way."""
    places, angle = metres(motion), facing(motion)[0]
    places = places - places[:1, :1] * [1, 0, 1]
    return places @ axis_to_rotmat("y", np.array(angle))


@pytest.mark.parametrize("name", CLIPS)
def test_features_give_the_same_places_from_the_origin(clips: Path, name: str) -> None:
    motion = slow(clips, name)
    found = SIXD.motion(SIXD.features(motion))
    np.testing.assert_allclose(metres(found), moved_to_the_start(motion), atol=1e-9)
    assert facing(found)[0] == pytest.approx(0, abs=1e-9)


def test_the_channels_are_what_their_names_say() -> None:
    motion = walker(90, fps=30.0)
    features = SIXD.features(motion)
    assert features.channels[:4] == ROOT_SIXD
    joints = [name for name in motion.skeleton.names if not name.endswith("_end")]
    assert features.channels[4:] == tuple(f"{joint}.{kind}" for joint in joints for kind in SIXD_KINDS)
    place = joints.index("left_leg")
    axes = local_rotations(motion, [motion.skeleton.index("left_leg")])[:, 0]
    found = features.values[:, 4 + 6 * place : 10 + 6 * place]
    np.testing.assert_allclose(found, np.concatenate([axes[:, :, 0], axes[:, :, 1]], axis=1), atol=1e-12)
    height = features.values[:, 3]
    np.testing.assert_allclose(height, metres(motion)[:, 0, 1], atol=1e-12)
    # away from both ends, where the window is cut, it turns as the walker does
    np.testing.assert_allclose(features.values[20:-20, 2], np.radians(200), atol=0.4)
    speed = np.hypot(*np.diff(metres(motion)[:, 0, [0, 2]], axis=0).T) * 30
    np.testing.assert_allclose(np.hypot(*features.values[1:, :2].T), speed, atol=1e-9)


def test_channels_of_another_motion_are_taken_in_its_order() -> None:
    motion = walker(40)
    whole = SIXD.features(motion)
    like = whole.select((*ROOT_SIXD, *whole.channels[10:22]))
    np.testing.assert_array_equal(SIXD.features(motion, like).values, whole.select(like.channels).values)
    np.testing.assert_array_equal(SIXD.features(whole, like).values, whole.select(like.channels).values)
    assert SIXD.features(whole) is whole
    with pytest.raises(MotionError, match="no skeleton"):
        SIXD.features(replace(motion, skeleton=None))


def test_a_motion_goes_on_where_another_one_ends() -> None:
    motion = walker(120, fps=30.0)
    features = SIXD.features(motion)
    expected = SIXD.motion(features)
    first, pose = in_world(features[:50])
    second, pose = in_world(features[50:90], first, pose)
    third, _ = in_world(features[90:], second, pose)
    for found, wanted in ((first, expected[:50]), (second, expected[50:90]), (third, expected[90:])):
        np.testing.assert_allclose(positions(found), positions(wanted), atol=1e-9)
    # where one ends and the next begins, angles do not leap
    assert second.channels == first.channels
    for last, following in ((first, second), (second, third)):
        assert np.abs(following.values[0] - last.values[-1]).max() < 30


@pytest.mark.parametrize("metres_per_unit", [1.0, 0.01])
def test_a_motion_that_is_gone_on_with_says_where_and_which_way(metres_per_unit: float) -> None:
    motion = walker(120, fps=30.0, metres_per_unit=metres_per_unit, scale=1 / metres_per_unit)
    values = np.array(motion.values)
    turns = [motion.channels.index(f"hips.r{axis}") for axis in "xyz"]
    values[:, turns] = [0.0, 70.0, 0.0]  # a facing that is the same whatever is known of before and after
    values[:, :3] += np.array([3.0, 0.0, -5.0]) / metres_per_unit
    motion = replace(motion, values=values)
    found = SIXD.motion(SIXD.features(motion)[50:], after=motion[:50])
    assert found.channels == motion.channels
    np.testing.assert_allclose(metres(found), metres(motion)[50:], atol=1e-9)
    # the first frame's rates count: they lead from the last frame before
    assert not np.allclose(metres(found)[0], metres(motion)[49])


def cartwheel(frames: int = 90, fps: float = 30.0, turn: float = 40.0) -> Motion:
    """The walker, all but its root still, that faces one way and rolls over to its side once, by whole turns."""
    motion = walker(frames, fps)
    values = np.zeros_like(motion.values)
    values[:, 1] = 0.9
    axis = np.array([0.0, 0.03, 1.0]) / np.hypot(0.03, 1)  # not quite to the side: the root turns round upside down
    rolled = 360 * np.clip((np.arange(frames) - 20) / (frames - 40), 0, 1)
    tilts = rotvec_to_rotmat(np.radians(rolled)[:, None] * axis)
    turned = axis_to_rotmat("y", np.radians(np.full(frames, turn))) @ tilts
    joint = motion.skeleton.joints[0]
    values[:, [motion.channels.index(f"hips.r{axis}") for axis in "xyz"]] = np.degrees(euler_of(turned, joint))
    return replace(motion, values=values)


def test_the_facing_stays_calm_in_a_cartwheel() -> None:
    motion = cartwheel()
    angles = facing(motion)
    np.testing.assert_allclose(angles, np.radians(40), atol=0.15)
    assert np.abs(SIXD.features(motion).values[:, 2]).max() < 3
    # a whole turn about the vertical is one
    turned = np.array(motion.values)
    turned[:, 3:6] = 0.0
    turned[:, 4] = np.linspace(0, 720, len(motion))
    whole = facing(replace(motion, values=turned))
    assert whole[-20] - whole[20] == pytest.approx(np.radians(720 * (len(motion) - 40) / (len(motion) - 1)), abs=0.02)


def test_the_facing_smooths_what_hips_do_in_a_stride() -> None:
    motion = walker(90, fps=30.0)
    values = np.zeros_like(motion.values)
    sway = 0.3 * np.sin(2 * np.pi * 2 * np.arange(90) / 30)
    values[:, motion.channels.index("hips.ry")] = np.degrees(sway)
    found = facing(replace(motion, values=values))
    # twice the angle is smoothed as a complex number: nearly by what a Gaussian leaves of two swings a second
    left = np.exp(-0.5 * (2 * np.pi * 2 * 4 / 30) ** 2)
    assert np.abs(found[20:-20]).max() == pytest.approx(0.3 * left, rel=0.1)


def test_any_six_numbers_make_a_rotation() -> None:
    rng = np.random.default_rng(0)
    sixd = rng.normal(size=(50, 3, 6)) * rng.uniform(0.1, 5, (50, 3, 1))
    found = sixd_to_rotmat(sixd)
    np.testing.assert_allclose(found @ np.swapaxes(found, -1, -2), np.broadcast_to(np.eye(3), found.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(found), 1, atol=1e-12)
    # the x axis keeps its direction, the y axis its plane
    np.testing.assert_allclose(np.cross(found[..., 0], sixd[..., :3]), 0, atol=1e-12)
    np.testing.assert_allclose((found[..., 2] * sixd[..., 3:]).sum(axis=-1), 0, atol=1e-12)
    assert ((found[..., 1] * sixd[..., 3:]).sum(axis=-1) > 0).all()
    exact = rotvec_to_rotmat(rng.normal(size=(20, 3)))
    again = sixd_to_rotmat(np.concatenate([exact[..., 0], exact[..., 1]], axis=-1))
    np.testing.assert_allclose(again, exact, atol=1e-12)
    assert np.isfinite(sixd_to_rotmat(np.zeros((2, 6)))).all()


@pytest.mark.parametrize("name", CLIPS)
def test_frames_kept_in_32_bits_lead_to_the_same_places(clips: Path, name: str) -> None:
    motion = read_motion(clips / f"{name}.amc")
    phases = list(sequences("root_sixd", motion, 30.0))
    assert len(phases) == 4
    features = phases[1]
    kept = features.values.astype(np.float32).astype(np.float64)
    contract = MotionContract(
        "root_sixd", features.channels, features.units, 30.0, kept.mean(axis=0), kept.std(axis=0), features.skeleton
    )
    np.testing.assert_allclose(metres(contract.motion(kept)), metres(SIXD.motion(features)), atol=1e-5)
    np.testing.assert_allclose(contract.frames(motion[1:]), features.values, atol=1e-9)
