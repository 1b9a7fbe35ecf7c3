"""Holding feet: a standing foot stays in place, whatever the root does meanwhile.

A foot stands while its heel, ball or toe tip is low and slow. The contact of each, between 0 and 1, decides whose
movement over the ground is removed from the foot: the heel's after landing, that of all three while the sole is flat,
the ball's and toes' as the foot rolls off. The removed movement adds up to a shift of the foot; over a stance its
median is 0, so the foot stands where it stood on average. Before and after, the shift blends in and out smoothly. Hip,
knee and ankle follow by two-bone inverse kinematics (:class:`motet.figures.two_bones.TwoBones`).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotionError
from motet.figures.feet.contacts import SOLES, ContactSettings, contacts_of, rise, smoothed
from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, LEG, Figure, ground_under, leg_length, sided, sole_points
from motet.figures.two_bones import TwoBones
from motet.motion.kinematics import AXES, global_transforms, posed, skeleton_of, with_channels
from motet.motion.motion import Motion
from motet.motion.rotations import Array, inverse, product, quat_to_rotmat, rotated
from motet.motion.scalar_or_batch import Quaternion, Vector, parts


@dataclass(frozen=True)
class HoldSettings:
    """Seconds, metres and metres per second.

    contact: when a point of the sole stands. lifted: a foot off the ground for less stays where it stands. blend: in
    which a shift comes and goes, most of it in half of that. farthest: a foot is shifted by less; what slides farther
    than twice that in a stance does slide. soft: before and after a foot is in the ground it is being lifted out of it.
    tremble: what is shorter is no movement. anchor: at the start of a stance, says where the foot stands; None for all
    of it.
    """

    contact: ContactSettings = SOLES
    lifted: float = 0.1
    blend: float = 0.2
    farthest: float = 0.15
    soft: float = 0.05
    tremble: float = 0.015
    anchor: float | None = None


def hold_feet(
    motion: Motion, trembling: bool = False, ground: float | None = None, anchor: float | None = None
) -> Motion:
    """The motion of any human figure with its standing feet held in place and never below ground, by turning hips,
    knees and ankles; the root and all other joints are unchanged, and the feet keep their directions in the world.

    The ground is level, and where :func:`motet.motion.to_humanoid` lays it: the soles are deeper in 5 % of the frames.
    A foot is shifted by 15 cm at most, and a leg that is nearly straight is hardly drawn longer: what is left slides
    on. Lengths are those of the figure at the humanoid's size.

    trembling: whether the feet tremble and slide like those of a model that outputs only joint angles. ground: its
        height in metres, where it is known of a motion of the humanoid. anchor: seconds at the start of a stance that
        say where the foot stands, by default all of it: what comes later then changes nothing.
    MotionError, with the reason, for a figure that is not human or does not stand along y.
    """
    if len(motion) < 2:
        return motion
    skeleton, (rotations, places) = skeleton_of(motion), global_transforms(motion)
    legs, scale, soles = _measured(motion, rotations, places, ground)
    settings = HoldSettings(anchor=anchor)
    if trembling:  # contact is measured over a longer time, and may slide faster
        settings = replace(settings, contact=ContactSettings(speeds=(0.7, 3.0), calm=0.06))
    turned = np.array(rotations)
    for (joints, hinge), points in zip(legs, np.split(soles, 2, axis=1), strict=True):
        hip, knee, ankle = (places[:, i] * scale for i in joints)
        leg = TwoBones(*map(parts, (hip, knee, ankle, rotated(rotations[:, joints[1]], hinge))))
        turns = map(_matrices, leg.turns(_target(leg, points, motion.fps, settings)))
        for i, turn in zip(joints, (*turns, np.eye(3)), strict=True):
            hanging = list(skeleton.subtree(skeleton.names[i]))
            turned[:, hanging] = product(turn[..., None, :, :], rotations[:, hanging])
    own = {}
    for i in (i for joints, _ in legs for i in joints):
        joint = skeleton.joints[i]
        lacking = tuple(name for axis in AXES if (name := f"{joint.name}.r{axis}") not in motion.channels)
        # the humanoid's joints get three angles; those of another figure keep to the ones they have, as knees with one
        if lacking and (skeleton == HUMANOID or len(lacking) == 3):
            still = np.zeros((len(motion), len(lacking)))
            motion = with_channels(motion, lacking, still, ("deg",) * len(lacking))
        own[joint.name] = product(inverse(turned[:, joint.parent]), turned[:, i])
    return posed(motion, own, {})


def _measured(
    motion: Motion, rotations: Array, places: Array, ground: float | None
) -> tuple[list[tuple[list[int], Array]], float, Array]:
    """The left and right leg of a motion, the scale to the humanoid's size, and points (T, P, 3) of both soles in it.

    A leg: the joints of hip, knee and ankle, and the knee's axis (3,), to the left, in its joint's frame. The soles are
    above a ground at 0, the left one's points first.
    """
    if motion.skeleton == HUMANOID:
        soles = sole_points(rotations, places)
        soles[..., 1] -= ground_under(soles) if ground is None else ground
        sides = [[HUMANOID.index(sided(side, part)) for part in LEG[:3]] for side in LEFT_RIGHT]
        return [(joints, np.array([1.0, 0.0, 0.0])) for joints in sides], 1.0, soles
    figure = Figure.of(motion)
    fitted = figure.fitted
    joints_of = figure.fitted.joint_map.joints
    if not np.array_equal(figure.turn, np.eye(3)):
        raise MotionError("this figure does not stand along y: turn it upright with to_humanoid")
    scale = leg_length() / fitted.leg
    feet = {bone: product(rotations[:, joints_of[bone]], fitted.aligned[joints_of[bone]]) for bone in fitted.heights}
    soles = fitted.soles(feet, places) * scale
    # how thick the soles of another figure are is not known: each of their points is on the ground where it is lowest
    soles[..., 1] -= np.percentile(soles[..., 1], 5, axis=0)
    sides = [[joints_of[sided(side, part)] for part in LEG[:3]] for side in LEFT_RIGHT]
    return [(joints, fitted.aligned[joints[1]][:, 0]) for joints in sides], scale, soles


def _target(leg: TwoBones, points: Array, fps: float, settings: HoldSettings) -> Vector:
    """The ankle's target in T frames, from points (T, K, 3) of the sole over ground at 0."""
    (shift_x, shift_z), (x, y, z) = _shift(points, fps, settings).T, leg.ankle
    to_x, to_y, to_z = leg.eased((x + shift_x, y, z + shift_z))
    depth = -(points[..., 1].min(axis=1) + to_y - y)
    return to_x, to_y + np.minimum(lift(depth, settings.soft * fps), settings.farthest), to_z


def _matrices(quats: Quaternion) -> Array:
    return quat_to_rotmat(np.stack(quats, axis=-1))


def _shift(points: Array, fps: float, settings: HoldSettings) -> Array:
    """The shift (T, 2) of a foot over the ground."""
    steps = np.diff(points[..., [0, 2]], axis=0)
    touch = contacts_of(points, fps, settings.contact)
    weights = touch / np.maximum(touch.sum(axis=1, keepdims=True), 1e-9)
    undone = -(touch.max(axis=1) * (weights[..., None] * steps).sum(axis=1).T).T
    times = []
    values = []
    # the first and last frame of each stance; those with less between them than a lifted foot are one
    edges = np.flatnonzero(np.diff([False, *(touch.max(axis=1) > 0), False])).reshape(-1, 2)
    apart = edges[1:, 0] - edges[:-1, 1] >= settings.lifted * fps
    starts = edges[np.r_[True, apart][: len(edges)], 0]
    stops = edges[np.r_[apart, True][: len(edges)], 1]
    for start, stop in zip(starts, stops, strict=True):
        path = np.concatenate([np.zeros((1, 2)), np.cumsum(undone[start:stop], axis=0)])
        path -= np.median(path if settings.anchor is None else path[: round(settings.anchor * fps) + 1], axis=0)
        times.append(np.arange(start, stop + 1))
        values.append(path)
    shift = _between(times, values, len(points), settings.blend * fps)
    shift = smoothed(shift[:, None], settings.tremble, fps)[:, 0]
    # no longer than the farthest; short ones are as they are within a few per cent
    length = np.linalg.norm(shift, axis=-1, keepdims=True) / settings.farthest
    found: Array = shift / (1 + length**4) ** 0.25
    return found


def _between(times: list[NDArray[np.intp]], values: list[Array], frames: int, blend: float) -> Array:
    """Values (frames, 2) that are known at ``times``, go to 0 and come back in ``blend`` frames, smoothly."""
    zero = np.zeros((1, 2))
    keys = [np.array([-2 * blend])]
    known = [zero]
    for time, value in zip(times, values, strict=True):
        last = keys[-1][-1]
        if time[0] - last > 2 * blend:
            keys.append(np.array([last + blend, time[0] - blend]))
            known += [zero, zero]
        keys.append(time.astype(np.float64))
        known.append(value)
    keys.append(keys[-1][-1:] + blend)
    known.append(zero)
    at = np.concatenate(keys)
    of = np.concatenate(known)
    frame = np.arange(frames)
    after = np.clip(np.searchsorted(at, frame, side="right"), 1, len(at) - 1)
    part = rise((frame - at[after - 1]) / (at[after] - at[after - 1]), 0, 1)[:, None]
    return of[after - 1] + part * (of[after] - of[after - 1])


def lift(depth: Array, soft: float) -> Array:
    """Heights (T,), without kinks, by which what is ``depth`` (T,) under the ground comes out of it in ``soft``
    frames."""
    reach = max(1, round(soft))
    # a mean over the window in which each is the deepest is as high as the one in the middle
    deepest = np.max(windows(np.maximum(depth, 0), reach), axis=1)
    bell = np.hanning(2 * reach + 3)[1:-1]
    found: Array = windows(deepest, reach) @ (bell / bell.sum())
    return found


def windows(values: Array, reach: int) -> Array:
    """Values (T,) with ``reach`` before and as many after each, (T, 2 reach + 1); those at the ends go on."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(values, reach, mode="edge"), 2 * reach + 1)
