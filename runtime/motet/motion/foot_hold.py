"""Holding feet: what stands on the ground stays where it stands, whatever the root does meanwhile.

A foot stands where heel, ball or tip of the toes is low and slow. How much each of them does, between 0 and 1, says
whose movement over the ground is taken out of the foot: that of the heel after it has landed, that of all three while
the sole is flat, that of the ball and the toes as the foot rolls off. What has been taken out adds up to a shift of the
foot; over a stance its median is 0, so the foot stands where it stood on average. Before and after, the shift comes
and goes smoothly. Hip, knee and ankle follow by :mod:`motet.motion.two_bone`.
"""

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotionError
from motet.motion.humanoid import HUMANOID, LEFT_RIGHT, SOLE, ground_under, sided, sole_points
from motet.motion.kinematics import AXES, euler_of, global_transforms, with_channels
from motet.motion.motion import TURN, Motion
from motet.motion.products import inverse, product
from motet.motion.root_path import TREMBLE, smoothed
from motet.motion.rotations import Array
from motet.motion.two_bone import Leg

LOW = (0.02, 0.05)  # m above the ground: a point of the sole touches it surely, and not at all
SLOW = (0.3, 0.9)  # m/s over the ground: it stands surely, and not at all
LIFTED = 0.1  # s: a foot that does not touch the ground for less goes on standing where it stands
BLEND = 0.2  # s: in which a shift comes and goes, most of it in half of that
FARTHEST = 0.15  # m: a foot is shifted by less; what slides farther than twice that in a stance does slide
SOFT = 0.05  # s: before and after a foot is in the ground it is being lifted out of it

POINTS = sum(len(places) for places in SOLE.values())
BENT = ("UpperLeg", "LowerLeg", "Foot")

Flags = NDArray[np.bool_]


def hold_feet(motion: Motion) -> Motion:
    """The motion with feet that stay where they stand and are never deeper than the ground, by turning hips, knees and
    ankles; the root and all other joints are as they were, and the feet keep their directions in the world.

    The ground is level, and where :func:`motet.motion.to_humanoid` lays it: the soles are deeper in 5 % of the frames.
    A foot is shifted by FARTHEST at most, and a leg that is nearly straight is hardly drawn longer: what is left slides
    on. MotionError for a motion that is not the humanoid's.
    """
    if motion.skeleton != HUMANOID:
        raise MotionError("this motion is not on the humanoid, whose feet can be held: bring it there by to_humanoid")
    if len(motion) < 2:
        return motion
    rotations, places = global_transforms(motion)
    soles = sole_points(rotations, places)
    soles[..., 1] -= ground_under(soles)
    turned = np.array(rotations)
    for number, side in enumerate(LEFT_RIGHT):
        hip, knee, ankle = (HUMANOID.index(sided(side, part)) for part in BENT)
        leg = Leg(places[:, hip], places[:, knee], places[:, ankle], rotations[:, knee, :, 0])
        thigh, shin = leg.turns(_target(leg, soles[:, number * POINTS : (number + 1) * POINTS], motion.fps))
        turned[:, hip] = product(thigh, rotations[:, hip])
        turned[:, knee] = product(shin, rotations[:, knee])
    return _with_legs(motion, turned)


def _target(leg: Leg, points: Array, fps: float) -> Array:
    """Where the ankle comes to (T, 3), from points (T, K, 3) of the sole above a ground at 0."""
    over_ground = _held(points, fps)
    target = leg.eased(leg.ankle + np.insert(over_ground, 1, 0.0, axis=1))
    lowest = points[..., 1].min(axis=1) + target[:, 1] - leg.ankle[:, 1]
    target[:, 1] += np.minimum(_lift(-lowest, fps), FARTHEST)
    return target


def _held(points: Array, fps: float) -> Array:
    """The shift (T, 2) over the ground."""
    steps = np.diff(points[..., [0, 2]], axis=0)
    touch = _touch(points, fps)
    weights = touch / np.maximum(touch.sum(axis=1, keepdims=True), 1e-9)
    undone = -(touch.max(axis=1) * (weights[..., None] * steps).sum(axis=1).T).T
    times, values = [], []
    for start, stop in _stances(touch.max(axis=1) > 0, fps):
        path = np.concatenate([np.zeros((1, 2)), np.cumsum(undone[start:stop], axis=0)])
        path -= np.median(path, axis=0)
        times.append(np.arange(start, stop + 1))
        values.append(path)
    shift = _between(times, values, len(points), BLEND * fps)
    # toes that tremble are not followed
    return _bounded(smoothed(shift[:, None], TREMBLE, fps)[:, 0])


def _touch(points: Array, fps: float) -> Array:
    """How much points (T, K, 3) touch the ground and stand from each frame to the next, (T - 1, K) from 0 to 1."""
    calm = smoothed(points, TREMBLE, fps)
    speed = np.linalg.norm(np.diff(calm[..., [0, 2]], axis=0), axis=-1) * fps
    height = (points[1:, :, 1] + points[:-1, :, 1]) / 2
    return _fading(height, *LOW) * _fading(speed, *SLOW)


def _fading(values: Array, full: float, none: float) -> Array:
    return 1 - _eased(np.clip((values - full) / (none - full), 0, 1))


def _eased(part: Array) -> Array:
    eased: Array = part**3 * (10 - 15 * part + 6 * part**2)
    return eased


def _stances(standing: Flags, fps: float) -> list[tuple[int, int]]:
    """First and last frame of each stance, from whether the foot stands from each frame to the next (T - 1,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], standing, [False]]).astype(int))).reshape(-1, 2)
    found: list[tuple[int, int]] = []
    for start, stop in edges.tolist():
        goes_on = bool(found) and start - found[-1][1] < LIFTED * fps
        found.append((found.pop()[0] if goes_on else start, stop))
    return found


def _between(times: list[NDArray[np.intp]], values: list[Array], frames: int, blend: float) -> Array:
    """Values (frames, 2) that are known at ``times``, go to 0 and come back in ``blend`` frames, smoothly."""
    zero = np.zeros((1, 2))
    keys, known = [np.array([-2 * blend])], [zero]
    for time, value in zip(times, values, strict=True):
        last = keys[-1][-1]
        if time[0] - last > 2 * blend:
            keys.append(np.array([last + blend, time[0] - blend]))
            known += [zero, zero]
        keys.append(time.astype(np.float64))
        known.append(value)
    keys.append(keys[-1][-1:] + blend)
    known.append(zero)
    at, of = np.concatenate(keys), np.concatenate(known)
    frame = np.arange(frames)
    after = np.clip(np.searchsorted(at, frame, side="right"), 1, len(at) - 1)
    part = _eased(np.clip((frame - at[after - 1]) / (at[after] - at[after - 1]), 0, 1))[:, None]
    found: Array = of[after - 1] + part * (of[after] - of[after - 1])
    return found


def _lift(depth: Array, fps: float) -> Array:
    """Heights (T,), without kinks, by which what is ``depth`` (T,) under the ground comes out of it."""
    reach = max(1, round(SOFT * fps))
    deepest = np.max(_windows(np.maximum(depth, 0), reach), axis=1)
    # a mean over the window in which each is the deepest is as high as the one in the middle
    bell = np.hanning(2 * reach + 3)[1:-1]
    found: Array = _windows(deepest, reach) @ (bell / bell.sum())
    return found


def _windows(values: Array, reach: int) -> Array:
    return np.lib.stride_tricks.sliding_window_view(np.pad(values, reach, mode="edge"), 2 * reach + 1)


def _bounded(shift: Array) -> Array:
    """Shifts (T, N) no longer than FARTHEST; short ones are as they are within a few per cent."""
    length = np.linalg.norm(shift, axis=-1, keepdims=True) / FARTHEST
    bounded: Array = shift / (1 + length**4) ** 0.25
    return bounded


def _with_legs(motion: Motion, turned: Array) -> Motion:
    """The motion with the angles of hips, knees and ankles from the joints' rotations in the world (T, J, 3, 3)."""
    for side in LEFT_RIGHT:
        for part in BENT:
            index = HUMANOID.index(sided(side, part))
            joint = HUMANOID.joints[index]
            local = product(inverse(turned[:, joint.parent]), turned[:, index])
            names = tuple(f"{joint.name}.r{axis}" for axis in AXES)
            had = dict(zip(motion.channels, motion.units, strict=True))
            units = tuple(had.get(name, "deg") for name in names)
            angles = euler_of(local, joint) * np.array([TURN[unit] for unit in units]) / (2 * np.pi)
            motion = with_channels(motion, names, angles, units)
    return motion
