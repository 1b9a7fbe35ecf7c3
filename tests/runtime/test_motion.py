import copy
import pickle

import numpy as np
import pytest
from figures import walker

from motet.errors import MotionError
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.motion.rotations import euler_to_rotmat
from motet.motion.skeleton import Joint, Skeleton


def plain(values, unit="deg", fps=10.0):
    values = np.asarray(values, dtype=float).reshape(-1, 1)
    return Motion(values, ("a.rx",), (unit,), fps)


def test_a_motion_is_its_own_and_cannot_change():
    source = np.zeros((3, 1))
    motion = Motion(source, ("a.rx",), ("deg",), 30)
    source[:] = 1
    assert motion.values.sum() == 0
    with pytest.raises(ValueError, match="read-only"):
        motion.values[0, 0] = 1


def test_copies_cannot_change_either():
    motion = walker()
    for again in (copy.copy(motion), copy.deepcopy(motion), pickle.loads(pickle.dumps(motion))):
        with pytest.raises(ValueError, match="read-only"):
            again.values[0, 0] = 1
        np.testing.assert_array_equal(again.values, motion.values)
        assert (again.channels, again.units, again.fps, again.skeleton) == (
            motion.channels,
            motion.units,
            motion.fps,
            motion.skeleton,
        )


def test_a_repr_fits_on_a_line():
    assert repr(walker(399, fps=120)) == "Motion(399 frames, 24 channels, 120 fps, 3.3 s)"
    assert repr(walker().skeleton) == "Skeleton(14 joints, root 'hips', unit 1 m)"
    assert repr(walker(metres_per_unit=None).skeleton) == "Skeleton(14 joints, root 'hips', unit unknown)"


def test_one_frame_and_frame_by_frame():
    motion = plain(np.arange(5))
    for index in (3, np.int64(3), -2):
        assert (motion[index].values.tolist(), motion[index].fps) == ([[3.0]], 10.0)
    assert [frame.values[0, 0] for frame in motion] == [0, 1, 2, 3, 4]
    for index in (5, -6):
        with pytest.raises(IndexError):
            motion[index]


@pytest.mark.parametrize(
    ("values", "channels", "units", "fps", "words"),
    [
        (np.zeros((2, 2)), ("a",), ("deg",), 30, "do not fit 1 channels"),
        (np.zeros((2, 2)), ("a", "a"), ("deg", "deg"), 30, "names must be unique"),
        (np.zeros((2, 1)), ("a",), ("degrees",), 30, "one unit per channel"),
        (np.zeros((2, 1)), ("a",), ("deg",), 0, "frame rate"),
        ([[0.0], [np.nan]], ("a",), ("deg",), 30, "frame 1, channel 'a' is nan"),
        ([["x"]], ("a",), ("deg",), 30, "must be numbers"),
    ],
)
def test_what_does_not_fit_is_refused(values, channels, units, fps, words):
    with pytest.raises(MotionError, match=words):
        Motion(values, channels, units, fps)


def test_slices_and_cuts_keep_time():
    motion = plain(np.arange(20))
    assert motion[::4].fps == 2.5
    assert motion[::4].values.ravel().tolist() == [0, 4, 8, 12, 16]
    assert motion.cut(0.5, 1.0).values.ravel().tolist() == [5, 6, 7, 8, 9]
    assert motion.duration == 2.0
    for start, stop in ((1.0, 0.5), (0.0, 3.0), (-1.0, 1.0)):
        with pytest.raises(MotionError, match="cannot cut"):
            motion.cut(start, stop)
    with pytest.raises(MotionError, match="positive"):
        motion[::-1]


def test_select_converts_units_and_names_what_lacks():
    motion = walker(metres_per_unit=0.5)
    picked = motion.select(("hips.ty", "hips.rx"), ("m", "rad"))
    np.testing.assert_allclose(picked.values[:, 0], motion.values[:, 1] * 0.5)
    np.testing.assert_allclose(picked.values[:, 1], np.radians(motion.values[:, motion.channels.index("hips.rx")]))
    back = picked.select(picked.channels, ("length", "deg"))
    np.testing.assert_allclose(back.values, motion.select(picked.channels).values)
    with pytest.raises(MotionError, match=r"lacks 1 of 2 channels: tail\.rx"):
        motion.select(("hips.rx", "tail.rx"))
    with pytest.raises(MotionError, match=r"lacks 9 of 10 channels: 0, 1, 2, 3, 4, 5 and 3 more$"):
        motion.select(("hips.rx", *map(str, range(9))))
    with pytest.raises(MotionError, match="does not convert"):
        motion.select(("hips.rx",), ("m",))


def test_scaled_changes_the_unit_and_not_the_place():
    motion = walker(metres_per_unit=0.5)
    in_metres = motion.scaled(1.0)
    np.testing.assert_allclose(positions(in_metres), positions(motion) * 0.5, atol=1e-12)
    with pytest.raises(MotionError, match="the length unit of this skeleton is unknown"):
        walker(metres_per_unit=None).scaled(1.0)


def test_resample_picks_frames_or_interpolates():
    motion = plain(np.arange(20.0))
    assert motion.resample(5.0).values.ravel().tolist() == list(range(0, 20, 2))
    doubled = motion.resample(20.0)
    assert len(doubled) == 39
    np.testing.assert_allclose(doubled.values[:, 0], np.arange(39) / 2)
    assert abs(plain(np.arange(120.0), fps=120).resample(29.97).duration - 1) < 0.02
    assert len(plain([]).resample(7.0)) == 0


def test_resample_turns_on_where_angles_leap():
    motion = plain([170.0, 179.0, -172.0, -163.0])
    np.testing.assert_allclose(motion.resample(20.0).values[:6, 0], [170, 174.5, 179, 183.5, 188, 192.5])


@pytest.mark.parametrize("ratio", [0.25, 1 / 3, 0.8, 1.0, 1.5, 2.0, 7.0, 12.0])
@pytest.mark.parametrize("frames", [0, 1, 2, 3, 13, 40])
def test_one_rule_for_the_frames_between(ratio, frames):
    """Nothing is made up past the last frame, and what changes evenly still does."""
    motion = plain(2 * np.arange(frames), unit="m", fps=12.0)
    expected = np.arange(0, 2 * frames - 2 + 1e-6, 2 * ratio)
    np.testing.assert_allclose(motion.resample(12.0 / ratio).values[:, 0], expected, atol=1e-9)
    ending = motion.resample(12.0 / ratio, to_end=True).values[:, 0]
    np.testing.assert_allclose(ending, expected + (2 * frames - 2 - expected[-1:]), atol=1e-9)


def test_resample_goes_around_where_exponential_maps_are_cut():
    """A hand that turns slowly past half a turn: 3.12, 3.13 and then -3.13."""
    angle = np.linspace(2.9, 3.4, 20)
    wrapped = np.where(angle > np.pi, angle - 2 * np.pi, angle)
    values = np.column_stack([wrapped, np.zeros(20), np.zeros(20)])
    motion = Motion(values, ("hand.ex", "hand.ey", "hand.ez"), ("rad",) * 3, 50.0)
    found = motion.resample(30.0).values[:, 0]
    np.testing.assert_allclose(found, np.interp(np.arange(len(found)) / 30, np.arange(20) / 50, angle - 2 * np.pi))


def test_continuous_takes_out_gimbal_flips_of_the_joints_own_order():
    joint = Joint("a", -1, (0.0, 0.0, 0.0), "yzx")
    smooth = np.stack([np.linspace(0, 300, 50), np.linspace(0, 170, 50), np.linspace(0, 90, 50)], axis=1)  # x, y, z
    y, z, x = smooth[:, 1].copy(), smooth[:, 2].copy(), smooth[:, 0].copy()
    flipped = np.stack([y + 180, 180 - z, x + 180], axis=1)
    odd = np.arange(50)[:, None] % 2 == 1
    yzx = np.where(odd, flipped, np.stack([y, z, x], axis=1))
    leaping = yzx[:, [2, 0, 1]]
    motion = Motion(leaping, ("a.rx", "a.ry", "a.rz"), ("deg",) * 3, 30, Skeleton((joint,)))
    result = motion.continuous().values
    assert np.abs(np.diff(result, axis=0)).max() < 10
    before, after = (euler_to_rotmat(np.radians(v[:, [1, 2, 0]]), "yzx") for v in (leaping, result))
    np.testing.assert_allclose(after, before, atol=1e-12)


def test_skeletons_are_trees_with_a_text_form():
    skeleton = walker().skeleton
    assert Skeleton.from_json(skeleton.to_json()) == skeleton
    assert [skeleton.names[i] for i in skeleton.below(skeleton.index("left_leg"))] == [
        "left_leg",
        "left_shin",
        "left_shin_end",
    ]
    for joints in ((), (Joint("a", 0, (0, 0, 0)),), (Joint("a", -1, (0, 0, 0)), Joint("a", 0, (0, 0, 0)))):
        with pytest.raises(MotionError):
            Skeleton(joints)
    with pytest.raises(MotionError, match="not an Euler order"):
        Skeleton((Joint("a", -1, (0, 0, 0), "xyx"),))
    with pytest.raises(MotionError, match="not a skeleton"):
        Skeleton.from_json({"joints": [{"name": "a"}], "metres_per_unit": None})
