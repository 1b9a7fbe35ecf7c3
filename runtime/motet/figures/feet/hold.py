"""Holding feet: a standing foot stays in place, whatever the root does meanwhile.

A foot stands while its heel, ball or toe tip is low and slow. The contact of each, between 0 and 1, decides whose
movement over the ground is removed from the foot: the heel's after landing, that of all three while the sole is flat,
the ball's and toes' as the foot rolls off. The removed movement adds up to a shift of the foot; over a stance its
median is 0, so the foot stands where it stood on average. Before and after, the shift blends in and out smoothly. Hip,
knee and ankle follow by two-bone inverse kinematics (:class:`motet.figures.two_bones.TwoBones`).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from motet.errors import MotionError
from motet.figures.feet.contacts import (
    SOLES,
    TREMBLE,
    TREMBLING,
    ContactSettings,
    bell,
    contacts_of,
    rise,
    smoothed,
    windows,
)
from motet.figures.humanoid import (
    HUMANOID,
    LEFT_RIGHT,
    LEG,
    Figure,
    ground_under,
    leg_length,
    limb_of,
    sole_points,
)
from motet.figures.humanoid.measure import Fitted
from motet.figures.two_bones import TwoBones
from motet.motion.kinematics import (
    channels_of,
    global_transforms,
    posed,
    skeleton_of,
    with_channels,
)
from motet.motion.motion import Motion
from motet.motion.rotations import Array, Indices, Mask, identities, inverse, product, quat_to_rotmat, rotated
from motet.motion.scalar_or_batch import Quaternion, Vector, parts


@dataclass(frozen=True)
class HoldSettings:
    """When feet are held, and how far and how fast they are moved for it."""

    contact: ContactSettings = SOLES
    """When a point of the sole stands."""

    lifted: float = 0.1
    """Seconds: a foot off the ground for less stays where it stands."""

    blend: float = 0.2
    """Seconds in which a shift fades in or out, most of it in half of that."""

    farthest: float = 0.15
    """Metres: a foot is shifted by less. What slides farther than twice that in a stance is meant to slide."""

    soft: float = 0.05
    """Seconds before and after a foot is below the ground in which it is lifted out."""

    tremble: float = TREMBLE
    """Seconds: movement that is shorter is noise."""

    anchor: float | None = None
    """Seconds at the start of a stance that decide where the foot stands; None for all of the stance."""


class Leg(NamedTuple):
    """A leg of a figure."""

    joints: list[int]
    """Indices of the joints of hip, knee and ankle."""

    hinge: Array
    """The knee's axis (3,), to the left, in the frame of the knee's joint."""


def hold_feet(
    motion: Motion,
    trembling: bool = False,
    ground: float | None = None,
    anchor: float | None = None,
) -> Motion:
    """The motion of any human figure with its standing feet held in place and never below ground, by turning hips,
    knees and ankles; the root and all other joints are unchanged, and the feet keep their directions in the world.

    The ground is level, and where :func:`motet.motion.to_humanoid` lays it: the soles are deeper in 5 % of the frames.
    A foot is shifted by 15 cm at most, and a leg that is nearly straight hardly lengthens: the rest slides on. Lengths
    are those of the figure at the humanoid's size.

    trembling: whether the feet tremble and slide like those of a model that outputs only joint angles. ground: its
        height in metres, where it is known of a motion of the humanoid. anchor: seconds at the start of a stance that
        decide where the foot stands, by default all of it; later frames then change nothing.
    MotionError, with the reason, for a figure that is not human or does not stand along y.
    """
    if len(motion) < 2:
        return motion
    skeleton = skeleton_of(motion)
    # where joints and soles are, at the humanoid's size
    rotations, places = global_transforms(motion)
    legs, scale, soles = _measured(motion, rotations, places, ground)
    settings = HoldSettings(contact=TREMBLING if trembling else SOLES, anchor=anchor)

    # each foot is led to its target; what hangs on hip, knee and ankle turns along
    turned = np.array(rotations)
    for leg, points in zip(legs, np.split(soles, 2, axis=1), strict=True):
        turns = _leg_turns(leg, rotations, places * scale, points, motion.fps, settings)
        for joint, turn in zip(leg.joints, turns, strict=True):
            hanging = skeleton.below(joint)
            turned[:, hanging] = product(turn[..., None, :, :], rotations[:, hanging])
    return _with_turned(motion, turned, legs[0].joints + legs[1].joints)


def _leg_turns(
    leg: Leg,
    rotations: Array,
    places: Array,
    points: Array,
    fps: float,
    settings: HoldSettings,
) -> tuple[Array, Array, Array]:
    """Turns (T, 3, 3) in the world of thigh, shin and foot that hold the foot; the foot keeps its direction.

    rotations: (T, J, 3, 3) of all joints. places: their positions (T, J, 3) in metres. points: (T, K, 3) of the sole.
    """
    # the leg as two bones in all frames at once, with the knee's axis in the world
    hip, knee, ankle = (places[:, joint] for joint in leg.joints)
    hinge_world = rotated(rotations[:, leg.joints[1]], leg.hinge)
    limb = TwoBones(*map(parts, (hip, knee, ankle, hinge_world)))
    thigh_turn, shin_turn = limb.turns(_target(limb, points, fps, settings))
    return _matrices(thigh_turn), _matrices(shin_turn), np.eye(3)


def _with_turned(motion: Motion, turned: Array, joints: list[int]) -> Motion:
    """The motion with some of its joints turned as in world rotations (T, J, 3, 3)."""
    # each joint in its parent's frame, as channels have it
    skeleton = skeleton_of(motion)
    local = {}
    for i in joints:
        joint = skeleton.joints[i]
        lacking = tuple(name for name in channels_of(joint.name, "r") if name not in motion.channels)
        # the humanoid's joints get three angles; those of another figure keep to the ones they have, as knees with one
        if lacking and (skeleton == HUMANOID or len(lacking) == 3):
            still = np.zeros((len(motion), len(lacking)))
            motion = with_channels(motion, lacking, still, ("deg",) * len(lacking))
        local[joint.name] = product(inverse(turned[:, joint.parent]), turned[:, i])
    return posed(motion, local, {})


def _measured(motion: Motion, rotations: Array, places: Array, ground: float | None) -> tuple[list[Leg], float, Array]:
    """The left and right leg of a motion, the scale to the humanoid's size, and points (T, P, 3) of both soles in it.

    The soles are above a ground at 0, the left one's points first.
    """
    if motion.skeleton == HUMANOID:
        soles = sole_points(rotations, places)
        soles[..., 1] -= ground_under(soles) if ground is None else ground
        return (
            _legs(HUMANOID.places, identities(places.shape[1])),
            1.0,
            soles,
        )

    figure = Figure.of(motion)
    fitted = figure.fitted
    if not np.array_equal(figure.turn, np.eye(3)):
        raise MotionError("this figure does not stand along y: turn it upright with to_humanoid")
    scale = leg_length() / fitted.leg
    soles = _soles(fitted, rotations, places) * scale
    # how thick the soles of another figure are is not known: each of their points is on the ground where it is lowest
    soles[..., 1] -= np.percentile(soles[..., 1], 5, axis=0)
    return _legs(fitted.joint_map.joints, fitted.aligned), scale, soles


def _soles(fitted: Fitted, rotations: Array, places: Array) -> Array:
    """Points (T, P, 3) of a figure's soles in its own unit, from rotations and positions of its joints."""
    feet = {}
    for bone in fitted.heights:
        joint = fitted.joint_map.joints[bone]
        feet[bone] = product(rotations[:, joint], fitted.aligned[joint])
    return fitted.soles(feet, places)


def _legs(joint_of: Mapping[str, int], aligned: Array) -> list[Leg]:
    """The left and right leg, from the joint of each bone and the rotations (J, 3, 3) of bones in their joints."""
    legs = []
    for side in LEFT_RIGHT:
        joints = [joint_of[bone] for bone in limb_of(side, LEG[:3])]
        legs.append(Leg(joints, aligned[joints[1], :, 0]))
    return legs


def _target(leg: TwoBones, points: Array, fps: float, settings: HoldSettings) -> Vector:
    """The ankle's target in T frames, from points (T, K, 3) of the sole over ground at 0."""
    # over the ground, the ankle shifts so that a standing foot stays
    shift_x, shift_z = _shift(points, fps, settings).T
    x, y, z = leg.ankle
    target_x, target_y, target_z = leg.eased((x + shift_x, y, z + shift_z))

    # upwards, it rises until no point of the sole is below the ground
    depth = -(points[..., 1].min(axis=1) + target_y - y)
    rise_out = np.minimum(lift(depth, settings.soft * fps), settings.farthest)
    return target_x, target_y + rise_out, target_z


def _matrices(quats: Quaternion) -> Array:
    return quat_to_rotmat(np.stack(quats, axis=-1))


def _shift(points: Array, fps: float, settings: HoldSettings) -> Array:
    """The shift (T, 2) of a foot over the ground that keeps it in place while it stands, from points (T, K, 3)."""
    # the movement to be undone is the mean of the points' steps, by how firmly each stands
    steps = np.diff(points[..., [0, 2]], axis=0)
    touch = contacts_of(points, fps, settings.contact)
    weights = touch / np.maximum(touch.sum(axis=1, keepdims=True), 1e-9)
    undone = -(touch.max(axis=1) * (weights[..., None] * steps).sum(axis=1).T).T

    # over each stance the undone steps add up to a path, and between stances the shift fades out and in
    times, paths = _stance_paths(undone, touch.max(axis=1) > 0, fps, settings)
    shift = _between(times, paths, len(points), settings.blend * fps)
    shift = smoothed(shift[:, None], settings.tremble, fps)[:, 0]

    # a shift stays below the farthest; short ones are unchanged within a few per cent
    length = np.linalg.norm(shift, axis=-1, keepdims=True) / settings.farthest
    return np.asarray(shift / (1 + length**4) ** 0.25)


def _stance_paths(
    undone: Array, standing: Mask, fps: float, settings: HoldSettings
) -> tuple[list[Indices], list[Array]]:
    """The frames of each stance, and the foot's shift (T, 2) on them around the place where it stands, from the steps
    (T - 1, 2) to be undone and whether the foot stands (T - 1,)."""
    times = []
    paths = []
    for start, stop in _stances(standing, settings.lifted * fps):
        # steps add up to a path, whose median becomes the place where the foot stands
        path = np.concatenate([np.zeros((1, 2)), np.cumsum(undone[start:stop], axis=0)])
        path -= np.median(
            path if settings.anchor is None else path[: round(settings.anchor * fps) + 1],
            axis=0,
        )
        times.append(np.arange(start, stop + 1))
        paths.append(path)
    return times, paths


def _stances(standing: Mask, lifted: float) -> Iterator[tuple[int, int]]:
    """The first and last frame of each stance, from whether a foot stands (T - 1,) from each frame to the next; stances
    with fewer than ``lifted`` frames between them are one."""
    # the frames at which a stance starts and stops; neighbours that are near become one
    edges = np.flatnonzero(np.diff([False, *standing, False])).reshape(-1, 2)
    apart = edges[1:, 0] - edges[:-1, 1] >= lifted
    starts = edges[np.r_[True, apart][: len(edges)], 0]
    stops = edges[np.r_[apart, True][: len(edges)], 1]
    return zip(starts.tolist(), stops.tolist(), strict=True)


def _between(times: list[Indices], values: list[Array], frames: int, blend: float) -> Array:
    """Values (frames, 2) that are known at ``times``, go to 0 and come back in ``blend`` frames, smoothly."""
    key_times, key_values = _keys(times, values, blend)
    # each frame lies on a smooth step from the key before it to the key after
    frame = np.arange(frames)
    after = np.clip(np.searchsorted(key_times, frame, side="right"), 1, len(key_times) - 1)
    before = after - 1
    part = rise((frame - key_times[before]) / (key_times[after] - key_times[before]), 0, 1)[:, None]
    return key_values[before] + part * (key_values[after] - key_values[before])


def _keys(times: list[Indices], values: list[Array], blend: float) -> tuple[Array, Array]:
    """Times (K,) and values (K, 2): the known ones, and zeros wherever there is time to fade out and in again."""
    # the first and the last key lie outside the motion, so that each frame is between two
    zero = np.zeros((1, 2))
    key_times = [np.array([-2 * blend])]
    key_values = [zero]
    for time, value in zip(times, values, strict=True):
        last = key_times[-1][-1]
        # a pause that is long enough goes to 0 and back; a shorter one straight from stance to stance
        if time[0] - last > 2 * blend:
            key_times.append(np.array([last + blend, time[0] - blend]))
            key_values += [zero, zero]
        key_times.append(time.astype(np.float64))
        key_values.append(value)
    key_times.append(key_times[-1][-1:] + blend)
    key_values.append(zero)
    return np.concatenate(key_times), np.concatenate(key_values)


def lift(depth: Array, soft: float) -> Array:
    """Heights (T,), without kinks, that raise a point ``depth`` (T,) below the ground out of it within ``soft``
    frames."""
    reach = max(1, round(soft))
    # a mean over a window of maxima is at least as high as the depth in its middle
    deepest = np.max(windows(np.maximum(depth, 0), reach), axis=1)
    return windows(deepest, reach) @ bell(reach)
