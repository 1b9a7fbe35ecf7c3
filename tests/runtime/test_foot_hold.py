from dataclasses import replace

import numpy as np
import pytest

from motet.errors import MotionError
from motet.figures.feet.hold import HoldSettings
from motet.figures.humanoid.bones import LEFT_RIGHT, LEG, ground_under, sole_points
from motet.figures.two_bones import TwoBones
from motet.formats import read_motion
from motet.motion import HUMANOID, global_transforms, hold_feet, positions, to_humanoid
from motet.motion.motion import Motion
from motet.motion.rotations import euler_to_rotmat, quat_to_rotmat
from motet.motion.scalar_or_batch import parts
from motet.motion.skeleton import Joint, Skeleton

BALLS = [HUMANOID.index(side + "Toes") for side in LEFT_RIGHT]
LEGS = [[HUMANOID.index(side + part) for part in LEG[:3]] for side in LEFT_RIGHT]
TURNED = {f"{side}{part}.r{axis}" for side in LEFT_RIGHT for part in LEG[:3] for axis in "xyz"}
WALK, RUN = "39_14", "09_07"


@pytest.fixture(scope="module")
def recorded(clips):
    return {name: to_humanoid(read_motion(clips / f"{name}.amc")).motion for name in (WALK, RUN)}


def soles_of(motion):
    return sole_points(*global_transforms(motion))


def slide(motion):
    """Metres a second that the balls of the feet move where they are low: the median, as feet that swing are, too."""
    balls = positions(motion)[:, BALLS]
    low = balls[..., 1] < ground_under(soles_of(motion)) + 0.04
    speed = np.linalg.norm(np.diff(balls[..., [0, 2]], axis=0), axis=-1) * motion.fps
    return np.median(speed[low[1:] & low[:-1]])


def jerk(motion):
    return np.linalg.norm(np.diff(positions(motion), n=3, axis=0), axis=-1).mean()


def knees(motion):
    """Degrees (T, 2) by which the knees bend."""
    hip, knee, ankle = np.moveaxis(positions(motion)[:, LEGS], 2, 0)
    one, other = knee - hip, ankle - knee
    cosine = (one * other).sum(-1) / np.linalg.norm(one, axis=-1) / np.linalg.norm(other, axis=-1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def largest_step(motion):
    return np.abs(np.diff(knees(motion), axis=0)).max()


def slow_noise(rng, motion, size, cut):
    """Noise (T,) of standard deviation ``size`` without frequencies above ``cut`` Hz."""
    longer = len(motion) + round(4 * motion.fps)
    spectrum = np.fft.rfft(rng.normal(size=longer))
    spectrum[np.fft.rfftfreq(longer, 1 / motion.fps) > cut] = 0
    noise = np.fft.irfft(spectrum, longer)[: len(motion)]
    return noise * size / noise.std()


def disturbed(motion, seed=0):
    """As a learned generator makes it: the root drifts by some cm/s, the legs tremble."""
    rng, values = np.random.default_rng(seed), np.array(motion.values)
    for column, channel in enumerate(motion.channels):
        if channel in ("hips.tx", "hips.tz"):
            values[:, column] += np.cumsum(slow_noise(rng, motion, 0.07, 1)) / motion.fps
        elif channel == "hips.ty":
            values[:, column] += slow_noise(rng, motion, 0.005, 1)
        elif channel in TURNED:
            values[:, column] += slow_noise(rng, motion, 0.5, 5)
    return replace(motion, values=values)


@pytest.mark.parametrize("name", [WALK, RUN])
@pytest.mark.parametrize("fps", [20, 24, 30, 60, 120])
def test_sliding_feet_stand(recorded, name, fps):
    motion = recorded[name].resample(fps)
    sliding = disturbed(motion)
    held = hold_feet(sliding)
    assert slide(sliding) > 1.3 * slide(motion)
    assert slide(held) < 0.5 * slide(sliding)
    assert slide(held) < slide(motion)
    assert largest_step(held) < 1.2 * largest_step(motion)
    assert jerk(held) < 1.05 * jerk(sliding)


@pytest.mark.parametrize("name", [WALK, RUN])
@pytest.mark.parametrize("fps", [20, 24, 30, 60, 120])
def test_recorded_motions_hardly_change(recorded, name, fps):
    motion = recorded[name].resample(fps)
    held = hold_feet(motion)
    assert slide(held) < slide(motion)
    assert jerk(held) < 1.06 * jerk(motion)  # in all but the run at 24 fps, of 28 frames, 1.025
    assert largest_step(held) < 1.2 * largest_step(motion)
    assert np.median(np.linalg.norm(positions(held) - positions(motion), axis=-1).max(axis=1)) < 0.03


def test_only_the_legs_turn_and_feet_keep_their_directions(recorded):
    motion = disturbed(recorded[WALK])
    held = hold_feet(motion)
    assert (held.channels, held.units, held.fps) == (motion.channels, motion.units, motion.fps)
    others = [column for column, name in enumerate(motion.channels) if name not in TURNED]
    np.testing.assert_array_equal(held.values[:, others], motion.values[:, others])
    feet = [HUMANOID.index(side + part) for side in LEFT_RIGHT for part in ("Foot", "Toes")]
    before, after = (global_transforms(each)[0][:, feet] for each in (motion, held))
    np.testing.assert_allclose(after, before, atol=1e-9)
    assert np.abs(np.diff(held.values, axis=0)).max() < 30  # degrees: no angle leaps by turns


@pytest.mark.parametrize("name", [WALK, RUN])
def test_feet_are_never_deeper_than_the_ground(recorded, name):
    motion = disturbed(recorded[name])
    soles = soles_of(motion)
    ground = ground_under(soles)
    assert soles[..., 1].min() < ground - 0.005
    assert soles_of(hold_feet(motion))[..., 1].min() > ground - 1e-6


def standing(fps, seconds=4.0, knee=20.0, **moves):
    """The humanoid with bent knees and flat feet; moves: what the hips do along x, y or z, a function of the time."""
    time = np.arange(round(fps * seconds)) / fps
    bends = {"UpperLeg": -knee / 2, "LowerLeg": knee, "Foot": -knee / 2}
    angles = {f"{side}{part}.rx": np.full(len(time), bend) for side in LEFT_RIGHT for part, bend in bends.items()}
    height = {"hips.ty": np.full(len(time), 0.98 - 0.84 * (1 - np.cos(np.radians(knee / 2))))}
    channels = {"hips.tx": 0 * time, **height, "hips.tz": 0 * time, **angles}
    for axis, move in moves.items():
        channels[f"hips.t{axis}"] = channels[f"hips.t{axis}"] + move(time)
    units = ["length"] * 3 + ["deg"] * len(angles)
    return Motion(np.stack(list(channels.values()), axis=1), tuple(channels), tuple(units), fps, HUMANOID)


@pytest.mark.parametrize("fps", [20, 30, 120])
def test_who_sways_stands_still(fps):
    motion = standing(fps, x=lambda t: 0.04 * np.sin(2 * t), z=lambda t: 0.03 * np.sin(3 * t))
    before, after = soles_of(motion), soles_of(hold_feet(motion))
    assert np.ptp(before[..., 0], axis=0).min() > 0.07
    assert np.ptp(after[..., [0, 2]], axis=0).max() < 0.002
    # in the middle of where it was
    np.testing.assert_allclose(after[0, :, [0, 2]], np.median(before, axis=0)[:, [0, 2]].T, atol=0.002)


def test_a_foot_that_is_lifted_for_a_moment_stands_where_it_stood():
    lifted = np.zeros(120)
    lifted[60] = 0.1
    motion = standing(30, y=lambda t: lifted, x=lambda t: 0.02 * t)
    held = soles_of(hold_feet(motion))
    assert np.ptp(held[[20, 100], :, 0], axis=0).max() < 0.002


def test_feet_in_the_air_are_free():
    motion = standing(30, y=lambda t: np.where(t < 2, 0, 0.1), x=lambda t: 0.02 * t)
    shift = soles_of(hold_feet(motion)) - soles_of(motion)
    assert np.abs(shift[:55, :, 0]).max() > 0.01
    np.testing.assert_allclose(shift[70:], 0, atol=1e-6)


def test_who_stands_still_stays_as_it_is():
    motion = standing(30)
    held = hold_feet(motion).select(motion.channels)
    np.testing.assert_allclose(held.values, motion.values, atol=1e-6)


def test_what_slides_on_is_moved_no_farther_than_a_leg_reaches():
    motion = standing(30, seconds=10, knee=40, z=lambda t: 0.1 * t)
    shift = soles_of(hold_feet(motion)) - soles_of(motion)
    farthest = HoldSettings().farthest
    assert farthest * 0.9 < np.linalg.norm(shift, axis=-1).max() < farthest + 0.01


def test_a_foot_that_sinks_is_lifted_softly():
    motion = standing(30, seconds=12, y=lambda t: -0.05 * np.exp(-0.5 * ((t - 2) / 0.1) ** 2))
    held = soles_of(hold_feet(motion))[..., 1]
    assert soles_of(motion)[..., 1].min() < -0.045
    assert -1e-3 < held.min() < held.max() < 0.02
    assert np.abs(np.diff(knees(hold_feet(motion)), axis=0)).max() < 20


def legs(rng, count):
    hip = rng.normal(size=(count, 3))
    along = rng.normal(size=(count, 3))
    turned = euler_to_rotmat(rng.uniform(-np.pi, np.pi, (count, 3)), "xyz")
    thigh = turned @ np.array([0.05, -0.4, 0.02])
    shin = turned @ euler_to_rotmat(rng.uniform([0.1, -0.1, -0.1], [2, 0.1, 0.1], (count, 3)), "xzy")
    knee = hip + thigh
    return [hip, knee, knee + shin @ np.array([0.01, -0.45, 0.0]), shin[..., 0]], along


def test_ankles_come_to_where_they_shall_and_bones_keep_their_lengths():
    places, along = legs(np.random.default_rng(0), 500)
    (hip, knee, ankle, _), leg = places, TwoBones(*map(parts, places))
    away = ankle - hip + 0.05 * along / np.linalg.norm(along, axis=-1, keepdims=True)
    length = np.linalg.norm(away, axis=-1, keepdims=True)
    target = hip + away * np.clip(length, 0.3, 0.8) / length
    thigh, shin = (quat_to_rotmat(np.stack(turn, axis=-1)) for turn in leg.turns(parts(target)))
    reached = hip + np.einsum("tij,tj->ti", thigh, knee - hip) + np.einsum("tij,tj->ti", shin, ankle - knee)
    np.testing.assert_allclose(reached, target, atol=1e-9)
    for turn in (thigh, shin):
        np.testing.assert_allclose(turn @ np.swapaxes(turn, 1, 2), np.tile(np.eye(3), (500, 1, 1)), atol=1e-12)
    # seen from the thigh the shin turns about the knee's axis, square to the thigh
    relative = np.swapaxes(thigh, 1, 2) @ shin
    axis = np.stack(leg._axis, axis=-1)
    np.testing.assert_allclose(np.einsum("tij,tj->ti", relative, axis), axis, atol=1e-9)
    assert np.abs((axis * (knee - hip)).sum(-1)).max() < 1e-12


def test_a_leg_eases_into_and_out_of_full_length():
    """The ankle is drawn down and up again, past what a straight leg reaches: no step of the knee is a leap."""
    wanted = 0.84 + 0.06 * np.sin(np.linspace(0, 2 * np.pi, 400))
    zero = np.zeros((len(wanted), 3))
    for bend in (0.0, 5.0, 20.0):
        upper, lower = (0.42 * np.array([0, -np.cos(a), np.sin(a)]) for a in np.radians([bend / 2, -bend / 2]))
        leg = TwoBones(*(parts(zero + place) for place in (0, upper, upper + lower, [1.0, 0, 0])))
        length = -leg.eased(parts(np.outer(wanted, [0, -1.0, 0])))[1]
        now = np.linalg.norm(upper + lower)
        assert length.max() <= (now + 0.84) / 2 + 1e-9
        assert (np.sign(length - now) == np.sign(wanted - now))[np.abs(wanted - now) > 1e-6].mean() > 0.5
        assert np.abs(length - wanted)[wanted < now].max() < 0.012
        angle = 2 * np.degrees(np.arccos(np.minimum(length / 0.84, 1)))
        assert np.abs(np.diff(angle)).max() < 2
        np.testing.assert_allclose(leg.eased(leg.ankle), leg.ankle, atol=1e-12)


@pytest.mark.parametrize("frames", [0, 1, 2, 3])
def test_short_motions(recorded, frames):
    motion = recorded[WALK][:frames]
    held = hold_feet(motion)
    assert len(held) == frames
    assert held.channels == motion.channels


def test_feet_of_other_figures_stand(clips):
    """CMU's own figure, whose knees have one angle and whose ankles have two, with a root that drifts."""
    motion = read_motion(clips / f"{WALK}.amc").resample(60)
    rng, values = np.random.default_rng(0), np.array(motion.values)
    for axis in (0, 2):
        values[:, axis] += np.cumsum(slow_noise(rng, motion, 0.07, 1)) / motion.fps / motion.skeleton.metres_per_unit
    sliding = replace(motion, values=values)
    held = hold_feet(sliding)
    assert held.channels == motion.channels
    assert slide(to_humanoid(held).motion) < 0.7 * slide(to_humanoid(sliding).motion)
    legs = {f"{side}{part}" for side in "lr" for part in ("femur", "tibia", "foot")}
    rest = tuple(channel for channel in motion.channels if channel.split(".")[0] not in legs)
    np.testing.assert_array_equal(held.select(rest).values, sliding.select(rest).values)
    # feet keep their directions in the world, as far as two angles let them
    toes = [motion.skeleton.index(name) for name in ("ltoes", "rtoes")]
    turns = np.einsum("tjba,tjbc->tjac", *(global_transforms(each)[0][:, toes] for each in (held, sliding)))
    assert np.trace(turns, axis1=2, axis2=3).min() > 1 + 2 * np.cos(np.radians(5))


def test_feet_that_tremble_stand(recorded):
    """A tremble of 7 Hz, faster than feet that stand go."""
    motion = standing(40, z=lambda t: 0.02 * np.sin(2 * np.pi * 7 * t), knee=30)
    across = [np.ptp(soles_of(hold_feet(motion, trembling=t))[40:-40, :, 2], axis=0).max() for t in (False, True)]
    assert across[0] > 0.02
    assert across[1] < 0.01


def test_what_is_no_human_is_refused():
    with pytest.raises(MotionError, match="human"):
        hold_feet(Motion(np.zeros((2, 1)), ("a.rx",), ("deg",), 30, Skeleton((Joint("a", -1, (0, 0, 0)),))))
