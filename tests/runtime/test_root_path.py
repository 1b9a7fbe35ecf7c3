from dataclasses import replace

import numpy as np
import pytest
from figures import walker

from motet.errors import MotionError
from motet.figures.feet.contacts import has_feet, lay_root_path
from motet.formats import read_motion
from motet.formats.amc import read
from motet.motion.kinematics import local_translations, positions
from motet.motion.motion import Motion, rest_motion
from motet.motion.skeleton import Joint, Skeleton
from motet.representation.root_block import ROOT_BLOCK, from_root_block, plant_feet, to_root_block

FEET = ("lfoot", "ltoes", "ltoes_end"), ("rfoot", "rtoes", "rtoes_end")


def without_path(motion):
    return motion.select(tuple(name for name in motion.channels if name[-2] != "t"))


def path_of(motion):
    return local_translations(motion)[:, 0]


def error_of(motion, **options):
    """How far the end of the laid path is from the true one, in parts of the path's length; and the path's angle."""
    true, laid = path_of(motion), path_of(lay_root_path(without_path(motion), **options))
    ends = [(path[-1] - path[0])[[0, 2]] for path in (true, laid)]
    length = np.linalg.norm(np.diff(true[:: round(motion.fps / 6), [0, 2]], axis=0), axis=1).sum()
    angle = [np.arctan2(*end) for end in ends]
    return np.linalg.norm(ends[1] - ends[0]) / length, abs(np.degrees(angle[1] - angle[0]))


@pytest.mark.parametrize(("name", "limit"), [("39_14", 0.06), ("09_07", 0.1)])
@pytest.mark.parametrize("fps", [120, 60, 30])
def test_the_path_of_a_walk_and_of_a_run(clips, name, limit, fps):
    motion = read_motion(clips / f"{name}.amc").resample(fps)
    for feet in (None, FEET):
        error, angle = error_of(motion, feet=feet)
        assert error < limit
        assert angle < 2


def test_trembling_does_not_drive_it(clips):
    motion = read_motion(clips / "39_14.amc")
    noise = np.random.default_rng(0).normal(0, 0.2, motion.values.shape)
    noise[:, :3] = 0
    assert error_of(replace(motion, values=motion.values + noise))[0] < 0.1


def test_the_lowest_joint_of_the_feet_is_on_the_ground_in_a_walk(clips):
    motion = lay_root_path(without_path(read_motion(clips / "39_14.amc")))
    lowest = positions(motion)[:, [motion.skeleton.index(name) for foot in FEET for name in foot], 1].min(axis=1)
    lowest *= motion.skeleton.metres_per_unit
    assert np.quantile(np.abs(lowest), 0.9) < 0.005
    # the toes of this trial tremble at one place
    assert np.abs(lowest).max() < 0.05


def test_the_foot_that_stands_stays(clips):
    motion = read_motion(clips / "39_14.amc")
    speeds = []
    for each in (motion, lay_root_path(without_path(motion))):
        places = positions(each)[:, [each.skeleton.index(name) for foot in FEET for name in foot]]
        places *= each.skeleton.metres_per_unit
        speed = np.linalg.norm(np.diff(places[..., [0, 2]], axis=0), axis=-1) * each.fps
        lowest = places[1:, :, 1].argmin(axis=1)
        speeds.append(np.median(speed[np.arange(len(speed)), lowest]))
    assert speeds[1] < speeds[0] + 0.02


def test_running_flies_between_steps(clips):
    motion = read_motion(clips / "09_07.amc")
    metres = motion.skeleton.metres_per_unit
    laid = lay_root_path(without_path(motion))
    true, found = path_of(motion)[:, 1] * metres, path_of(laid)[:, 1] * metres
    assert np.std(found - true) < 0.035
    speed = np.linalg.norm(np.diff(path_of(laid)[:, [0, 2]], axis=0), axis=1) * metres * motion.fps
    assert speed.min() > 2.0


def hopper(height):
    """Two straight legs that hang from a root; they bend, push off, hang while it flies, and land."""
    joints = [Joint("hips", -1, (0.0, 0.0, 0.0))]
    for side, x in (("Left", 0.1), ("Right", -0.1)):
        parent = len(joints)
        joints += [
            Joint(f"{side}Leg", 0, (x, 0.0, 0.0)),
            Joint(f"{side}Shin", parent, (0.0, -0.5, 0.0)),
            Joint(f"{side}Foot", parent + 1, (0.0, -0.5, 0.0)),
            Joint(f"{side}Foot_end", parent + 2, (0.0, 0.0, 0.2)),
        ]
    fps, gravity = 100, 9.81
    take_off = np.sqrt(2 * gravity * height)
    push = np.linspace(0.6, 1.0, 1 + round(2 * 0.4 / take_off * fps)) if height else np.full(20, 1.0)
    push = 0.6 + 0.4 * np.linspace(0, 1, len(push)) ** 2
    air = np.full(round(2 * take_off / gravity * fps), 1.0)
    legs = np.concatenate([np.full(20, 0.6), push, air, push[::-1], np.full(20, 0.6)])
    bend = np.degrees(np.arccos(legs))
    columns = {f"{s}{j}.rx": f * bend for s in ("Left", "Right") for j, f in (("Leg", -1), ("Shin", 2), ("Foot", -1))}
    values = np.stack(list(columns.values()), axis=1)
    motion = Motion(values, tuple(columns), ("deg",) * 6, fps, Skeleton(tuple(joints), 1.0))
    return motion, legs


@pytest.mark.parametrize("height", [0.2, 0.4])
def test_a_jump_on_the_spot_goes_up_and_comes_down(height):
    motion, legs = hopper(height)
    path = path_of(lay_root_path(motion))
    assert np.abs(path[:, [0, 2]]).max() < 1e-6
    assert path[:, 1].max() == pytest.approx(1 + height, abs=0.25 * height)
    np.testing.assert_allclose(path[[0, -1], 1], legs[[0, -1]], atol=1e-6)


def test_units_that_are_not_known_are_judged_by_the_figure(clips):
    motion = read_motion(clips / "39_14.amc")
    assert error_of(replace(motion, skeleton=Skeleton(motion.skeleton.joints)))[0] < 0.06


def test_an_old_path_is_replaced_and_the_angles_stay(clips):
    motion = read_motion(clips / "39_14.amc")
    laid = lay_root_path(motion)
    assert laid.channels == motion.channels
    np.testing.assert_array_equal(laid.values[:, 3:], motion.values[:, 3:])
    np.testing.assert_allclose(laid.values, lay_root_path(without_path(motion)).values, atol=1e-9)


@pytest.mark.parametrize("frames", [0, 1, 2, 3])
def test_short_motions(frames):
    motion = walker(frames)
    path = path_of(lay_root_path(motion))
    assert path.shape == (frames, 3)
    assert not path[:1, [0, 2]].any()


def test_feet_need_not_be_smoothed(clips):
    motion = read_motion(clips / "39_14.amc")
    assert error_of(motion, tremble=0)[0] < 0.1
    for tremble in (-1.0, np.nan):
        with pytest.raises(MotionError, match="0 or more seconds"):
            lay_root_path(motion, tremble=tremble)


def test_feet_must_be_there():
    lonely = Motion(np.zeros((2, 1)), ("a.rx",), ("deg",), 30, Skeleton((Joint("a", -1, (0, 0, 0)),)))
    with pytest.raises(MotionError, match="name the joints of the feet"):
        lay_root_path(lonely)
    with pytest.raises(MotionError, match="no joint 'toe'"):
        lay_root_path(walker(), feet=(["toe"], ["other toe"]))


WALKS = [
    "02_01",
    "02_02",
    "05_01",
    "07_01",
    "07_06",
    "07_11",
    "16_11",
    "16_15",
    "16_17",
    "16_31",
    "16_47",
    "35_01",
    "49_01",
]
RUNS = [
    "02_03",
    "09_01",
    "09_05",
    "09_08",
    "09_11",
    "16_36",
    "16_41",
    "16_45",
    "16_55",
    "35_17",
    "35_22",
    "127_06",
    "127_08",
]


@pytest.mark.parametrize(("trials", "mean", "largest"), [(WALKS, 0.055, 0.085), (RUNS, 0.07, 0.115)])
def test_paths_of_cmus_walks_and_runs(cmu, trials, mean, largest):
    errors = [error_of(read(cmu / "amc" / f"{trial}.amc"))[0] for trial in trials]
    assert np.mean(errors) < mean
    assert max(errors) < largest


def block_of(clips, name):
    """A recorded motion as models know it, 10 frames a second with a root block; and its root's way in metres."""
    motion = to_root_block(read_motion(clips / f"{name}.amc").resample(10))
    return motion, way_of(motion)


def way_of(motion):
    return path_of(from_root_block(motion)) * motion.skeleton.metres_per_unit


def with_velocity(motion, change):
    values = motion.values.copy()
    columns = [motion.channels.index(name) for name in ROOT_BLOCK[:2]]
    values[:, columns] = change(values[:, columns])
    return replace(motion, values=values)


def off(one, other):
    """How far apart two ways end, in parts of the length of the second."""
    length = np.linalg.norm(np.diff(other[:, [0, 2]], axis=0), axis=1).sum()
    return np.linalg.norm((one[-1] - other[-1])[[0, 2]]) / length


@pytest.mark.parametrize(("name", "limit"), [("39_14", 0.05), ("09_07", 0.08)])
def test_feet_that_stand_already_are_left_where_they_are(clips, name, limit):
    motion, way = block_of(clips, name)
    planted = plant_feet(motion)
    assert planted.channels == motion.channels
    rest = [i for i, channel in enumerate(motion.channels) if channel not in ROOT_BLOCK[:2]]
    np.testing.assert_array_equal(planted.values[:, rest], motion.values[:, rest])
    assert off(way_of(planted), way) < limit


def test_feet_that_slide_are_planted(clips):
    """A walk whose root goes at a third less than its feet say, and trembles."""
    motion, way = block_of(clips, "39_14")
    rng = np.random.default_rng(0)
    sliding = with_velocity(motion, lambda v: 0.67 * v + rng.normal(0, 0.3, v.shape))
    assert off(way_of(sliding), way) > 0.3
    assert off(way_of(plant_feet(sliding)), way) < 0.1


def test_in_flight_a_figure_goes_on_as_it_did(clips):
    """All frames of the second half are lifted by a metre: nothing is on the ground there."""
    motion, _ = block_of(clips, "39_14")
    values, half = motion.values.copy(), len(motion) // 2
    values[half:, motion.channels.index("root.height")] += 1.0
    values[half:, motion.channels.index("root.forward")] = 3.0
    planted = plant_feet(replace(motion, values=values)).values
    columns = [motion.channels.index(name) for name in ROOT_BLOCK[:2]]
    # feet on the ground are heard for a second
    np.testing.assert_allclose(planted[half + 12 :, columns], values[half + 12 :, columns], atol=1e-9)


def test_what_cannot_be_planted(clips):
    motion, _ = block_of(clips, "39_14")
    np.testing.assert_array_equal(plant_feet(motion[:1]).values, motion[:1].values)
    with pytest.raises(MotionError, match=r"root\.forward"):
        plant_feet(walker())
    lonely = Skeleton((Joint("a", -1, (0, 0, 0)),), 1.0)
    assert (has_feet(lonely), has_feet(motion.skeleton)) == (False, True)
    alone = Motion(np.zeros((3, 6)), ROOT_BLOCK, motion.units[:6], 10, lonely)
    with pytest.raises(MotionError, match="name the joints of the feet"):
        plant_feet(alone)


def test_a_skeleton_without_height_is_refused() -> None:
    names = ("hips", "leftFoot", "rightFoot")
    joints = tuple(Joint(name, min(0, place - 1), (0, 0, 0), "xyz") for place, name in enumerate(names))
    motion = rest_motion(Skeleton(joints))
    with pytest.raises(MotionError, match="no height"):
        lay_root_path(motion, (("leftFoot",), ("rightFoot",)))
